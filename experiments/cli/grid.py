"""``--grid FIELD=VALUE,VALUE``: which fields of a configuration can be swept, and the configurations of a grid."""

import dataclasses
import hashlib
import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.cli import request
from experiments.methods import METHODS
from t2tl_jax.errors import UserError, unknown
from t2tl_jax.names import ALIKE, nearest
from t2tl_jax.registry import AGENTS
from t2tl_jax.runs.config import Config
from t2tl_jax.training.numbers import numbers_of

METHOD = "method"
"""What is no field of a configuration, but can be swept as one."""

LEARNER = "learner"
"""The field of a configuration that its learner is; a field of that may also be called by the learner's own name."""

REASONS = {
    "run": "it says what happens around a training and changes nothing in it",
    "seeds": "every point of the grid has the same seeds, which --seeds names",
}
"""Fields that cannot be swept, and why."""


@dataclass(frozen=True)
class Axis:
    """One ``--grid`` option."""

    field: str
    """Its path in the configuration, such as ``learner.learning_rate``, or ``method``."""
    values: tuple[str, ...]
    """As they were written."""

    @property
    def flag(self) -> str:
        """The name of the field's flag."""
        return self.field.replace("_", "-")


@dataclass(frozen=True)
class Point:
    """One configuration of a grid."""

    label: str
    """What the grid chose, such as ``learning-rate=1e-4,method=t1tl``."""
    config: Config
    """The configuration."""
    words: tuple[str, ...] = ()
    """The flags that choose it, after those of all points."""

    @property
    def folder(self) -> str:
        """The label as the name of a folder."""
        plain = re.sub(r"[^\w.=,+-]", "_", self.label)
        return plain if plain == self.label else f"{plain}-{hashlib.sha256(self.label.encode()).hexdigest()[:6]}"


def read_axes(texts: Sequence[str]) -> tuple[Axis, ...]:
    """What the ``--grid`` options say.

    Raises:
        UserError: for one without values, or a field or a value that is given twice.
    """
    axes: list[Axis] = []
    for text in texts:
        field, _, values = text.partition("=")
        axis = Axis(field.removeprefix("--").replace("-", "_"), tuple(value.strip() for value in values.split(",")))
        if not (axis.field and all(axis.values)):
            raise UserError(f"--grid takes FIELD=VALUE,VALUE, such as learner.learning-rate=1e-4,3e-4, got {text!r}")
        if axis.field in (other.field for other in axes) or len(set(axis.values)) < len(axis.values):
            raise UserError(f"--grid {text}: every field and every value of it may be given once")
        axes.append(axis)
    return tuple(axes)


def points(axes: Sequence[Axis], asked: request.Request, prog: str) -> list[Point]:
    """The configurations of a grid: the product of its axes, the last one moving fastest.

    Args:
        axes: of `read_axes`.
        asked: what the other flags ask for.
        prog: the command, for messages.

    Raises:
        UserError: for fields that cannot be swept, for values that do not fit, and for points that are the same.
    """
    found: list[Point] = []
    for values in itertools.product(*(axis.values for axis in axes)):
        chosen = dict(zip(axes, values, strict=True))
        methods = [value for axis, value in chosen.items() if axis.field == METHOD]
        start = dataclasses.replace(asked, method=methods[0]) if methods else asked
        if methods and methods[0] not in METHODS:
            raise unknown(METHOD, methods[0], METHODS)
        base, _ = request.configuration(start, "", prog)
        own: list[str] = []
        for axis, value in chosen.items():
            if axis.field != METHOD:
                field = _of_learner(base, axis.field)
                own += [f"--{field.replace('_', '-')}", *_words(_checked(base, field), value)]
        config, _ = request.configuration(dataclasses.replace(start, rest=(*asked.rest, *own)), "", prog)
        label = ",".join(f"{_short(axis, axes)}={value}" for axis, value in chosen.items())
        for other in found:
            if other.config == config:
                raise UserError(f"--grid: {label} is the same configuration as {other.label}; give every value once")
        found.append(Point(label, config, (*(("--method", *methods) if methods else ()), *own)))
    return found


def _of_learner(config: Config, field: str) -> str:
    """``learner.learning_rate`` for ``ppo.learning_rate`` where the learner is PPO, and likewise for any other."""
    first, dot, rest = field.partition(".")
    return f"{LEARNER}{dot}{rest}" if dot and first == AGENTS.name_of(config.learner) else field


def is_number(config: Config, field: str) -> bool:
    """Whether a field holds a number that only enters arithmetic, so that its values share one program."""
    names, field = numbers_of(config.learner, config.random_starts), _of_learner(config, field)
    return field.removeprefix("learner.") in names if field.startswith("learner.") else field in names


def fields(config: Any, prefix: str = "") -> Iterator[str]:
    """The paths of all fields, those of parts included."""
    for field in dataclasses.fields(config):
        yield prefix + field.name
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            yield from fields(value, f"{prefix}{field.name}.")


def _checked(config: Config, field: str) -> Any:
    """The value of a field that can be swept.

    Raises:
        UserError: for another field, with the reason and the nearest one that can.
    """
    known = list(fields(config))
    can = [name for name in known if name.partition(".")[0] not in REASONS]
    if field in can:
        value: Any = config
        for name in field.split("."):
            value = getattr(value, name)
        return value
    flag, reason = field.replace("_", "-"), REASONS.get(field.partition(".")[0], "")
    # Numbers come first: they are what a sweep is for.
    numbers = [name for name in can if is_number(config, name)]
    near = nearest(field, numbers, cutoff=ALIKE) or nearest(field, [*can, METHOD], cutoff=ALIKE)
    if field not in known:
        reason = "this configuration has no such field"
    hint = f"the nearest field that can is {near}" if near else f"one that can is {min(numbers or can, key=len)}"
    raise UserError(f"{flag}: it cannot be swept: {reason}; {hint.replace('_', '-')}")


def _words(value: Any, text: str) -> list[str]:
    """The words of a flag; several numbers of one field are parted by spaces."""
    return text.split() if isinstance(value, tuple) else [text]


def _short(axis: Axis, axes: Sequence[Axis]) -> str:
    """The last part of a field's name, or all of it where another axis ends alike."""
    last = axis.flag.rpartition(".")[2]
    alike = [other for other in axes if other.flag.rpartition(".")[2] == last]
    return last if len(alike) == 1 else axis.flag
