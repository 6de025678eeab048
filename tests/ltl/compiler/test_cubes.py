"""Sets of letters as cubes."""

import numpy as np

from t2tl_jax.ltl.compiler.cubes import cover


def test_cover_is_exact():
    rng = np.random.default_rng(0)
    for size in (0, 1, 2, 3, 5):
        for density in (0.2, 0.5, 0.9):
            letters = rng.random(2**size) < density
            cubes = cover(letters)
            for letter, wanted in enumerate(letters):
                assert wanted == any(all(bool(letter >> j & 1) == value for j, value in cube) for cube in cubes)
