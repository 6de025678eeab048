"""Flags to configuration: named configs, overrides of any field, and errors that name the nearest valid spelling."""

import argparse
import contextlib
import dataclasses
import io
import re
import typing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args

import tyro

from experiments.configs import CONFIGS, Config
from experiments.errors import UserError, nearest, unknown
from experiments.methods import METHODS

T = TypeVar("T")

DESCRIPTION = """Train an agent on a temporal-logic task.

  --config NAME   start from a named configuration; every option below overrides one of its fields
  --method NAME   make it one of the methods t2tl, t1tl, gnn, rm, dfa or dfa_cont, all else being equal
  --list          show the named configurations and the methods
  --resume RUN    continue a finished or interrupted run; of the options below only --frames (to train longer)
                  and --run.* apply
  --PART None     leave out an optional part that the configuration has, such as --network.context

Examples:
  python -m experiments.run --config zone_ppo --seeds 4
  python -m experiments.run --config zone_ppo --method dfa_cont
  python -m experiments.run --config zone_ppo --method t1tl --pretrained ''
  python -m experiments.run --config zone_ppo --ppo.learning-rate 1e-4 --frames 2e5 --task 'F(Red & F White)'
  python -m experiments.run --config waterworld_dqn --dqn.batch-size 256 --env.layout random
  python -m experiments.run --resume runs/zone_ppo/2026-01-31_12-00-00

The defaults shown are those of the chosen configuration."""


CHOOSING = ("--config", "--method", "--resume", "--list")
"""The flags that come before those of the configuration's fields."""


@dataclass(frozen=True)
class Request:
    """What the flags before the configuration's own ask for."""

    config: str | None
    """Name of the configuration, which exists."""
    method: str | None
    """Name of the method, which exists; None for what the configuration is."""
    resume: Path | None
    """Run to continue."""
    show_list: bool
    """Only show the configurations."""
    rest: tuple[str, ...]
    """Flags for the fields of the configuration."""


def names(prefix: str = "") -> list[str]:
    """The configurations whose names begin with `prefix`, without it."""
    return [name.removeprefix(prefix) for name in CONFIGS if name.startswith(prefix)]


def default(prefix: str = "") -> str:
    """The configuration whose values ``--help`` shows when none is named."""
    return prefix + names(prefix)[0]


def read_request(arguments: Sequence[str], prefix: str = "") -> Request:
    """Split the flags that choose a configuration from those that override its fields.

    Args:
        arguments: of the command line, without the program's name.
        prefix: what names of configurations lack here.

    Raises:
        UserError: for an unknown name, for both or none of ``--config`` and ``--resume``.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--config")
    parser.add_argument("--method")
    parser.add_argument("--resume", type=Path)
    parser.add_argument("--list", action="store_true")
    try:
        known, rest = parser.parse_known_args(list(arguments))
    except argparse.ArgumentError as error:
        raise UserError(f"{error}; see --help") from error
    helping = bool({"-h", "--help"} & set(rest))
    if known.config is not None and known.config not in names(prefix):
        raise unknown("config", known.config, names(prefix))
    if known.method is not None and known.method not in METHODS:
        raise unknown("method", known.method, METHODS)
    if known.resume is not None and (known.config is not None or known.method is not None):
        raise UserError("--resume continues a run with its own configuration; leave --config and --method out")
    if known.config is None and known.resume is None and not (known.list or helping):
        raise UserError(
            f"choose a configuration with --config NAME ({', '.join(names(prefix))}), or a run with --resume RUN"
        )
    return Request(known.config, known.method, known.resume, known.list, tuple(rest))


def list_configs(prefix: str = "") -> str:
    """The named configurations and the methods, one per line."""
    width = max(map(len, [*names(prefix), *METHODS]))
    configs = [f"{name:{width}}  {CONFIGS[prefix + name][1]}" for name in names(prefix)]
    methods = [f"{name:{width}}  {method.summary}" for name, method in METHODS.items()]
    return "\n".join([*configs, "", "methods:", *methods])


def override(config: Config, arguments: Sequence[str], prog: str = "python -m experiments.run") -> Config:
    """The configuration with the fields that the flags name replaced; otherwise as ``parse``."""
    try:
        config, rest = without_parts(config, list(arguments))
    except ValueError as error:  # from the checks of the dataclasses
        raise UserError(str(error)) from error
    return parse(Config, rest, prog, DESCRIPTION, default=config, others=CHOOSING)


def without_parts(config: Any, arguments: list[str], prefix: str = "--") -> tuple[Any, list[str]]:
    """The dataclass less every part that a flag sets to None, and the other arguments.

    tyro offers the fields of a part that is there, or None where there is none, but no way from one to the other.
    """
    for field in dataclasses.fields(config):
        value, flag = getattr(config, field.name), prefix + field.name.replace("_", "-")
        if not dataclasses.is_dataclass(value):
            continue
        place = _find_none(arguments, flag)
        if place is not None and type(None) in get_args(typing.get_type_hints(type(config))[field.name]):
            value, arguments = None, arguments[: place.start] + arguments[place.stop :]
        else:
            value, arguments = without_parts(value, arguments, flag + ".")
        if value is not getattr(config, field.name):
            config = dataclasses.replace(config, **{field.name: value})
    return config, arguments


def _find_none(arguments: Sequence[str], flag: str) -> slice | None:
    """Where the arguments say ``--flag None`` or ``--flag=None``; underscores count as hyphens."""
    for i, argument in enumerate(arguments):
        name, equals, value = argument.partition("=")
        if name.replace("_", "-") == flag:
            if equals and value == "None":
                return slice(i, i + 1)
            if not equals and arguments[i + 1 : i + 2] == ["None"]:
                return slice(i, i + 2)
    return None


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


OPTIONS = (tyro.conf.FlagConversionOff, tyro.conf.AvoidSubcommands)
"""Truth values are written out (``--run.gif False``), as in the configuration file. Of environments, networks and
learners the flags are those of the kind that the chosen configuration has."""


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
