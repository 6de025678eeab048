"""Flags to a dataclass, and errors that name the nearest valid spelling.

tyro writes the help and reads the values. Which flags there are and what each of them takes is told by the dataclass
itself, so that mistakes are found here, in words of our own. Loads no JAX, so that ``--help`` and mistakes of commands
that need none are answered at once.
"""

import contextlib
import dataclasses
import io
import typing
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import tyro

from t2tl_jax.errors import UserError, unknown
from t2tl_jax.names import ALIKE, FEW, nearest
from t2tl_jax.old_names import new_flag

T = TypeVar("T")

OPTIONS = (tyro.conf.FlagConversionOff, tyro.conf.AvoidSubcommands)
"""Truth values are written out (``--run.gif False``), as in the configuration file; a flag by itself means True. Of
environments, networks and learners the flags are those of the kind that the chosen configuration has."""

HELP = {"-h", "--help"}


def parse(
    kind: type[T],
    arguments: Sequence[str],
    prog: str,
    description: str | None,
    default: T | None = None,
    others: Sequence[str] = (),
) -> T:
    """Fill a dataclass from flags; prints help and exits 0 for ``--help``.

    Args:
        kind: the dataclass.
        arguments: of the command line, without the program's name.
        prog: how the program is called, for its help.
        description: at the top of its help.
        default: instance whose fields the flags replace. Without it the dataclass has no parts, and all of its fields
            have defaults but for one whose words stand by themselves, before or behind the flags
            (`tyro.conf.Positional`).
        others: flags of the same command that are read elsewhere, and may be what was meant.

    Raises:
        UserError: for flags that do not fit, with the nearest valid spelling.
    """
    texts = list(arguments)
    if HELP & set(texts):
        instance = {} if default is None else {"default": default}
        tyro.cli(kind, prog=prog, description=description, args=["--help"], config=OPTIONS, **instance)  # type: ignore[call-overload]
    fields, first = dict(_fields(kind if default is None else default)), _positional(kind)
    _refuse_unknown(texts, [*fields, *others], first, prog)
    words, given = _grouped(texts, {} if first is None else fields)
    wrong = [word for word in words if first is None or word.startswith("-")]
    if wrong:
        raise UserError(f"every option begins with --, got {wrong[0]!r}; see {prog} --help")
    values = {flag: _value(flag, fields[flag], said) for flag, said in given.items()}
    try:
        if default is not None:
            return _replaced(default, values)
        by_name = {flag[2:].replace("-", "_"): value for flag, value in values.items()}
        if first is not None:
            by_name[first] = _first_words(first, fields[f"--{first}"], words, prog)
        return kind(**by_name)
    except UserError:
        raise
    except ValueError as error:  # from the checks of the dataclasses
        raise UserError(str(error)) from error


