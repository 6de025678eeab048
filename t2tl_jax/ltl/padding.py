"""Tables of given shapes: whatever formulas they hold, one compiled program takes them all."""

from collections.abc import Sequence

import jax
import numpy as np

from t2tl_jax.ltl import tokens as vocabulary
from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE, check_cells, every_letter, letter_weights
from t2tl_jax.ltl.compiler.automaton import Automaton
from t2tl_jax.ltl.errors import TooLargeError
from t2tl_jax.ltl.table import TaskTable


def blank(names: Sequence[str], alphabet: str, rows: int, length: int) -> dict[str, np.ndarray]:
    """Arrays of a table that holds true and, in all other rows, false; every proposition has its letter.

    No transition leads to a row that is left over, no episode starts there, its verdict is -1, and a task encoder reads
    the formula `False` in it. So it is never visited, sampled or learned from.

    Args:
        names: the environment's propositions, in its order.
        alphabet: as in `compile_tasks`.
        rows: rows of the table, true and false included.
        length: tokens per row.

    Returns:
        `tokens`, `next_row`, `verdict` and `letter_weights`, as in `TaskTable`.

    Raises:
        TooLargeError: for more entries than a table may have.
    """
    check_cells(rows, len(names), alphabet)
    tokens = np.zeros((rows, length), np.int32)
    tokens[:, 0] = vocabulary.OPERATOR_ID["False"]
    tokens[0, 0] = vocabulary.OPERATOR_ID["True"]
    next_row = np.ones((rows, len(names) + 1 if alphabet == AT_MOST_ONE else 2 ** len(names)), np.int32)
    next_row[0] = 0
    verdict = np.full(rows, -1, np.int8)
    verdict[0] = 1
    weights = letter_weights(len(names), list(range(len(names))), alphabet)
    return {"tokens": tokens, "next_row": next_row, "verdict": verdict, "letter_weights": weights}


def padded(automaton: Automaton, rows: int, length: int) -> TaskTable:
    """Write the automaton of some formulas as a table of `rows` rows and `length` tokens, on the device.

    Rows keep their numbers, those that are left over are as in `blank`.

    Raises:
        TooLargeError: when it does not fit.
    """
    used, longest = len(automaton.tokens), max(map(len, automaton.tokens))
    if used > rows or longest > length:
        raise TooLargeError(
            f"the tasks have {used} rows of up to {longest} tokens, and the table has room for {rows} rows of {length}"
        )
    arrays = blank(automaton.propositions, automaton.alphabet, rows, length)
    for row, tokens in enumerate(automaton.tokens):
        arrays["tokens"][row] = 0
        arrays["tokens"][row, : len(tokens)] = tokens
    columns = every_letter(automaton.letter_weights, automaton.alphabet)
    arrays["next_row"][:used] = automaton.next_row[:, columns]
    arrays["verdict"][:used] = automaton.verdict
    arrays |= {"mask": arrays["tokens"] != vocabulary.PADDING, "initial_row": automaton.initial_row}
    return TaskTable(**jax.device_put(arrays), propositions=automaton.propositions, alphabet=automaton.alphabet)
