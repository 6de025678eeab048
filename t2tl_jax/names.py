"""The known name that a misspelt one most likely means."""

import difflib
from collections.abc import Iterable

LIKE = 0.6
"""How like a known name must be for it to be suggested, from 0 to 1, see `nearest`."""

FEW = 12
"""Where none is, so many known names are listed instead."""


def nearest(given: str, known: Iterable[str], cutoff: float = 0.0) -> str:
    """The known name most like the given one, whatever the case of its letters.

    Args:
        given: what somebody wrote.
        known: the names that there are.
        cutoff: how like the nearest name must be, from 0, anything will do, to 1, equal but for the case.

    Returns:
        The name as `known` spells it; "" when none is like enough, or none is known.
    """
    names = {name.lower(): name for name in sorted(known)}
    close = difflib.get_close_matches(given.lower(), names, n=1, cutoff=cutoff)
    return names[close[0]] if close else ""


def meant(given: str, known: Iterable[str]) -> str:
    """The known name that may be suggested for the given one: the nearest that is like it, or the only one that begins
    with it; "" for none."""
    names = list(known)
    begun = [name for name in names if given and name.lower().startswith(given.lower())]
    return nearest(given, names, LIKE) or (begun[0] if len(begun) == 1 else "")
