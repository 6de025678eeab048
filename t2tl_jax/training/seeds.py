"""Seeds: reading them from text, deriving independent key streams, placing them on devices."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

TRAINING, EVALUATION, ANIMATION, SELECTION = 1, 2, 3, 4
"""Names of the key streams of a seed. Adding a stream does not move the others."""


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
    return jax.vmap(lambda seed: jax.random.fold_in(jax.random.key(seed), stream))(np.asarray(seeds, np.uint32))


def seed_sharding(count: int, devices: Sequence[jax.Device] | None = None) -> NamedSharding | None:
    """How to spread a leading axis of ``count`` seeds over devices: evenly, over as many as divide the count.

    Returns None where a single device does all the work. Every array of a training state has the leading seed axis, so
    this one sharding fits the whole tree.
    """
    devices = jax.devices() if devices is None else list(devices)
    used = max(n for n in range(1, len(devices) + 1) if count % n == 0)
    if used == 1:
        return None
    mesh = Mesh(np.array(devices[:used]), ("seeds",), axis_types=(AxisType.Auto,))
    return NamedSharding(mesh, PartitionSpec("seeds"))


def place(tree: Any, sharding: NamedSharding | None) -> Any:
    """Move a tree with a leading seed axis to its devices; one copy in every case, never a view of host memory."""
    if sharding is None:
        return jax.tree.map(lambda x: jax.numpy.array(x, copy=True), tree)
    return jax.device_put(tree, sharding)
