"""A configuration as JSON and back. Only the fields of the dataclasses are accepted, so a file cannot run code.

Which dataclass an environment, a learner or a task encoder is, says its field ``kind``: a name of the registry.
"""

import json
import operator
import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import cattrs

from t2tl_jax.env import EnvConfig
from t2tl_jax.errors import Note, NotRegistered, UserError
from t2tl_jax.ltl import Limits, TaskFamily
from t2tl_jax.names import ALIKE, FEW, nearest
from t2tl_jax.networks.state_encoder import StateEncoderConfig
from t2tl_jax.networks.task_encoder import SequenceEncoderConfig, TaskEncoderConfig
from t2tl_jax.registry import AGENTS, CONTEXT_READERS, ENVS, STATE_ENCODERS, TASK_ENCODERS, TASK_FAMILIES, Registry
from t2tl_jax.runs.config import Config, RunConfig
from t2tl_jax.runs.migration import VERSION, migrated
from t2tl_jax.training.types import LearnerConfig

MOST_BYTES = 2**26
"""Of a JSON file of a run that is read: a thousand seeds take a twentieth of it."""

KIND = "kind"
"""Field of the JSON that says which of several dataclasses an object is."""

REGISTRIES: dict[type, Registry] = {
    EnvConfig: ENVS,
    LearnerConfig: AGENTS,
    TaskEncoderConfig: TASK_ENCODERS,
    StateEncoderConfig: STATE_ENCODERS,
    SequenceEncoderConfig: CONTEXT_READERS,
    TaskFamily: TASK_FAMILIES,
}
"""Where the kinds of a base class are registered."""


def strict(converter: cattrs.Converter) -> cattrs.Converter:
    """The converter, which takes values as they are: cattrs would turn the text "false" into True and 0.5 into 0."""
    for kind in (bool, int, str):
        converter.register_structure_hook(kind, _exactly)
    converter.register_structure_hook(float, _number)
    return converter


@cache
def _converter() -> cattrs.Converter:
    """One for all configurations: what it does for a class it writes when it meets that first, which takes longer."""
    converter = strict(cattrs.Converter(forbid_extra_keys=True))

    def structured(registry: Registry, value: Any, _: Any) -> Any:
        fields = dict(value) if isinstance(value, dict) else {}
        if KIND not in fields:
            raise ValueError(f"expected an object whose {KIND} names a registered {registry.thing}, got {value!r}")
        return converter.structure(fields, registry.config_class(fields.pop(KIND)))

    def with_kind(registry: Registry, value: Any) -> dict[str, Any]:
        return {KIND: registry.name_of(value), **converter.unstructure(value)}

    for base, registry in REGISTRIES.items():
        # Only fields that are declared with the base class itself hold one of several kinds.
        converter.register_structure_hook_func(partial(operator.is_, base), partial(structured, registry))
        converter.register_unstructure_hook_func(partial(operator.is_, base), partial(with_kind, registry))
    # A task is a text or a family.
    task = str | TaskFamily
    converter.register_structure_hook_func(
        partial(operator.eq, task),
        lambda value, _: converter.structure(value, str if isinstance(value, str) else TaskFamily),
    )
    converter.register_unstructure_hook_func(
        partial(operator.eq, task),
        lambda value: value if isinstance(value, str) else converter.unstructure(value, TaskFamily),
    )
    return converter


def to_json(config: Config) -> str:
    """The configuration with every field, as indented JSON.

    Raises:
        UserError: if its environment, learner or task encoder is of no registered kind.
    """
    content = {"version": VERSION, **_converter().unstructure(config, Config)}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def from_json(text: str, source: str) -> Config:
    """Read a configuration, of this version or of an earlier one.

    Args:
        text: JSON, as written by ``to_json``.
        source: what to call it in messages.

    Raises:
        UserError: for text that is not JSON, unknown fields (from another version, say) and unsuitable values;
            NotRegistered for a kind that is not known.
    """
    try:
        return _structured(text, source)
    except RecursionError as error:  # of the reader of JSON, of cattrs, or of what puts its errors into words
        raise UserError(f"{source} is nested more deeply than any configuration") from error


