"""What somebody can reach who chooses the letters: the shortest way to true, and the most that a row can pay."""

import jax
import jax.numpy as jnp

from t2tl_jax.ltl import lookup
from t2tl_jax.ltl.table import TaskTable


def distance_to_true(table: TaskTable, letters: jax.Array | None = None) -> jax.Array:
    """The fewest letters that make each row true: int32 `[rows]`, `num_rows` where no letters do.

    `letters`: int32 `[letters]`, those that can be chosen; None for all of them.
    """
    never = table.num_rows
    start = jnp.where(table.verdict > 0, 0, never).astype(jnp.int32)

    def nearer(found: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        distance, _ = found
        after = distance[nearest_to_true(table, distance, letters)] + 1
        closer = jnp.where(table.verdict == 0, jnp.minimum(distance, after), distance)
        return closer, (closer < distance).any()

    return jax.lax.while_loop(lambda found: found[1], nearer, (start, jnp.bool_(True)))[0]


def nearest_to_true(table: TaskTable, distance: jax.Array, letters: jax.Array | None = None) -> jax.Array:
    """The row int32 `[rows]` with the least distance (int32 `[rows]`) that one letter can lead to, that of the first
    such letter; `letters` as for `distance_to_true`."""
    if letters is not None:
        after, _ = table.step_all(letters)  # [rows, letters]
        return jnp.take_along_axis(after, distance[after].argmin(axis=-1, keepdims=True), axis=-1)[:, 0]
    row, _ = _every_outcome(table)
    return row[lookup.best_outcome(table.branches, table.num_outcomes, -distance[row])]


def best_worth(table: TaskTable, value: jax.Array, discount: float | jax.Array) -> jax.Array:
    """The most that one letter can bring, float32 `[rows]`: what it pays, and the discounted value (float32 `[rows]`)
    of the row that it leads to."""
    row, reward = _every_outcome(table)
    worth = reward + discount * value[row]
    return worth[lookup.best_outcome(table.branches, table.num_outcomes, worth)]


def _every_outcome(table: TaskTable) -> tuple[jax.Array, jax.Array]:
    """The meaning of all outcomes; numbers between two powers of two that no row has are the last row."""
    row, reward = table.meaning(jnp.arange(table.num_outcomes, dtype=jnp.int32))
    return jnp.minimum(row, table.num_rows - 1), reward
