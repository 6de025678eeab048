"""Sets of letters as cubes."""

import numpy as np
import pytest

from t2tl_jax.ltl.compiler.cubes import TooManyCubes, cover
from t2tl_jax.ltl.compiler.steps import from_dense


def test_cover_is_exact():
    rng = np.random.default_rng(0)
    for size in (0, 1, 2, 3, 5):
        for density in (0.2, 0.5, 0.9):
            letters = rng.random(2**size) < density
            cubes = cover(from_dense(letters[None].astype(int), 2, "every_subset"), 0, [1])
            for letter, wanted in enumerate(letters):
                assert wanted == any(all(bool(letter >> j & 1) == value for j, value in cube) for cube in cubes)


def test_what_nobody_could_read_is_not_listed():
    """Whether the number of true propositions is odd takes a cube for half of all letters."""
    parity = np.array([bin(letter).count("1") % 2 for letter in range(2**12)])
    with pytest.raises(TooManyCubes):
        cover(from_dense(parity[None], 2, "every_subset"), 0, [1])
