"""Generated parts of hand-written pages, between markers: ``<!-- reproduce: NAME -->`` and ``<!-- end -->``."""

import re
from collections.abc import Mapping

from t2tl_jax.errors import UserError, unknown

MARKED = re.compile(r"(<!-- reproduce: (.*?) -->\n)(.*?)(<!-- end -->)", re.S)
BEGIN, END = "<!-- reproduce:", "<!-- end -->"


def filled(text: str, parts: Mapping[str, str], page: str) -> str:
    """The page with every part in its place.

    Args:
        text: of the page, as it is.
        parts: by the name in the marker; each is there exactly once.
        page: its name, for errors.

    Raises:
        UserError: if a marker is not closed or names no part, or if a part has no place or two.
    """
    names = [name for _, name, _, _ in MARKED.findall(text)]
    if not text.count(BEGIN) == text.count(END) == len(names):
        raise UserError(f"{page}: every '{BEGIN} NAME -->' needs an '{END}' before the next one")
    for name in names:
        if name not in parts:
            raise unknown("generated part", name, parts)
    for name in parts:
        if names.count(name) != 1:
            raise UserError(f"{page} needs one place '{BEGIN} {name} -->', it has {names.count(name)}")
    return MARKED.sub(lambda found: f"{found[1]}{parts[found[2]]}\n{found[4]}", text)
