"""What two configurations differ in, in the words of the command line."""

import dataclasses
from collections.abc import Iterator
from functools import cache
from typing import Any

from t2tl_jax.env import EnvConfig
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import Mixture, TaskFamily, named_families
from t2tl_jax.registry import TASK_FAMILIES, make_env
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.config_files import REGISTRIES
from t2tl_jax.runs.machine_files import same_task
from t2tl_jax.training.numbers import RANDOM_STARTS, numbers_of


def differences(base: Any, other: Any, prefix: str = "") -> Iterator[str]:
    """Fields in which two configurations differ, as ``learner.noise_time=0.0``; `run` does not count, nor does
    `map_period` where the other one's maps are never renewed.

    Of another kind of environment, network or learner, its name and what departs from its defaults.
    """
    for field in dataclasses.fields(base):
        if prefix == "" and field.name == "run":
            continue
        a, b, name = getattr(base, field.name), getattr(other, field.name), prefix + field.name
        if a == b:
            continue
        if isinstance(b, TaskFamily) and (type(a) is not type(b) or isinstance(b, Mixture)):
            yield f"{name}={in_short(b)}"
        elif dataclasses.is_dataclass(b) and not isinstance(b, type):
            if type(a) is not type(b):
                yield f"{name}={_kind(b)}"
                a = type(b)()
            yield from differences(a, b, name + ".")
        elif name == "map_period":
            if _renewable(other.env):
                yield f"{name}={b}"
        elif not (name == "task" and same_task(a, b)):
            yield f"{name}={b}"


def in_short(task: str | TaskFamily) -> str:
    """A task in a few words, where its settings would fill lines."""
    if not isinstance(task, TaskFamily) or str(task) in named_families():
        return str(task)
    if isinstance(task, Mixture):
        return f"a mixture of {len(task.parts)} families"
    return f"a family of the kind {TASK_FAMILIES.name_of(task)}"


def _kind(part: Any) -> str:
    """What the command line calls a kind of part."""
    registered = (registry for registry in REGISTRIES.values() if type(part) in registry.classes())
    registry = next(registered, None)
    return type(part).__name__ if registry is None else registry.name_of(part)


def changed_fields(base: Any, other: Any, prefix: str = "") -> Iterator[str]:
    """Names of the fields in which two configurations differ, as ``learner.noise_time``; of a part of another kind, the
    name of the part."""
    for field in dataclasses.fields(base):
        a, b, name = getattr(base, field.name), getattr(other, field.name), prefix + field.name
        if a == b:
            continue
        if dataclasses.is_dataclass(a) and type(a) is type(b):
            yield from changed_fields(a, b, name + ".")
        else:
            yield name


@cache
def _renewable(env: EnvConfig) -> bool:
    try:
        return bool(make_env(env).renewable)
    except UserError:  # it was given as an object, which may be renewable
        return True


def without_numbers(config: Config) -> Config:
    """The configuration with the same numbers as all others of its program, see `training/numbers.py`."""
    learner = config.learner.with_numbers(dict.fromkeys(config.learner.numbers, 0.0))
    somewhere = RANDOM_STARTS in numbers_of(config.learner, config.random_starts)
    return dataclasses.replace(config, learner=learner, random_starts=0.5 if somewhere else config.random_starts)
