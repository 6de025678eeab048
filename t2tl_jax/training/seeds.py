"""Seeds: reading them from text, deriving independent key streams."""

from collections.abc import Sequence
from functools import partial

import jax
import numpy as np

TRAINING, EVALUATION, ANIMATION, SELECTION, CERTIFICATE = 1, 2, 3, 4, 5
"""Names of the key streams of a seed. Adding a stream does not move the others."""

FIRST_TUNING_SEED = 100
"""Settings are chosen on seeds from here on, and results are reported on those below: a maximum over settings that were
tried on the reported seeds themselves would flatter the method that was searched most."""


def parse_seeds(text: str) -> tuple[int, ...]:
    """Read a count (``"4"`` means seeds 0, 1, 2, 3) or a list (``"0,3,7"``; ``"7,"`` is the single seed 7).

    Raises:
        ValueError: for anything else, for repeated seeds and for seeds outside 0 ... 2^32 - 1.
    """
    parts = [part.strip() for part in text.split(",")]
    is_list = len(parts) > 1
    if is_list and parts[-1] == "":
        parts.pop()
    if not parts or not all(part.isascii() and part.isdigit() for part in parts):
        raise ValueError(f"seeds are a count such as 4 or a list such as 0,3,7, got {text!r}")
    numbers = tuple(int(part) for part in parts)
    if not is_list:
        if not 1 <= numbers[0] <= 10_000:
            raise ValueError(
                f"the number of seeds must lie between 1 and 10000, got {text!r} (for a single seed write '{text},')"
            )
        return tuple(range(numbers[0]))
    if len(set(numbers)) != len(numbers):
        raise ValueError(f"every seed may appear once, got {text!r}")
    if max(numbers) >= 2**32:
        raise ValueError(f"seeds must be below 2^32, got {max(numbers)}")
    return numbers


def stream_keys(seeds: Sequence[int], stream: int) -> jax.Array:
    """One typed key per seed, ``key[len(seeds)]``, for one of the streams named above."""
    return _keys(np.asarray(seeds, np.uint32), stream, jax.config.values["jax_default_prng_impl"])


@partial(jax.jit, static_argnums=2)  # one small program, where every start would compile one for each operation
def _keys(seeds: jax.Array, stream: jax.Array, kind: str) -> jax.Array:
    return jax.vmap(lambda seed: jax.random.fold_in(jax.random.key(seed, impl=kind), stream))(seeds)