def _positional(kind: type) -> str | None:
    """The field whose words stand by themselves, such as the folder of a run; None if there is none."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return next((name for name, hint in hints.items() if tyro.conf.Positional in get_args(hint)[1:]), None)


def _first_words(name: str, hint: Any, words: Sequence[str], prog: str) -> Any:
    """What the words that belong to no option mean: one thing, or a tuple of as many as there are."""
    if get_origin(get_args(hint)[0]) is not tuple and len(words) != 1:
        raise UserError(f"{prog} takes one {name}, got {' '.join(words) or 'none'}; see {prog} --help")
    return _value(name, get_args(hint)[0], words)


def check_picture(flag: str, file: Path | None) -> None:
    """Raise a `UserError` unless the name given for a picture, if any, is one of a PNG, which is what is written."""
    if file is not None and file.suffix.lower() != ".png":
        raise UserError(f"{flag} is written as PNG: give a name that ends in .png, got {file}")


def _fields(part: Any, prefix: str = "--") -> Iterator[tuple[str, Any]]:
    """The flags of a dataclass or an instance of one, with what each takes; a part has those of its own fields."""
    hints = typing.get_type_hints(part if isinstance(part, type) else type(part), include_extras=True)
    for field in dataclasses.fields(part):
        flag, value = prefix + field.name.replace("_", "-"), getattr(part, field.name, None)
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            yield from _fields(value, flag + ".")
        else:
            yield flag, hints[field.name]


def _refuse_unknown(arguments: Sequence[str], known: Sequence[str], first: str | None, prog: str) -> None:
    given = [argument.partition("=")[0] for argument in arguments if argument.startswith("--")]
    if first is not None and f"--{first}" in given:
        raise UserError(f"--{first} is no option: give it by itself; see {prog} --help")
    wrong = [flag for flag in given if flag.replace("_", "-") not in known]
    if wrong:
        raise UserError("\n".join([*(_about(flag, known) for flag in wrong), f"All options: {prog} --help"]))


def _about(flag: str, known: Sequence[str]) -> str:
    """What there is to say of a flag that does not exist: its name of today, one that may be meant, or all there are.

    It is compared by what follows the part that it names (`--learner.`), in which all flags of the part are alike.
    """
    written = flag.replace("_", "-")
    now = new_flag(written)
    said = f"unknown option {flag!r}"
    if now in known:
        return f"{said}; since version 0.2 it is {now}"
    name = now or written
    part = name[: name.rfind(".") + 1] or "--"
    beside = {other.removeprefix(part): other for other in known if other.startswith(part)}
    choices = beside or {other: other for other in known}
    close = nearest(name.removeprefix(part) if beside else name, choices, cutoff=ALIKE)
    if close:
        return f"{said}; did you mean {choices[close]!r}?"
    if now and any(other.startswith(now.partition(".")[0]) for other in known):
        return f"{said}; since version 0.2 it is {now}, which this configuration does not have"
    return said + (f"; known: {', '.join(beside.values())}" if 0 < len(beside) <= FEW else "")


def _grouped(arguments: Sequence[str], fields: Mapping[str, Any]) -> tuple[list[str], dict[str, list[str]]]:
    """The words that stand by themselves, and those of every flag, the last time that it is given.

    Args:
        arguments: of the command line.
        fields: what the flags take, where words may stand behind them that are not theirs; otherwise empty.
    """
    alone: list[str] = []
    given: dict[str, list[str]] = {}
    flag = ""
    for argument in arguments:
        if argument.startswith("--"):
            name, equals, value = argument.partition("=")
            flag = name.replace("_", "-")
            given[flag] = [value] if equals else []
        elif flag and (not fields or _takes(fields[flag], given[flag], argument)):
            given[flag].append(argument)
        else:
            alone.append(argument)
    return alone, given


def _takes(hint: Any, words: Sequence[str], word: str) -> bool:
    """Whether a flag that has these words already takes another one."""
    if _many(hint):
        return True
    # A truth value in other letters is taken, too, so that what is wrong with it can be said.
    return not words and (hint is not bool or word.capitalize() in _choices(bool))


def _many(hint: Any) -> bool:
    """Whether a flag takes as many words as there are."""
    return get_origin(hint) is tuple or any(_many(part) for part in get_args(hint))


def _value(flag: str, hint: Any, words: Sequence[str]) -> Any:
    """What the words behind a flag mean."""
    if hint is bool and not words:
        return True
    choices = _choices(hint)
    if choices and len(words) == 1 and words[0] not in choices:
        raise unknown(flag, words[0], choices)
    one = dataclasses.make_dataclass("One", [("value", hint)])
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            return tyro.cli(one, args=["--value", *words], config=OPTIONS).value
    except (SystemExit, ValueError):
        given = repr(" ".join(words)) if words else "nothing"
        raise UserError(f"{flag} takes {_described(hint)}, got {given}") from None


def _replaced(part: T, values: Mapping[str, Any], prefix: str = "--") -> T:
    """The dataclass with other values, each part of it made once, so that its checks see all of them together."""
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(part):  # type: ignore[arg-type]
        flag, old = prefix + field.name.replace("_", "-"), getattr(part, field.name)
        if flag in values:
            changes[field.name] = values[flag]
        elif dataclasses.is_dataclass(old) and any(name.startswith(flag + ".") for name in values):
            try:
                changes[field.name] = _replaced(old, values, flag + ".")
            except ValueError as error:
                if type(error) is UserError:  # of a part of it, which is named already
                    raise
                raise UserError(f"{(flag[2:]).replace('-', '_')}: {error}") from error
    return dataclasses.replace(part, **changes) if changes else part  # type: ignore[type-var]


def _choices(hint: Any) -> list[str]:
    """The words that a flag takes, if they are a few."""
    if get_origin(hint) is Annotated:
        return _choices(get_args(hint)[0])
    if get_origin(hint) is Literal:
        return [str(value) for value in get_args(hint)]
    if get_origin(hint) in (Union, UnionType):
        parts = [part for part in get_args(hint) if part is not type(None)]
        own = [_choices(part) for part in parts]
        if not all(own):
            return []
        words = [word for words in own for word in words]
        return words if "none" in words else ["None", *words]  # two that differ in a capital would be mistaken
    return ["True", "False"] if hint is bool else []


def _described(hint: Any) -> str:
    """What a flag takes, in words."""
    if choices := _choices(hint):
        return " or ".join(choices)
    if get_origin(hint) is Annotated:
        return "a whole number such as 200000 or 2e5" if get_args(hint)[0] is int else _described(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        return " or ".join("None" if part is type(None) else _described(part) for part in get_args(hint))
    if get_origin(hint) is tuple:
        return f"values of which each is {_described(get_args(hint)[0])}"
    return {int: "a whole number", float: "a number", str: "a text", Path: "a file name"}.get(hint, str(hint))
