"""The letters of an automaton: which exist, how label vectors become letters, and how many are too many."""

from collections.abc import Sequence

import numpy as np

from t2tl_jax.ltl.compiler.budget import Limits, way_out
from t2tl_jax.ltl.errors import LTLError, TooLargeError, names_of, nearest, unknown_proposition
from t2tl_jax.ltl.formula import Formula

EVERY_SUBSET = "every_subset"
AT_MOST_ONE = "at_most_one"
ALPHABETS = (EVERY_SUBSET, AT_MOST_ONE)
"""Every set of propositions is a letter, or only the sets of at most one."""

BITS = 31
"""Most propositions of which every subset is a letter: an int32 with a bit for each."""


def letter_weights(num_propositions: int, used: list[int], alphabet: str) -> np.ndarray:
    """Return int32 `[num_propositions]`: how label vectors become letters when the tasks use these propositions."""
    weights = np.zeros(num_propositions, np.int32)
    weights[used] = [j + 1 if alphabet == AT_MOST_ONE else 2**j for j in range(len(used))]
    return weights


def check_names(
    formulas: Sequence[Formula], propositions: Sequence[str], alphabet: str, limits: Limits
) -> tuple[tuple[str, ...], list[int]]:
    """Check names and alphabet; return the environment's propositions and the indices of those used."""
    if isinstance(propositions, str):
        raise LTLError(f"propositions is a sequence of names, got the string {propositions!r}")
    names = names_of(propositions)
    if len(set(names)) < len(names):
        raise LTLError(f"the environment names a proposition twice: {', '.join(names)}")
    if alphabet not in ALPHABETS:
        raise LTLError(
            f"unknown alphabet {alphabet!r}; known: {', '.join(ALPHABETS)}{nearest(str(alphabet), ALPHABETS)}"
        )
    if not formulas:
        raise LTLError("a table needs at least one task, got none")
    mentioned = dict.fromkeys(name for formula in formulas for name in formula.propositions())
    if unknown := [name for name in mentioned if name not in names]:
        raise unknown_proposition(unknown[0], names, *unknown[1:])
    check_count(len(mentioned), alphabet)
    if len(mentioned) > limits.max_propositions:
        raise TooLargeError(
            f"the tasks use {len(mentioned)} propositions; the limit is max_propositions={limits.max_propositions}: "
            f"{way_out('max_propositions', len(mentioned))}"
        )
    return names, [index for index, name in enumerate(names) if name in mentioned]


def check_count(propositions: int, alphabet: str) -> None:
    """Refuse letters that are no int32."""
    if alphabet == EVERY_SUBSET and propositions > BITS:
        raise TooLargeError(
            f'{propositions} propositions are used, and a letter of "{EVERY_SUBSET}" has room for {BITS}, a bit each: '
            f'where the environment makes at most one true at a time, use the alphabet "{AT_MOST_ONE}"'
        )
