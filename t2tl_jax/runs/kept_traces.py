"""Which traced program on disk is that of a training: one of the same configuration, code, packages and hardware.

Only entry points turn this on (`use`), never the library. Nothing is kept where code of somebody else is loaded, such
as a plugin: nothing here knows which files that is made of. Nor where a source has changed since it was imported.
"""

import dataclasses
import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jax
import numpy as np

from t2tl_jax import loaded
from t2tl_jax.ltl import TaskTable
from t2tl_jax.registry import plugins_of_others
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.config_files import REGISTRIES
from t2tl_jax.runs.differences import without_numbers
from t2tl_jax.runs.given_env import GivenEnv
from t2tl_jax.training.trace_file import SUFFIX

OWN = ("t2tl_jax", "envs")
"""Packages whose every file counts."""
ELSEWHERE = ("seeds", "pretrained", "pretraining_schedule", "until_solved", "convergence", "selection", "plan", "run")
"""Fields of a configuration that no program of training depends on, but for shapes, which count by themselves."""

RECORDS = ("*.dist-info", "*.egg-info", "*.egg")
"""How installers name the folder, or file, that stands for a package: by its name and its version, but for what is
installed from its sources in the old way, whose name alone this is."""

_folders: list[Path] = []


def use(folder: Path | None) -> None:
    """Keep traced programs in a folder from now on; None for nowhere, as it is at first."""
    _folders[:] = [] if folder is None else [folder]


def file_of(config: Config, table: TaskTable, arguments: Any, sharding: Any) -> Path | None:
    """Where the iteration of a training is kept, and beside it how it begins; None if it is not to be.

    Args:
        config: of the training.
        table: its tasks.
        arguments: what the program is given beside its state, of which only shapes count.
        sharding: over which devices it is spread.
    """
    settings = getattr(jax.config, "values", None)  # which is no promise of JAX
    if not _folders or settings is None or isinstance(config.env, GivenEnv) or not is_own(config):
        return None
    if plugins_of_others() or (installed := _installed()) is None:
        return None
    named = {
        field.name: getattr(without_numbers(config), field.name)
        for field in dataclasses.fields(config)
        if field.name not in ELSEWHERE
    }
    leaves, structure = jax.tree.flatten(arguments)
    parts = (
        installed,
        repr(sorted(settings.items())),
        repr((jax.default_backend(), sorted({device.device_kind for device in jax.devices()}))),
        repr(named),
        str(jax.tree.structure(table)),
        *(_form(x) + _digest(x.tobytes()) for x in map(np.asarray, jax.tree.leaves(table))),
        f"{structure} {sharding}",
        *(_form(x) for x in map(np.asarray, leaves)),
    )
    return _folders[0] / f"{_digest(chr(0).join(parts).encode())[:32]}{SUFFIX}"


def is_own(config: Config) -> bool:
    """Whether all parts of a configuration are of this project, and made by it: a plugin may have its own maker."""
    makers = {kind: make for registry in REGISTRIES.values() for kind, make in registry.makers().items()}
    return all(_within_own(kind) and _within_own(makers.get(kind, kind)) for kind in kinds(config))


def kinds(value: Any) -> Iterator[type]:
    """The classes of a configuration and of all parts of it."""
    if dataclasses.is_dataclass(value):
        yield type(value)
        for field in dataclasses.fields(value):
            yield from kinds(getattr(value, field.name))
    elif isinstance(value, tuple | list):
        for one in value:
            yield from kinds(one)


def _within_own(thing: Any) -> bool:
    return getattr(thing, "__module__", "").partition(".")[0] in OWN


@cache
def _installed() -> str | None:
    """Python, the versions of all packages, and what every file of this project holds; None where a file is not the
    one that was imported, or cannot be read."""
    places = [place for name in OWN for place in _folders_of(name)]
    try:
        packages = sorted(_record(found) for place in sys.path for kind in RECORDS for found in Path(place).glob(kind))
        files = {path: path.relative_to(place.parent) for place in places for path in place.rglob("*") if _counts(path)}
        if any(path.stat().st_mtime > loaded.AT for path in files):
            return None
        content = sorted(f"{name} {_digest(path.read_bytes())}" for path, name in files.items())
    except OSError:  # such as an editor's file that comes and goes
        return None
    return "\n".join((sys.version, *packages, *content))


def _record(found: Path) -> str:
    """Name and version of a package. Names of folders tell them: to read what each of some hundred packages says of
    itself takes a part of a second."""
    return found.name if "-" in found.stem else f"{found.name} {_digest((found / 'PKG-INFO').read_bytes())}"


def _folders_of(package: str) -> list[Path]:
    spec = importlib.util.find_spec(package)
    return [Path(one) for one in (spec and spec.submodule_search_locations) or ()]


def _counts(path: Path) -> bool:
    return path.is_file() and path.parent.name != "__pycache__"


def _form(x: np.ndarray) -> str:
    return f"{x.dtype}{x.shape}"


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
