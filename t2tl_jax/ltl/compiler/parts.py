"""Letters read in parts: arrays in which a letter is looked up, as few as their size allows.

One array for all letters would have 2^P entries a row. So the propositions of a large alphabet are cut into parts, the
highest first. The first array says per value of its part and per row where that leads: what is settled by then is an
outcome, what is not is a node of the next array. Nodes are shared by all rows, and few: a row whose outcome hangs on
one part alone has one of them at most.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE, EVERY_SUBSET
from t2tl_jax.ltl.compiler.budget import Limits, way_out
from t2tl_jax.ltl.compiler.steps import Folding, Steps, folded, from_dense
from t2tl_jax.ltl.errors import TooLargeError

ONE_PART = 2**20
"""Most entries of the array when letters are looked up at once: 4 MiB, which a processor's caches hold."""

FEW_PARTS = 2**22
"""Most entries of all arrays where letters are looked up in a few parts: 16 MiB; beyond, more parts make them smaller.
Of very many rows it is `ENTRIES_PER_ROW` for each."""

ENTRIES_PER_ROW = 64

GIVEN = 2**23
"""Most entries of all arrays of a table whose shape is given: 32 MiB; its room is rarely full."""

NODES_PER_ROW = 2
"""Room for nodes in a table of a given shape, for each of its rows."""


def fitting_cuts(steps: Steps) -> tuple[int, ...]:
    """Where to cut the letters of some steps: `(24, 12, 0)` for a part with the propositions 12 to 23 and one below."""
    count, rows = steps.propositions, len(steps.root)
    if _is_one_part(rows, count, steps.alphabet):
        return count, 0
    nodes = [1, *np.maximum(crossing(steps)[1:count], 1).tolist(), rows]  # by cut; those above the first are the rows
    # By cut, the least entries of all arrays below it, and where they are cut; with ever more parts.
    best: dict[int, tuple[int, tuple[int, ...]]] = {top: (nodes[top] << top, (top, 0)) for top in range(count + 1)}
    most = ONE_PART
    while best[count][0] > max(most, ENTRIES_PER_ROW * rows):
        before, most = best, FEW_PARTS

        def with_first_cut(top: int, cut: int, rest: Any = before) -> tuple[int, tuple[int, ...]]:
            return (nodes[top] << top - cut) + rest[cut][0], (top, *rest[cut][1])

        best = {
            top: min([before[top], *(with_first_cut(top, cut) for cut in range(1, top))]) for top in range(count + 1)
        }
        if best[count] == before[count]:
            break
    return best[count][1]


def given_cuts(rows: int, propositions: int, alphabet: str) -> tuple[int, ...]:
    """Cuts that depend on nothing but the shape of a table: as even parts as possible."""
    if _is_one_part(rows, propositions, alphabet):
        return propositions, 0
    parts = 2
    while parts < propositions:
        widest = -(-propositions // parts)
        if rows * (1 + NODES_PER_ROW * (parts - 1)) << widest <= GIVEN:
            break
        parts += 1
    return tuple(propositions * part // parts for part in reversed(range(parts + 1)))


def check_entries(cuts: Sequence[int], room: Sequence[int], alphabet: str, limits: Limits) -> None:
    """Refuse arrays with too many entries."""
    count = entries(cuts, room, alphabet)
    if count > limits.max_cells:
        hint = f'; the alphabet "{AT_MOST_ONE}" needs {cuts[0] + 1} a row only' if alphabet == EVERY_SUBSET else ""
        raise TooLargeError(
            f"{room[0]:,} rows with letters over {cuts[0]} propositions take {count:,} entries; the limit is "
            f"max_cells={limits.max_cells:,}: {way_out('max_cells', count)}{hint}"
        )


def check_tokens(rows: int, length: int, limits: Limits) -> None:
    """Refuse an array of tokens with too many entries."""
    if (count := rows * length) > limits.max_cells:
        raise TooLargeError(
            f"{rows:,} rows of {length:,} tokens take {count:,} entries; the limit is max_cells={limits.max_cells:,}: "
            f"pad to fewer tokens (of a run --task-length, --run.table-length or --pool.length), or "
            f"{way_out('max_cells', count)}"
        )


def entries(cuts: Sequence[int], room: Sequence[int], alphabet: str) -> int:
    """Entries of all arrays."""
    if alphabet == AT_MOST_ONE:
        return (cuts[0] + 1) * room[0]
    return sum(nodes << top - bottom for nodes, (top, bottom) in zip(room, pairwise(cuts), strict=True))


def crossing(steps: Steps) -> np.ndarray:
    """How many nodes are open at each cut: where the propositions from it on are known, and some below it are asked."""
    above = np.full(len(steps.variable), -1)  # per node, the highest proposition that leads to it
    above[steps.root] = steps.propositions
    inner = slice(steps.outcomes, None)
    for branch in (steps.low, steps.high):
        np.maximum.at(above, branch[inner], steps.variable[inner])
    begins, ends = steps.variable[inner] + 1, above[inner] + 1
    size = steps.propositions + 2
    return np.cumsum(np.bincount(begins, minlength=size) - np.bincount(ends, minlength=size))


def room_for(steps: Steps, cuts: Sequence[int]) -> tuple[int, ...]:
    """Nodes of each array; at least one."""
    nodes = crossing(steps)
    return len(steps.root), *(max(1, int(nodes[cut])) for cut in cuts[1:-1])


def written(steps: Steps, cuts: Sequence[int], room: Sequence[int] = ()) -> tuple[np.ndarray, ...]:
    """Write steps out: int32 `[values, nodes]` for every part.

    Args:
        steps: what each letter leads to.
        cuts: see `fitting_cuts`.
        room: nodes of each array, the rows first; by default as many as there are. What is left over leads to
            outcome 0, and nothing leads there.
    """
    if steps.alphabet == AT_MOST_ONE:
        return (_wide(steps.dense(), room[0] if room else len(steps.root)),)
    nodes, arrays = steps.root, []
    for part, (top, bottom) in enumerate(pairwise(cuts)):
        at = steps.expanded(nodes, top, bottom)
        is_open = at >= steps.outcomes
        following = np.unique(at[is_open])
        if bottom:
            at[is_open] = steps.outcomes + np.searchsorted(following, at[is_open])
        arrays.append(_wide(at, room[part] if room else max(1, len(nodes))))
        nodes = following
    return tuple(arrays)


def read(arrays: Sequence[np.ndarray], outcomes: int, alphabet: str) -> Steps:
    """The opposite of `written`; what was left over has diagrams as well."""
    if alphabet == AT_MOST_ONE:
        return from_dense(arrays[0].T, outcomes, alphabet)
    folding, bottom = Folding(outcomes), 0
    node = np.arange(outcomes)
    for array in reversed(arrays):
        top = bottom + array.shape[0].bit_length() - 1
        node = np.concatenate([np.arange(outcomes), folded(folding, node[array.T], top, bottom)[:, 0]])
        bottom = top
    return folding.steps(node[outcomes:], bottom, alphabet)


def _is_one_part(rows: int, propositions: int, alphabet: str) -> bool:
    return alphabet == AT_MOST_ONE or propositions < 2 or rows << propositions <= ONE_PART


def _wide(at: np.ndarray, room: int) -> np.ndarray:
    """`[values, room]`: a value's entries lie side by side."""
    result = np.zeros((at.shape[1], room), np.int32)
    result[:, : len(at)] = at.T
    return result
