"""Which rows of the table learn from a transition: all that are open, or a fixed number of them, drawn anew each time.

A transition with its letter is one of every row, whatever the row was that the agent was in. So what replay keeps stays
true when other tasks take the place of the present ones, but for that row: its number may come to mean another formula.
A mark of the formula is kept beside it, by which it is known again.
"""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from t2tl_jax.ltl import TaskTable

if TYPE_CHECKING:
    from t2tl_jax.agents.td_learning import Marked

_FACTOR = 2_654_435_761  # odd, so that no token is lost; from Knuth's multiplicative hashing


def marks(table: TaskTable) -> jax.Array:
    """A number for each row's formula, uint32[rows]: the same wherever the formula stands, and in every table.

    Two formulas have the same one by chance once in four billion times. Reward machines have no formulas, and their
    table never changes.
    """
    length = table.tokens.shape[-1]
    powers = np.array([pow(_FACTOR, place + 1, 2**32) for place in range(length)], np.uint32)
    mixed = (table.tokens.astype(jnp.uint32) + 1) * np.uint32(0x9E3779B1)
    mixed = (mixed ^ (mixed >> 15)) * np.uint32(0x85EBCA77)
    return jnp.where(table.mask, mixed * powers, np.uint32(0)).sum(axis=-1, dtype=jnp.uint32)


def drawn_rows(table: TaskTable, batch: "Marked", known: jax.Array, count: int, key: jax.Array) -> jax.Array:
    """The rows that learn from each transition, int32[B, count]: the row that the agent was in, and others.

    The others are drawn uniformly from the open rows, with replacement, so that on average they are all open rows. A
    transition from a table whose rows are gone has one more of them.

    Args:
        table: the present tasks.
        batch: B transitions with their marks.
        known: `marks` of the table.
        count: rows of a transition.
        key: random key.
    """
    is_open = table.is_open
    every = jnp.flatnonzero(is_open, size=table.num_rows, fill_value=1)
    rows = every[jax.random.randint(key, (len(batch.row), count), 0, is_open.sum())].astype(jnp.int32)
    is_there = is_open[batch.row] & (known[batch.row] == batch.mark)
    return rows.at[:, 0].set(jnp.where(is_there, batch.row, rows[:, 0]))
