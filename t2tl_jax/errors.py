"""What the user gave cannot be used: one error, whose message says what, why, and the way out."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from t2tl_jax.names import ALIKE, nearest


class UserError(ValueError):
    """Something the user gave cannot be used; the message says what, why, and the way out."""


class NotRegistered(UserError):
    """A name of which only a module that was not imported may know."""


def unknown(kind: str, given: str, known: Iterable[str]) -> UserError:
    """The error for a name that does not exist, with the nearest one and all of them."""
    names = sorted(known)
    if not names:
        return UserError(f"unknown {kind} {given!r}; none is registered")
    return UserError(f"unknown {kind} {given!r}{did_you_mean(given, names)}\nKnown: {', '.join(names)}")


def did_you_mean(given: str, known: Iterable[str]) -> str:
    """Return `; did you mean '...'?` for the closest of the known names, or nothing when none is close."""
    close = nearest(given, known, cutoff=ALIKE)
    return f"; did you mean {close!r}?" if close else ""


class Note(UserWarning):
    """Something the user should know although the work goes on; commands print it as a note."""


def check_type(what: str, given: object, *wanted: type, hint: str = "") -> None:
    """Refuse an argument that is of no fitting type.

    Args:
        what: how to call it.
        given: the argument.
        *wanted: types that fit.
        hint: what else there is to say, behind the message.

    Raises:
        UserError: saying what was given, and which types fit.
    """
    if not isinstance(given, wanted):
        names = " or ".join("None" if kind is type(None) else kind.__name__ for kind in wanted)
        raise UserError(f"{what} must be of type {names}, got {given!r:.100}{hint}")


@contextmanager
def explained() -> Iterator[None]:
    """Around what the user gave: a ``ValueError`` of the library becomes a ``UserError`` in its words."""
    try:
        yield
    except UserError:
        raise
    except ValueError as error:
        raise UserError(str(error)) from error
