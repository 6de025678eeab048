"""Two pools in one table, the present one and the one before, so that episodes under way can end as they began.

Pools take turns in the two halves of the table: the rows of a pool stay where they are while it is the present one and
while it is the one before. New episodes begin in the present one only.
"""

from dataclasses import replace

import jax
import numpy as np

from t2tl_jax.ltl.padding import blank
from t2tl_jax.ltl.table import TaskTable


def in_turns(present: TaskTable, before: TaskTable | None, number: int) -> TaskTable:
    """Join two pools of equal shapes, [rows, ...], to a table of 2 x rows - 2 rows: true and false belong to both.

    Args:
        present: whose tasks are the tasks of the table; number `number`.
        before: number `number` - 1; None where there was none.
        number: pools with even numbers lie in the first half, those with odd numbers in the second.

    Returns:
        The table on the device, whose `starts` are the open rows of the present pool.
    """
    rows, length = present.tokens.shape
    own = number % 2
    arrays = blank(present.propositions, present.alphabet, 2 * rows - 2, length)
    arrays["mask"] = arrays["tokens"] != 0
    starts = np.zeros(2 * rows - 2, bool)
    for half, pool in ((own, present), (1 - own, before)):
        if pool is None:
            continue
        first = 2 + half * (rows - 2)
        there = slice(first, first + rows - 2)
        for name in ("tokens", "mask", "verdict"):
            arrays[name][there] = np.asarray(getattr(pool, name))[2:]
        arrays["next_row"][there] = _moved(np.asarray(pool.next_row)[2:], first - 2)
    starts[2 + own * (rows - 2) :][: rows - 2] = np.asarray(present.verdict)[2:] == 0
    initial_row = _moved(np.asarray(present.initial_row), own * (rows - 2))
    return replace(present, **jax.device_put(arrays | {"starts": starts, "initial_row": initial_row}))


def _moved(rows: np.ndarray, by: int) -> np.ndarray:
    """Row numbers in the other half; true and false stay."""
    return np.where(rows < 2, rows, rows + by).astype(np.int32)
