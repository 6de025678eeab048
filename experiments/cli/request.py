"""Flags to configuration: named configurations, methods, and overrides of any field."""

import argparse
import copy
import dataclasses
import typing
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import experiments.configs  # noqa: F401, registers the environments and configurations of this project
from experiments.cli.plugins import import_modules
from experiments.methods import METHODS, apply
from t2tl_jax.errors import Note, UserError, explained, unknown
from t2tl_jax.flags import HELP, parse
from t2tl_jax.ltl import TaskFamily, named_families
from t2tl_jax.names import ALIKE, nearest
from t2tl_jax.registry import configs, named_config
from t2tl_jax.runs import config_files, machine_files
from t2tl_jax.runs.config import Config, RunConfig
from t2tl_jax.runs.config_files import REGISTRIES
from t2tl_jax.runs.differences import in_short
from t2tl_jax.runs.folder import name_of, open_existing

DESCRIPTION = """Train an agent on a temporal-logic task.

  --config NAME   start from a named configuration, or from a file NAME.json such as the config.json of a run, whose
                  run.folder is ignored; every option below overrides one of its fields
  --method NAME   turn it into one of the methods t2tl, t1tl, gnn, rm, dfa, dfa_cont, dfa_number or rm_6, changing
                  nothing else
  --list          show the named configurations, the methods, and all other names
  --resume RUN    continue a finished or interrupted run; of the options below, only --frames (to train longer),
                  --until-solved, --convergence.* and --run.* apply
  --hosts WHO     spread one run over several processes, each started with this option: slurm, or HOST:PORT,COUNT,INDEX
  --import MODULE import a module of yours that registers environments, learners, task encoders or configurations
  --PART KIND     use another kind of environment (--env), learner (--learner) or task encoder
                  (--learner.network.task-encoder), with its defaults
  --task KIND     draw tasks from a family with fields, such as chains, which --task.FIELD then sets
  --PART None     leave out an optional part that the configuration has, such as --learner.network.context
  --PART.FIELD X  add an optional part that the configuration lacks, such as --learner.network.context.length 8

Examples:
  python -m experiments.run --config zone_ppo --seeds 4
  python -m experiments.run --config zone_ppo --method dfa_cont
  python -m experiments.run --config zone_ppo --method t1tl --pretrained ''
  python -m experiments.run --config zone_ppo --learner.learning-rate 1e-4 --frames 2e5 --task 'F(Red & F White)'
  python -m experiments.run --config waterworld_dqn --learner.batch-size 256 --env.layout random
  python -m experiments.run --config runs/zone_ppo/2026-01-31_12-00-00/config.json --seeds 12
  python -m experiments.run --resume runs/zone_ppo/2026-01-31_12-00-00

The defaults shown are those of """


CHOOSING = ("--config", "--method", "--resume", "--list", "--import", "--hosts")
"""The flags that come before those of the configuration's fields."""


@dataclass(frozen=True)
class Request:
    """What the flags before the configuration's own ask for."""

    config: str | None
    """Name of the configuration, which exists, or the path of a file that holds one."""
    method: str | None
    """Name of the method, which exists; None for what the configuration is."""
    resume: Path | None
    """Run to continue."""
    show_list: bool
    """Only show the configurations."""
    rest: tuple[str, ...]
    """Flags for the fields of the configuration."""

    @property
    def helping(self) -> bool:
        """Whether they only ask for help."""
        return bool(HELP & set(self.rest))


def names(prefix: str = "") -> list[str]:
    """The configurations whose names begin with `prefix`, without it."""
    return [name.removeprefix(prefix) for name in configs() if name.startswith(prefix)]


