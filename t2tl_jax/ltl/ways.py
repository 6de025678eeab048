"""The ways that a row leaves open, each as a row of its own: the same task, as if it could only go on in that way.

A row that several letters bring on can be carried out in several ways. To each of them belongs a row that goes on as
the row does with the letters of that way, fails as it does, and stays what it is with all other letters. What reads a
table by its transitions reads such a row as any other one.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp

from t2tl_jax.ltl.ahead import distance_to_true
from t2tl_jax.ltl.errors import LTLError
from t2tl_jax.ltl.table import TaskTable


def check(table: TaskTable) -> None:
    """Refuse a table whose ways are not told apart.

    Raises:
        LTLError: for reward machines, and for letters that are looked up in parts.
    """
    if table.pays is not None:
        raise LTLError(
            "a plan chooses among the ways of a formula; a reward machine pays on its way, so that all of it counts. "
            "Leave plan at none"
        )
    if len(table.branches) > 1:
        raise LTLError(
            f"a plan needs a table with one array of letters, and {table.num_rows:,} rows of {table.num_letters:,} "
            "letters have several; take fewer tasks or propositions, or leave plan at none"
        )


def with_ways(table: TaskTable, letters: jax.Array, most: int) -> tuple[TaskTable, jax.Array]:
    """A table with a row for every way of every row, behind its own rows, and which of them are whose.

    A way is a row that one letter leads to and from which the task can still be carried out. One that comes no nearer
    to true and from which the row itself can be reached again is none: it only undoes what was done. Of more ways than
    `most` those are kept from which true is nearest.

    Args:
        table: of formulas, with R rows.
        letters: int32 `[L]`, those by which a way can begin.
        most: ways of a row.

    Returns:
        The table of R + R x K rows, of which no episode is to begin in one of the new ones; and int32 `[R, K]`, the
        rows of each row's ways, of which the first fills the places that are left over. A row with a single way or
        none has itself in all places. K is the lesser of L and `most`.

    Raises:
        LTLError: for reward machines, and for letters that are looked up in parts.
    """
    check(table)
    rows, never = table.num_rows, jnp.iinfo(jnp.int32).max
    (after_all,) = table.branches  # [every letter, R]
    own = jnp.arange(rows, dtype=jnp.int32)[:, None]

    # The rows that begin a way, each once: sorted by their distance to true, then by their number.
    after, _ = table.step_all(letters)  # [R, L]
    distance = distance_to_true(table, letters)
    undone = _reached(after)[after, own] & (distance[after] >= distance[:, None])
    leads = (table.verdict == 0)[:, None] & (distance[after] < rows) & ~undone
    by_distance = jnp.sort(jnp.where(leads, distance[after] * rows + after, never), axis=1)
    again = jnp.pad(by_distance[:, 1:] == by_distance[:, :-1], ((0, 0), (1, 0)))
    by_distance = jnp.sort(jnp.where(again, never, by_distance), axis=1)[:, :most]
    first = jnp.where(by_distance < never, by_distance % rows, -1)  # [R, K]

    count = first.shape[1]
    place = rows + own * count + jnp.arange(count, dtype=jnp.int32)  # [R, K]
    several = (first >= 0).sum(axis=1, keepdims=True) > 1
    whose = jnp.where(several, jnp.where(first >= 0, place, place[:, :1]), own)

    leads_to = after_all[..., None]  # [every letter, R, 1]
    goes_on = jnp.where((leads_to == first) | (table.verdict[leads_to] < 0), leads_to, place)
    repeated = jnp.repeat(jnp.arange(rows), count)
    longer = replace(
        table,
        tokens=jnp.concatenate([table.tokens, table.tokens[repeated]]),
        mask=jnp.concatenate([table.mask, table.mask[repeated]]),
        branches=(jnp.concatenate([after_all, goes_on.reshape(len(after_all), -1)], axis=1),),
        verdict=jnp.concatenate([table.verdict, table.verdict[repeated]]),
        starts=None if table.starts is None else jnp.pad(table.starts, (0, rows * count)),
    )
    return longer, whose


def _reached(after: jax.Array) -> jax.Array:
    """Which rows can be reached from which, themselves included: bool[R, R]; after: int32[R, L], where letters lead."""
    rows = len(after)
    one_step = jnp.eye(rows, dtype=bool).at[jnp.arange(rows)[:, None], after].set(True)

    def twice_as_many(_: jax.Array, reached: jax.Array) -> jax.Array:
        paths = reached.astype(jnp.float32)
        return paths @ paths > 0

    return jax.lax.fori_loop(0, (rows - 1).bit_length(), twice_as_many, one_step)
