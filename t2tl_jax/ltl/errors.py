"""Errors about formulas and tasks: each says what was given, what was expected, and the way out."""

from collections.abc import Iterable, Sequence
from typing import Any

from t2tl_jax import names
from t2tl_jax.errors import UserError
from t2tl_jax.names import ALIKE


class LTLError(UserError):
    """Base class of every error that a formula, a task name or a table can cause."""


class LTLSyntaxError(LTLError):
    """Malformed formula text; the message shows the line with a caret under the place.

    Attributes:
        problem: what is wrong, without the place.
        text: the whole formula text.
        position: index into `text` at which reading failed.
        expected: what could have stood there, in words.
    """

    def __init__(self, problem: str, text: str, position: int, expected: str = "") -> None:
        self.problem, self.text, self.position, self.expected = problem, text, position, expected
        hint = f"\nexpected {expected}" if expected else ""
        super().__init__(f"{problem}\n{caret(text, position)}{hint}")


class MachineSyntaxError(LTLSyntaxError):
    """Malformed text of a reward machine; the message names machine and line, and shows the line with a caret."""

    def __init__(self, machine: str, problem: str, text: str, position: int, expected: str = "") -> None:
        self.line = text.count("\n", 0, position) + 1
        super().__init__(f"{machine}, line {self.line}: {problem}", text, position, expected)


class NotCoSafeError(LTLError):
    """The formula is not syntactically co-safe: no finite word can make it true."""


class UnknownPropositionError(LTLError):
    """A formula speaks of a proposition that the environment does not have."""


class UnknownTaskError(LTLError):
    """No task, task family or sampler has this name."""


class TooLargeError(LTLError):
    """A bound on size, nesting, rows or work was reached; the message names the bound."""


def check_text(what: str, given: Any) -> None:
    """Raise an `LTLError` for a formula, a name or the like that is no text."""
    if not isinstance(given, str):
        raise LTLError(f"{what} is a text, got {given!r:.100}")


def names_of(propositions: Any) -> tuple[str, ...]:
    """The propositions of an environment; `LTLError` for what is no sequence of names."""
    names = tuple(propositions) if isinstance(propositions, Iterable) else (propositions,)
    if not all(isinstance(name, str) for name in names):
        raise LTLError(f"propositions is a sequence of names, got {propositions!r:.100}")
    return names


def no_formulas() -> LTLError:
    """Return the error for asking a table of reward machines for formulas or tokens."""
    return LTLError(
        "the rows of this table are states of reward machines, which have no formula to read: use a one-hot task "
        "encoder, or write the task as a formula"
    )


def unknown_proposition(name: str, known: Sequence[str], *others: str) -> UnknownPropositionError:
    """Return the error for propositions that are not among the known ones, with the nearest of these for each."""
    listed = ", ".join(known) if known else "none"
    if not others:
        return UnknownPropositionError(f'unknown proposition "{name}"; known: {listed}{nearest(name, known)}')
    unknown = (name, *others)
    close = [f'"{near}" for "{one}"' for one in unknown if (near := names.nearest(one, known, cutoff=ALIKE))]
    meant = f"; did you mean {', '.join(close)}?" if close else ""
    quoted = ", ".join(f'"{one}"' for one in unknown)
    return UnknownPropositionError(f"unknown propositions {quoted}; known: {listed}{meant}")


def caret(text: str, position: int, width: int = 100) -> str:
    """Return the line of `text` that holds `position`, and below it a caret; long lines are cut to `width`."""
    start = text.rfind("\n", 0, position) + 1
    end = text.find("\n", position)
    line = (text[start:] if end < 0 else text[start:end]).replace("\t", " ")
    column = position - start
    first = max(0, min(column - width // 2, len(line) - width))
    left = "..." if first else ""
    right = "..." if first + width < len(line) else ""
    shown = left + line[first : first + width] + right
    return f"  {shown}\n  {' ' * (column - first + len(left))}^"


def nearest(name: str, known: Iterable[str]) -> str:
    """Return `; did you mean "..."?` for the closest of `known`, or nothing when none is close."""
    close = names.nearest(name, known, cutoff=ALIKE)
    return f'; did you mean "{close}"?' if close else ""
