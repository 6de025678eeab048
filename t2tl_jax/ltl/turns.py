"""Two pools in one table, the present one and the one before, so that episodes under way can end as they began.

Pools take turns in the two halves of the table: the rows of a pool stay where they are while it is the present one and
while it is the one before. New episodes begin in the present one only.
"""

from dataclasses import replace

import jax
import numpy as np

from t2tl_jax.ltl.compiler.budget import Limits
from t2tl_jax.ltl.compiler.forest import Forest
from t2tl_jax.ltl.compiler.parts import read
from t2tl_jax.ltl.errors import TooLargeError
from t2tl_jax.ltl.padding import Blank
from t2tl_jax.ltl.table import TaskTable


def in_turns(
    present: TaskTable, before: TaskTable | None, number: int, nodes: int = 0, limits: Limits | None = None
) -> TaskTable:
    """Join two pools of equal shapes, [rows, ...], to a table of 2 x rows - 2 rows: true and false belong to both.

    Args:
        present: whose tasks are the tasks of the table; number `number`.
        before: number `number` - 1; None where there was none.
        number: pools with even numbers lie in the first half, those with odd numbers in the second.
        nodes, limits: those of the pools. The table has room for as many nodes for each of them.

    Returns:
        The table on the device, whose `starts` are the open rows of the present pool.

    Raises:
        TooLargeError: where the letters of both leave more open than there is room for, which they do not in one array.
    """
    rows, length = present.tokens.shape
    own = number % 2
    blank = Blank(present.propositions, present.alphabet, 2 * rows - 2, length, 2 * nodes, limits)
    forest = Forest(blank.alphabet, blank.cuts, blank.room)
    starts = np.zeros(2 * rows - 2, bool)
    for half, pool in ((own, present), (1 - own, before)):
        if pool is None:
            continue
        place = _moved(np.arange(rows), half * (rows - 2)).tolist()
        tokens, verdict = np.asarray(pool.tokens), np.asarray(pool.verdict)
        for row in range(2, rows):
            blank.show(place[row], tokens[row], int(verdict[row]))
        steps = read([np.asarray(branch) for branch in pool.branches], pool.num_outcomes, pool.alphabet)
        if not forest.add(steps, place, np.flatnonzero(verdict == 0).tolist()):
            raise TooLargeError(
                f"the letters of two pools leave more open than the {blank.room[1]} nodes that there is room for; "
                "raise pool.nodes, or set pool.finish=False"
            )
        if half == own:
            starts[place[2] : place[2] + rows - 2] = verdict[2:] == 0
    table = blank.table(forest.steps(), _moved(np.asarray(present.initial_row), own * (rows - 2)))
    return replace(table, starts=jax.device_put(starts))


def _moved(rows: np.ndarray, by: int) -> np.ndarray:
    """Row numbers in the other half; true and false stay."""
    return np.where(rows < 2, rows, rows + by).astype(np.int32)
