"""Flags to a dataclass with tyro, and errors that name the nearest valid spelling.

Loads no JAX, so that ``--help`` and mistakes of the commands that read a finished run are answered at once.
"""

import contextlib
import dataclasses
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import tyro

from experiments.errors import UserError, unknown
from t2tl_jax.names import nearest

T = TypeVar("T")

OPTIONS = (tyro.conf.FlagConversionOff, tyro.conf.AvoidSubcommands)
"""Truth values are written out (``--run.gif False``), as in the configuration file. Of environments, networks and
learners the flags are those of the kind that the chosen configuration has."""


def parse(
    kind: type[T],
    arguments: Sequence[str],
    prog: str,
    description: str | None,
    default: T | None = None,
    others: Sequence[str] = (),
) -> T:
    """Fill a dataclass from flags with tyro; prints help and exits 0 for ``--help``.

    Args:
        kind: the dataclass.
        arguments: of the command line, without the program's name.
        prog: how the program is called, for its help.
        description: at the top of its help.
        default: instance whose fields the flags replace; without it, fields without default are required.
        others: flags of the same command that are read elsewhere, and may be what was meant.

    Raises:
        UserError: for flags that do not fit, with the nearest valid spelling.
    """
    complaints = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaints):
            if default is None:
                return tyro.cli(kind, prog=prog, description=description, args=list(arguments), config=OPTIONS)
            return tyro.cli(
                kind, prog=prog, description=description, default=default, args=list(arguments), config=OPTIONS
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        known = [*_options(kind if default is None else default), *others]
        raise _misspelt(arguments, known, prog) or _plain(complaints.getvalue(), kind.__name__) from None
    except ValueError as error:  # from the checks of the dataclasses
        raise UserError(str(error)) from error


def check_picture(flag: str, file: Path | None) -> None:
    """Raise a `UserError` unless the name given for a picture, if any, is one of a PNG, which is what is written."""
    if file is not None and file.suffix.lower() != ".png":
        raise UserError(f"{flag} is written as PNG: give a name that ends in .png, got {file}")


def _options(part: Any, prefix: str = "--") -> Iterator[str]:
    """The flags for the fields of a dataclass or an instance of one; a part has those of its own fields."""
    for field in dataclasses.fields(part):
        flag, value = prefix + field.name.replace("_", "-"), getattr(part, field.name, None)
        if dataclasses.is_dataclass(value):
            yield from _options(value, flag + ".")
        else:
            yield flag


def _misspelt(arguments: Sequence[str], known: Sequence[str], prog: str) -> UserError | None:
    """The error for flags that do not exist, each with the nearest that does; None if all do."""
    given = [argument.partition("=")[0] for argument in arguments if argument.startswith("--")]
    wrong = [flag for flag in given if flag.replace("_", "-") not in (*known, "--help")]
    lines = [f"unknown option {flag!r}; did you mean {nearest(flag, known)!r}?" for flag in wrong]
    return UserError("\n".join([*lines, f"All options: {prog} --help"])) if lines else None


def _plain(complaint: str, root: str) -> UserError:
    """The error that tyro wrote, without its box; with the nearest value where one of a few was expected.

    Of the check of a dataclass only what that says, with the name of the part unless it is the `root`.
    """
    text = re.sub(r"\x1b\[[0-9;]*m", "", complaint)
    lines = [line.strip("│ ") for line in text.splitlines() if line.strip() and not re.match("[╭╰]", line)]
    if len(lines) > 1 and set(lines[1]) == {"-"}:  # without Unicode the title stands above a rule
        lines = lines[2:]
    lines = [line for line in lines if line.strip("─-")]
    sentence = " ".join(lines)  # tyro breaks lines anywhere
    choice = re.search(r"invalid choice '([^']*)' for argument '([^']*)'. Expected one of \(('[^)]*)\)", sentence)
    if choice:
        given, flag, known = choice.groups()
        return unknown(flag, given, re.findall(r"'([^']*)'", known))
    check = re.fullmatch(r"Error parsing ([\w.]+): (.*?)( For full helptext.*)?", sentence)
    if check:
        part, said, _ = check.groups()
        return UserError(said if part == root else f"{part}: {said}")
    return UserError("\n".join(lines))
