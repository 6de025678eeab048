"""The letters of an automaton: which exist, how label vectors become letters, and how many are too many."""

from collections.abc import Sequence

import numpy as np

from t2tl_jax.ltl.compiler.budget import MAX_CELLS, MAX_PROPOSITIONS
from t2tl_jax.ltl.errors import LTLError, TooLargeError, nearest, unknown_proposition
from t2tl_jax.ltl.formula import Formula

EVERY_SUBSET = "every_subset"
AT_MOST_ONE = "at_most_one"
ALPHABETS = (EVERY_SUBSET, AT_MOST_ONE)
"""Every set of propositions is a letter, or only the sets of at most one."""


def letter_weights(num_propositions: int, used: list[int], alphabet: str) -> np.ndarray:
    """Return int32 `[num_propositions]`: how label vectors become letters when the tasks use these propositions."""
    weights = np.zeros(num_propositions, np.int32)
    weights[used] = [j + 1 if alphabet == AT_MOST_ONE else 2**j for j in range(len(used))]
    return weights


def every_letter(weights: np.ndarray, alphabet: str) -> np.ndarray:
    """Return int `[letters]`: per letter over all propositions, the letter where only those with a weight count."""
    if alphabet == AT_MOST_ONE:
        return np.concatenate([[0], weights])
    letters = np.arange(2 ** len(weights))[:, None]
    return (letters >> np.arange(len(weights)) & 1) @ weights


def check_cells(rows: int, num_used: int, alphabet: str) -> None:
    """Refuse a table with too many entries."""
    letters = num_used + 1 if alphabet == AT_MOST_ONE else 2**num_used
    if rows * letters > MAX_CELLS:
        hint = "" if alphabet == AT_MOST_ONE else f'; the alphabet "{AT_MOST_ONE}" needs {num_used + 1} letters only'
        raise TooLargeError(
            f"{rows:,} rows of {letters:,} letters ({num_used} propositions used) are more than "
            f"{MAX_CELLS:,} entries (budget.MAX_CELLS){hint}"
        )


def check_names(
    formulas: Sequence[Formula], propositions: Sequence[str], alphabet: str
) -> tuple[tuple[str, ...], list[int]]:
    """Check names and alphabet; return the environment's propositions and the indices of those used."""
    if isinstance(propositions, str):
        raise LTLError(f"propositions is a sequence of names, got the string {propositions!r}")
    names = tuple(propositions)
    if len(set(names)) < len(names):
        raise LTLError(f"the environment names a proposition twice: {', '.join(names)}")
    if alphabet not in ALPHABETS:
        raise LTLError(
            f"unknown alphabet {alphabet!r}; known: {', '.join(ALPHABETS)}{nearest(str(alphabet), ALPHABETS)}"
        )
    if not formulas:
        raise LTLError("a table needs at least one task, got none")
    mentioned = dict.fromkeys(name for formula in formulas for name in formula.propositions())
    for name in mentioned:
        if name not in names:
            raise unknown_proposition(name, names)
    if len(mentioned) > MAX_PROPOSITIONS or (alphabet == EVERY_SUBSET and 2 ** len(mentioned) > MAX_CELLS // 3):
        raise TooLargeError(
            f"the tasks use {len(mentioned)} propositions; the limit is {MAX_PROPOSITIONS} (budget.MAX_PROPOSITIONS), "
            f'and with "{EVERY_SUBSET}" each doubles the letters (budget.MAX_CELLS): where the environment makes at '
            f'most one true at a time, use the alphabet "{AT_MOST_ONE}"'
        )
    return names, [index for index, name in enumerate(names) if name in mentioned]
