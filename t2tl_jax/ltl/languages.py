"""When two rows mean the same: the language of a row, in one form whatever table it stands in."""

from collections.abc import Iterable

import numpy as np

Language = bytes
"""Equal for two rows, of one table or of two with equal letters, exactly if the same words make both true, and the same
words both false."""


def languages(next_row: np.ndarray, verdict: np.ndarray, rows: Iterable[int]) -> list[Language]:
    """The language of each of `rows`: the minimal automaton that starts there, its states numbered as they are met.

    Args:
        next_row: int `[rows, letters]`, a column for every letter of the environment.
        verdict: int8 `[rows]`, +1 true, -1 false, 0 open.
        rows: those asked for.
    """
    state, following, ends = minimal(next_row, verdict)
    return [numbered(following, ends, int(state[row])) for row in rows]


def minimal(next_row: np.ndarray, verdict: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The automaton with one state for all rows that no word tells apart.

    Returns:
        The state of each row int `[rows]`, the following states int `[states, letters]`, their verdicts `[states]`.
    """
    state = _classes(next_row, verdict)
    _, first = np.unique(state, return_index=True)
    return state, state[next_row[first]], verdict[first]


def _classes(next_row: np.ndarray, verdict: np.ndarray) -> np.ndarray:
    """Rows that no word tells apart have the same number: int `[rows]`. Moore's refinement, which only splits."""
    state, count = np.unique(verdict, return_inverse=True)[1], 0
    while count < (count := int(state.max()) + 1):
        signature = np.column_stack([state, state[next_row]])
        state = np.unique(signature, axis=0, return_inverse=True)[1].reshape(-1)
    return state


def numbered(following: np.ndarray, ends: np.ndarray, start: int) -> Language:
    """The language of a state of a minimal automaton."""
    number, order = {start: 0}, [start]
    for state in order:  # which grows meanwhile
        for after in following[state].tolist():
            if after not in number:
                number[after] = len(order)
                order.append(after)
    renumbered = [[number[after] for after in following[state].tolist()] for state in order]
    return np.column_stack([ends[order], renumbered]).astype("<i4").tobytes()
