"""The nearest of the names that exist, for messages about one that does not."""

import difflib
from collections.abc import Iterable


def nearest(given: str, known: Iterable[str]) -> str:
    """The known name most like the given one, whatever the case of its letters."""
    names = sorted(known)
    folded = {name.lower(): name for name in names}
    close = difflib.get_close_matches(given.lower(), folded, n=1, cutoff=0.0)
    return folded[close[0]]
