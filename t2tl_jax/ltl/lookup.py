"""Letters looked up in the arrays of a table, see `TaskTable.branches`: the outcome in a row, in all, and the best.

The rows of a letter lie side by side, and arrays of parts are small: what is read for a letter does not grow with the
number of letters.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp


def outcome(branches: Sequence[jax.Array], settled: int, row: jax.Array, letter: jax.Array) -> jax.Array:
    """The outcome int32 `[...]` of letters in rows, both int32 `[...]`.

    Args:
        branches: those of a table.
        settled: how many outcomes there are; greater entries are nodes of the next array.
        row: int32 `[...]`.
        letter: int32 `[...]`.
    """
    values = _values(branches, letter)
    return _rest(branches, settled, branches[0][values[0], row], values)


def outcome_in_all(branches: Sequence[jax.Array], settled: int, letter: jax.Array) -> jax.Array:
    """The outcome int32 `[rows, ...]` of letters int32 `[...]` in every row; arguments as for `outcome`."""
    values = _values(branches, letter)
    return _rest(branches, settled, jnp.moveaxis(branches[0][values[0]], -1, 0), values)


def best_outcome(branches: Sequence[jax.Array], settled: int, value: jax.Array) -> jax.Array:
    """The outcome int32 `[rows]` with the greatest value that one letter can lead to, that of the first such letter.

    Args:
        branches, settled: as for `outcome`.
        value: `[outcomes]`.
    """
    best = every = jnp.arange(settled, dtype=jnp.int32)
    for branch in reversed(branches):
        leads_to = best[branch]  # [values, nodes]
        first = value[leads_to].argmax(axis=0)
        best = jnp.concatenate([every, jnp.take_along_axis(leads_to, first[None], axis=0)[0]])
    return best[settled:]


def _values(branches: Sequence[jax.Array], letter: jax.Array) -> list[jax.Array]:
    """The value of each part of letters: int32 `[...]` each."""
    if len(branches) == 1:
        return [letter]
    values = []
    for branch in reversed(branches):
        size = branch.shape[-2]  # a power of two
        values.append(letter & (size - 1))
        letter = letter >> size.bit_length() - 1
    return values[::-1]


def _rest(branches: Sequence[jax.Array], settled: int, at: jax.Array, values: Sequence[jax.Array]) -> jax.Array:
    """The outcomes that the other parts of letters lead to from entries of the first array."""
    for branch, value in zip(branches[1:], values[1:], strict=True):
        at = jnp.where(at < settled, at, branch[value, jnp.maximum(at - settled, 0)])
    return at
