"""How a command of this package ends: a message that fits on one screen instead of a traceback."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from t2tl_jax.names import nearest

INVALID = 2
"""Exit code for input that cannot be used."""


class UserError(Exception):
    """Something the user gave cannot be used; the message says what, why, and the way out."""


def unknown(kind: str, given: str, known: Iterable[str]) -> UserError:
    """The error for a name that does not exist, with the nearest one and all of them."""
    names = sorted(known)
    return UserError(f"unknown {kind} {given!r}; did you mean {nearest(given, names)!r}?\nKnown: {', '.join(names)}")


@contextmanager
def explained() -> Iterator[None]:
    """Around what the user gave: a ``ValueError`` of the library becomes a ``UserError`` in its words."""
    try:
        yield
    except ValueError as error:
        raise UserError(str(error)) from error


def guarded(command: Callable[[], int]) -> int:
    """Run a command and turn expected errors into a message and an exit code.

    Returns:
        What the command returns, ``INVALID`` after a ``UserError``, 130 after Ctrl-C outside of training.
    """
    try:
        return command()
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return INVALID
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of a pipe, such as `head`, has seen enough
        sys.stderr.close()
        return 0
