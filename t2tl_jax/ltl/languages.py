"""When two rows mean the same: the language of a row, in one form whatever table it stands in."""

from collections.abc import Iterable

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE
from t2tl_jax.ltl.compiler.parts import written
from t2tl_jax.ltl.compiler.steps import Steps

Language = bytes
"""Equal for two rows, of one table or of two with equal letters, exactly if the same words make both true, and the same
words both false."""


_PART = 8
"""Most propositions of a part in which letters are compared."""


def of_rows(steps: Steps, verdict: np.ndarray, rows: Iterable[int]) -> list[Language]:
    """The language of each of `rows`, as `languages`, however many letters there are.

    Where there are `whole_letters`, it is an array int32 `[states, 1 + letters]` of verdicts and following states.

    Args:
        steps: where letters lead, over all propositions of the environment.
        verdict: int8 `[rows]`, +1 true, -1 false, 0 open.
        rows: those asked for.
    """
    return languages(*_in_parts(steps, verdict), rows)


def whole_letters(steps: Steps) -> bool:
    """Whether the languages of rows are told letter by letter, and not by parts of letters."""
    return steps.alphabet == AT_MOST_ONE or steps.propositions <= _PART


def _in_parts(steps: Steps, verdict: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An automaton that reads letters in parts, one after another; each part in states with a verdict of their own.

    Two rows have the same language exactly if they have it in this automaton: a letter is a word of its parts.
    """
    if whole_letters(steps):
        return steps.dense(), verdict
    parts = -(-steps.propositions // _PART)
    arrays = written(steps, [steps.propositions * part // parts for part in reversed(range(parts + 1))])
    rows, columns = len(verdict), max(len(array) for array in arrays)
    following, kinds, begin = [], [np.asarray(verdict, int)], 0
    for part, array in enumerate(arrays):
        # The states of a part: of the first, the rows; of the others, each row that is settled, then the nodes.
        settled = np.tile(np.arange(rows if part else 0), (columns, 1))
        entries = np.hstack([settled, np.tile(array, (columns // len(array), 1))])
        begin += entries.shape[1]
        following.append(entries + (begin if part + 1 < parts else 0))
        if part:
            kinds.append(np.full(entries.shape[1], 1 + part))
    return np.hstack(following).T, np.concatenate(kinds)


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
        numbers: dict[bytes, int] = {}  # for tables of a few rows much faster than to sort them
        state = np.array([numbers.setdefault(row.tobytes(), len(numbers)) for row in signature])
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
