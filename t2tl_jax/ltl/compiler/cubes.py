"""Readable guards: sets of letters as a few cubes (`Red & !Black`), not as 2^P lines."""

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE
from t2tl_jax.ltl.compiler.automaton import Automaton
from t2tl_jax.ltl.formula import quote

Cube = tuple[tuple[int, bool], ...]
"""Propositions (indices into `used`) with the value that each must have; the others are free."""


def guard(automaton: Automaton, letters: np.ndarray) -> str:
    """Return a formula over propositions that holds in exactly the given letters (bool `[letters]`); "" for none."""
    names = [quote(name) for name in automaton.used]
    if letters.all():
        return "true"
    if automaton.alphabet == AT_MOST_ONE:
        # "otherwise": none of the used propositions is true.
        words = [name for name, taken in zip(names, letters[1:], strict=True) if taken]
        return " | ".join(words + ["otherwise"] * bool(letters[0]))
    cubes = cover(letters)
    return " | ".join(
        " & ".join(names[index] if value else f"!{names[index]}" for index, value in sorted(cube)) for cube in cubes
    )


def cover(letters: np.ndarray) -> list[Cube]:
    """Return cubes whose union is exactly the given letters, none of them superfluous (Minato-Morreale).

    Args:
        letters: bool `[2**n]`; letter `sum(2**j for true j)`.
    """
    cubes, _ = _cover(letters, letters)
    return cubes


def _cover(must: np.ndarray, may: np.ndarray) -> tuple[list[Cube], np.ndarray]:
    """Cover every letter of `must` by cubes inside `may`; return them and what they cover."""
    if not must.any():
        return [], np.zeros_like(must)
    if may.all():
        return [()], np.ones_like(must)
    variable = must.size.bit_length() - 2
    (must0, must1), (may0, may1) = must.reshape(2, -1), may.reshape(2, -1)
    # Cubes that need the proposition false, then true, then the rest that holds for both values.
    cubes0, covered0 = _cover(must0 & ~may1, may0)
    cubes1, covered1 = _cover(must1 & ~may0, may1)
    both, covered = _cover((must0 & ~covered0) | (must1 & ~covered1), may0 & may1)
    cubes = [(*cube, (variable, True)) for cube in cubes1] + [(*cube, (variable, False)) for cube in cubes0] + both
    return cubes, np.concatenate([covered0 | covered, covered1 | covered])