def _structured(text: str, source: str) -> Config:
    try:
        data = json.loads(text)
    except ValueError as error:
        raise UserError(f"{source} is not valid JSON: {error}") from error
    try:
        return _converter().structure(migrated(data), Config)
    except Exception as error:  # cattrs groups whatever the dataclasses raise
        problems = [_readable(line) for line in cattrs.transform_error(error, path="config", format_exception=_explain)]
        missing = isinstance(error, ExceptionGroup) and error.subgroup(NotRegistered)
        raise (NotRegistered if missing else UserError)(
            f"{source} does not fit this version:\n  "
            + "\n  ".join(problems[:8])
            + "\nUse the version that is named in the run's versions.json, or edit the file."
        ) from error


def read_text(path: Path) -> str:
    """What a file of a run says, whose JSON takes several times its size in memory.

    Raises:
        OSError: if it cannot be read.
        UserError: if it is larger than any that a run has.
        UnicodeDecodeError: if it is no text.
    """
    if (size := path.stat().st_size) > MOST_BYTES:
        raise UserError(f"{path} takes {size / 2**20:,.0f} MiB, and at most {MOST_BYTES // 2**20} MiB are read")
    return path.read_text(encoding="utf-8")


def load(path: Path) -> Config:
    """Read a configuration from a file; raises ``UserError`` as ``from_json`` does, and for a missing file.

    Compiled programs are code, so the folder for them is never one that a file names: it is that of this machine, or
    none if the file says none. A small file can ask for large tables: a `Note` says which of their limits it raises.
    """
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"cannot read {path}: {error}") from error
    config = from_json(text, str(path))
    usual = vars(Limits())
    raised = {name: value for name, value in vars(config.limits).items() if value > usual[name]}
    if raised:
        said = ", ".join(f"{name}={value:,} ({usual[name]:,} by default)" for name, value in raised.items())
        warnings.warn(f"{path} raises limits of tables, which may take more memory and time: {said}", Note, 2)
    cache = config.run.compilation_cache and RunConfig().compilation_cache
    return replace(config, run=replace(config.run, compilation_cache=cache))


def stored_version(path: Path) -> int:
    """The version of the format in which a file that `load` can read holds a configuration."""
    return json.loads(read_text(path)).get("version", 1)


def _exactly(value: Any, kind: type) -> Any:
    if type(value) is not kind:
        raise TypeError(f"expected {kind.__name__}, got {value!r}")
    return value


def _number(value: Any, kind: type) -> float:
    if type(value) not in (int, float):
        raise TypeError(f"expected a number, got {value!r}")
    return float(value)


def _explain(error: BaseException, kind: type | None) -> str:
    if isinstance(error, cattrs.ForbiddenExtraKeysError):
        known = [field.name for field in error.cl.__dataclass_fields__.values()]  # type: ignore[attr-defined]
        return "; ".join(_about_field(name, known) for name in sorted(error.extra_fields))
    if isinstance(error, ValueError | TypeError):
        return str(error)
    return cattrs.v.format_exception(error, kind)


def _about_field(name: str, known: Sequence[str]) -> str:
    """A field that does not exist, with one that may be meant, or all there are where they are few."""
    if near := nearest(name, known, cutoff=ALIKE):
        return f"unknown field {name!r}, nearest known {near!r}"
    return f"unknown field {name!r}" + (f", known {', '.join(known)}" if len(known) <= FEW else "")


def _readable(problem: str) -> str:
    """cattrs ends each problem with `` @ config.learner``; put the place first."""
    text, _, place = problem.rpartition(" @ ")
    return f"{place}: {text}" if place else text
