"""What the user gave cannot be used: one error, whose message says what, why, and the way out."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from t2tl_jax.names import meant


class UserError(ValueError):
    """Something the user gave cannot be used; the message says what, why, and the way out."""


class NotRegistered(UserError):
    """A name of which only a module that was not imported may know."""


def unknown(kind: str, given: object, known: Iterable[str]) -> UserError:
    """The error for a name that does not exist, with the one that may be meant and all of them."""
    names = sorted(known)
    if not names:
        return UserError(f"unknown {kind} {given!r}; none is registered")
    near = meant(str(given), names)
    hint = f"; did you mean {near!r}?" if near else ""
    return UserError(f"unknown {kind} {given!r}{hint}\nKnown: {', '.join(names)}")


class Note(UserWarning):
    """Something the user should know although the work goes on; commands print it as a note."""


@contextmanager
def explained() -> Iterator[None]:
    """Around what the user gave: a ``ValueError`` of the library becomes a ``UserError`` in its words."""
    try:
        yield
    except UserError:
        raise
    except ValueError as error:
        raise UserError(str(error)) from error
