"""The known name that a misspelt one most likely means."""

import difflib
from collections.abc import Iterable

ALIKE = 0.6
"""How like a name must be to be what was meant: below that the nearest one is a guess that misleads."""

FEW = 12
"""Where none is, so many known names are listed instead."""

BEGINNING = 3
"""Letters that the beginning of a name has at least, to stand for it."""


def nearest(given: str, known: Iterable[str], cutoff: float = 0.0) -> str:
    """The known name most like the given one, whatever the case of its letters.

    Args:
        given: what somebody wrote.
        known: the names that there are.
        cutoff: how like the nearest name must be, from 0, anything will do, to 1, equal but for the case.

    Returns:
        The name as `known` spells it, or else the first that begins with what was given; "" when none is like enough,
        or none is known.
    """
    names = {name.lower(): name for name in sorted(known)}
    close = difflib.get_close_matches(given.lower(), names, n=1, cutoff=cutoff)
    begun = [name for name in names if len(given) >= BEGINNING and name.startswith(given.lower())]
    return names[(close + begun)[0]] if close or begun else ""