def read(arguments: Sequence[str], prefix: str = "") -> Request:
    """Split the flags that choose a configuration from those that override its fields.

    Args:
        arguments: of the command line, without the program's name.
        prefix: what names of configurations lack here.

    Raises:
        UserError: for an unknown name, which is no file either; for both or none of ``--config`` and ``--resume``.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--config")
    parser.add_argument("--method")
    parser.add_argument("--resume", type=Path)
    parser.add_argument("--list", action="store_true")
    try:
        known, rest = parser.parse_known_args(import_modules(arguments))
    except argparse.ArgumentError as error:
        raise UserError(f"{error}; see --help") from error
    asked = Request(known.config, known.method, known.resume, known.list, tuple(rest))
    if known.config is not None and known.config not in names(prefix) and not _is_file(known.config):
        raise UserError(
            f"{unknown('config', known.config, names(prefix))}\n"
            "--config takes one of these names, or a path to a file such as the config.json of a run"
        )
    if known.method is not None and known.method not in METHODS:
        raise unknown("method", known.method, METHODS)
    if known.resume is not None and (known.config is not None or known.method is not None):
        raise UserError("--resume continues a run with its own configuration; leave --config and --method out")
    if known.config is None and known.resume is None and not (known.list or asked.helping):
        word = rest[0] if rest and not rest[0].startswith("-") else ""
        if close := word if word and _is_file(word) else nearest(word, names(prefix), cutoff=ALIKE):
            raise UserError(f"every option begins with --, got {word!r}; did you mean --config {close}?")
        raise UserError(
            f"choose a configuration with --config NAME ({', '.join(names(prefix))}) or --config FILE.json, or a run "
            "with --resume RUN"
        )
    return asked


def configuration(asked: Request, prefix: str, prog: str) -> tuple[Config, str]:
    """The configuration that was asked for, and its name; for ``--resume`` that of the run, with what may change.

    Raises:
        UserError: for flags that do not fit.
    """
    if asked.resume is not None and not asked.helping:
        return override(open_existing(asked.resume)[1], asked.rest, prog), asked.resume.name
    given = asked.config or names(prefix)[0]  # the first one for --help without a name
    shown = "the chosen configuration" if asked.config else f"{given}, since no configuration is chosen"
    if given in names(prefix):
        name = prefix + given
        config = named_config(name)
    else:
        if not Path(given).is_file():
            why = "it is a folder" if Path(given).is_dir() else "there is no such file"
            raise UserError(
                f"cannot read {given}: {why}; --config "
                "takes a path to a file such as the config.json of a run, or one of the names that --list shows"
            )
        config, name = config_files.load(Path(given)), name_of(Path(given))
        # Where runs are written, this machine says or a flag: a file may be a stranger's.
        config = dataclasses.replace(config, run=dataclasses.replace(config.run, folder=RunConfig().folder))
    if asked.method is not None:
        config, name = apply(config, asked.method), f"{name}_{asked.method}"
    config = override(config, asked.rest, prog, shown)
    return (config if given in names(prefix) else _of_file(config, Path(given), asked.rest)), name


def _of_file(config: Config, file: Path, flags: Sequence[str]) -> Config:
    """What flags made of a configuration from a file, with the task's file from beside it, and the pre-training as it
    is named from there, unless a flag names these; a note says what else is read elsewhere.

    Raises:
        UserError: where the task is a file that does not lie there.
    """
    from t2tl_jax.runs import pretraining  # which loads what --help need not wait for

    if find(flags, "--pretrained")[1] is None:
        config = pretraining.located(config, file.parent)
        if elsewhere := pretraining.elsewhere(config):
            warnings.warn(f"pre-trained by what {file} names: {elsewhere}", Note, stacklevel=2)
    return machine_files.with_copy(config, file.parent) if find(flags, "--task")[1] is None else config


def _is_file(text: str) -> bool:
    """Whether it means a file, be it there or not: of one that is not there, its error should tell."""
    return text.endswith(".json") or Path(text).is_file()


def list_configs(prefix: str = "") -> str:
    """The named configurations, the methods and the registered kinds, one per line."""
    width = max(map(len, [*names(prefix), *METHODS]))
    lines = [f"{name:{width}}  {configs()[prefix + name][1]}" for name in names(prefix)]
    methods = [f"{name:{width}}  {method.summary}" for name, method in METHODS.items()]
    kinds = [f"{registry.thing}s: {', '.join(registry.names())}" for registry in REGISTRIES.values()]
    return "\n".join([*lines, "", "methods:", *methods, "", *kinds])


def override(
    config: Config,
    arguments: Sequence[str],
    prog: str = "python -m experiments.run",
    shown: str = "the chosen configuration",
) -> Config:
    """The configuration with the fields that the flags name replaced; otherwise as ``flags.parse``.

    Args:
        config: whose fields are replaced.
        arguments: the flags.
        prog: how the program is called, for its help.
        shown: what the help says whose the defaults are.
    """
    config, rest = with_parts(config, list(arguments))
    if HELP & set(rest):
        config = copy.copy(config)
        object.__setattr__(config, "task", in_short(config.task))  # as a default in the help, which is all that follows
    config = parse(Config, rest, prog, f"{DESCRIPTION}{shown}.", default=config, others=CHOOSING)
    with explained():  # what the checks of the dataclasses say
        return _checked(config)


def with_parts(config: Any, arguments: list[str], prefix: str = "--") -> tuple[Any, list[str]]:
    """The dataclass with other kinds of parts where a flag names one, without those that a flag sets to None, and with
    optional ones, by default, of which a flag sets a field.

    tyro offers the fields of the part that is there, or None where there is none, but no way from one to the other.
    Also returns the other arguments. What parts hold is not checked: one may fit only together with what other flags
    change.

    Raises:
        UserError: for a part that is left out and of which a field is set.
    """
    changes: dict[str, Any] = {}
    hints = typing.get_type_hints(type(config))
    for field in dataclasses.fields(config):
        value, flag = getattr(config, field.name), prefix + field.name.replace("_", "-")
        place, word = find(arguments, flag)
        if word is not None and hints[field.name] == str | TaskFamily:
            value, arguments = named_families().get(word, word), without(arguments, place)
            changes[field.name] = value
        if value is None and _has_fields_of(arguments, flag):
            kinds: list[Any] = [kind for kind in get_args(hints[field.name]) if dataclasses.is_dataclass(kind)]
            value = kinds[0]() if kinds else None
        if not dataclasses.is_dataclass(value):
            continue
        if word is not None and hints[field.name] in REGISTRIES:
            value, arguments = REGISTRIES[hints[field.name]].config_class(word)(), without(arguments, place)
        elif word == "None" and type(None) in get_args(hints[field.name]):
            changes[field.name], arguments = None, without(arguments, place)
            if _has_fields_of(arguments, flag):
                raise UserError(f"{flag} None leaves out a part of which {flag}.FIELD sets a field: drop one of them")
            continue
        changes[field.name], arguments = with_parts(value, arguments, flag + ".")
    changed = copy.copy(config)
    for name, value in changes.items():
        object.__setattr__(changed, name, value)
    return changed, arguments


def _has_fields_of(arguments: Sequence[str], flag: str) -> bool:
    """Whether the arguments set a field of a part: ``--flag.FIELD``."""
    return any(argument.partition("=")[0].replace("_", "-").startswith(f"{flag}.") for argument in arguments)


def _checked(config: Any) -> Any:
    """The same dataclass, made anew with all of its parts, so that its checks see it as it is now."""
    values = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    return type(config)(**{name: _checked(x) if dataclasses.is_dataclass(x) else x for name, x in values.items()})


def find(arguments: Sequence[str], flag: str) -> tuple[slice, str | None]:
    """Where the arguments say ``--flag WORD`` or ``--flag=WORD``, and the word; underscores count as hyphens."""
    for i, argument in enumerate(arguments):
        name, equals, value = argument.partition("=")
        if name.replace("_", "-") == flag:
            if equals:
                return slice(i, i + 1), value
            if i + 1 < len(arguments) and not arguments[i + 1].startswith("--"):
                return slice(i, i + 2), arguments[i + 1]
    return slice(0), None


def without(arguments: list[str], place: slice) -> list[str]:
    """The arguments but for those at a place, as `find` gives it."""
    return arguments[: place.start] + arguments[place.stop :]
