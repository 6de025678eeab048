"""Tables of given shapes: whatever formulas they hold, one compiled program takes them all."""

from collections.abc import Sequence

import jax
import numpy as np

from t2tl_jax.ltl import tokens as vocabulary
from t2tl_jax.ltl.compiler.alphabet import check_count, letter_weights
from t2tl_jax.ltl.compiler.automaton import Automaton
from t2tl_jax.ltl.compiler.budget import Limits
from t2tl_jax.ltl.compiler.parts import NODES_PER_ROW, check_entries, check_tokens, given_cuts, room_for, written
from t2tl_jax.ltl.compiler.steps import Steps
from t2tl_jax.ltl.errors import TooLargeError
from t2tl_jax.ltl.table import TaskTable


class Blank:
    """Arrays of a table that holds true and, in all other rows, false; every proposition has its letter.

    No transition leads to a row that is left over, no episode starts there, its verdict is -1, and a task encoder reads
    the formula `False` in it. So it is never visited, sampled or learned from.

    Args:
        names: the environment's propositions, in its order.
        alphabet: as in `compile_tasks`.
        rows: rows of the table, true and false included.
        length: tokens per row.
        nodes: room for what one part of a letter leaves open, see `compiler/parts.py`; 0 for twice as many as rows.
            Where the letters of so many rows fit into one array, nothing of this counts.
        limits: as in `compile_tasks`.

    Attributes:
        tokens: int32 `[rows, length]`.
        verdict: int8 `[rows]`.
        cuts: where letters are cut into parts.
        room: nodes of each part, those of the first being the rows.

    Raises:
        TooLargeError: for more entries than a table may have.
    """

    def __init__(
        self, names: Sequence[str], alphabet: str, rows: int, length: int, nodes: int = 0, limits: Limits | None = None
    ) -> None:
        check_count(len(names), alphabet)
        self.names, self.alphabet = tuple(names), alphabet
        self.cuts = given_cuts(rows, len(names), alphabet)
        self.room = (rows, *[nodes or NODES_PER_ROW * rows] * (len(self.cuts) - 2))
        check_entries(self.cuts, self.room, alphabet, limits or Limits())
        check_tokens(rows, length, limits or Limits())
        self.tokens = np.zeros((rows, length), np.int32)
        self.tokens[:, 0] = vocabulary.OPERATOR_ID["False"]
        self.tokens[0, 0] = vocabulary.OPERATOR_ID["True"]
        self.verdict = np.full(rows, -1, np.int8)
        self.verdict[0] = 1

    def show(self, row: int, tokens: Sequence[int], verdict: int) -> None:
        """Write what a row is."""
        self.tokens[row] = 0
        self.tokens[row, : len(tokens)] = tokens
        self.verdict[row] = verdict

    def table(self, steps: Steps, initial_row: Sequence[int] | np.ndarray) -> TaskTable:
        """The table, on the device.

        Args:
            steps: of all rows, over all propositions, with no more nodes than there is room for.
            initial_row: per task, its row.
        """
        every = list(range(len(self.names)))
        arrays = {
            "tokens": self.tokens,
            "mask": self.tokens != vocabulary.PADDING,
            "branches": written(steps, self.cuts, self.room),
            "verdict": self.verdict,
            "initial_row": np.array(initial_row, np.int32),
            "letter_weights": letter_weights(len(every), every, self.alphabet),
        }
        return TaskTable(**jax.device_put(arrays), propositions=self.names, alphabet=self.alphabet)


def needed_nodes(automaton: Automaton, rows: int) -> int:
    """The least `nodes` with which some formulas fit into a table of so many rows."""
    cuts = given_cuts(rows, len(automaton.propositions), automaton.alphabet)
    return max(room_for(automaton.every_letter(), cuts)[1:], default=0)


def padded(automaton: Automaton, rows: int, length: int, nodes: int = 0, limits: Limits | None = None) -> TaskTable:
    """Write the automaton of some formulas as a table of `rows` rows and `length` tokens, on the device.

    Rows keep their numbers, those that are left over are as in `Blank`.

    Raises:
        TooLargeError: when it does not fit.
    """
    used, longest = len(automaton.tokens), max(map(len, automaton.tokens))
    if used > rows or longest > length:
        raise TooLargeError(
            f"the tasks have {used} rows of up to {longest} tokens, and the table has room for {rows} rows of {length}"
        )
    blank = Blank(automaton.propositions, automaton.alphabet, rows, length, nodes, limits)
    needed = needed_nodes(automaton, rows)
    if needed > max(blank.room[1:], default=needed):
        raise TooLargeError(f"the letters of the tasks need {needed} nodes, and the table has room for {blank.room[1]}")
    for row, tokens in enumerate(automaton.tokens):
        blank.show(row, tokens, int(automaton.verdict[row]))
    return blank.table(automaton.every_letter().with_rows(rows), automaton.initial_row)
