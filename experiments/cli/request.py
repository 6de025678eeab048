"""Flags to configuration: named configs, methods, and overrides of any field."""

import argparse
import dataclasses
import typing
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from experiments.cli.flags import parse
from experiments.configs import CONFIGS, Config
from experiments.methods import METHODS
from t2tl_jax.errors import UserError, explained, unknown

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
    """The configuration with the fields that the flags name replaced; otherwise as ``flags.parse``."""
    with explained():  # what the checks of the dataclasses say
        config, rest = without_parts(config, list(arguments))
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
