"""How rows lie in memory beside a batch, and how their entries are combined there."""

import math
from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp

from envs.straight_line.numbers import CALLS

ROWS_LAST_UP_TO = {"cpu": math.inf, "gpu": 4096}
"""By kind of device the longest batch for which the entries of a row lie together in memory, instead of one number of
the whole batch: as measured on an H200 and two processors, see docs/performance.md. Other kinds are taken for a GPU."""

ROWS_WHOLE_UP_TO = 8192
"""The longest batch that has rows before it combined whole; for a longer one they are cut into `PARTS`."""

PARTS = 3
"""How many parts a row is cut into, which are combined entry by entry before what is left is reduced. On an H200 two,
three and six are about as good on average over the batches that were tried, and three are among the best for 24,576
environments, as many as twelve seeds of `zone_ppo_long` have: see docs/performance.md."""


class Layout(NamedTuple):
    """How rows lie and are combined."""

    axis: int
    """Of their entries: before the axes of a batch (0), or behind them (-1)."""
    parts: int = 1
    """How many parts a row is cut into, if its size allows it."""


def layout_for(batch: Sequence[int]) -> Layout:
    """What is best for what each device of the mesh, if there is one, has of a batch of that shape."""
    mesh = jax.sharding.get_abstract_mesh()
    on_each = math.ceil(math.prod(batch) / (1 if mesh.empty else mesh.size))
    if on_each <= ROWS_LAST_UP_TO.get(jax.default_backend(), ROWS_LAST_UP_TO["gpu"]):
        return Layout(axis=-1)
    return Layout(axis=0, parts=1 if on_each <= ROWS_WHOLE_UP_TO else PARTS)


def shortened(row: jax.Array, name: str, layout: Layout) -> jax.Array:
    """A row whose entries combine to the same, but for rounding: the parts of a row combined with one another.

    Args:
        row: `[size, ...]`, or `[..., size]` where entries lie behind the batch.
        name: of the operation, one of `CALLS`.
        layout: with the number of parts. A row stays whole if these do not divide its size, or are as many as entries.

    Returns:
        The same shape with ``size / parts`` in place of the size.
    """
    size = row.shape[layout.axis]
    if layout.parts == 1 or size % layout.parts or size == layout.parts:
        return row
    return reduce(CALLS[name], jnp.split(row, layout.parts, layout.axis))
