"""A traced iteration on disk: to read it takes a later start a fraction of the time that tracing takes.

A file holds `iterate` as `jax.export` writes it, behind a line of JSON with the names of its metrics and a hash of
both. What has to be the same for a file to be the right one is not known here but put into its name, see
`runs/kept_traces.py`. Files are programs, like those of JAX's own cache: they are only ever read from a folder of the
user's.
"""

import hashlib
import json
import os
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import jax
from jax import export

from t2tl_jax.training.types import EpisodeTotals, Metrics, TaskTotals

SUFFIX = ".t2tl_trace"
"""Of the files."""
MOST_FILES = 100
"""So many files are kept in a folder; the ones that were not used for longest go first."""
SOON = 1.0
"""Seconds of tracing from which on it is kept, as JAX keeps what it compiles for as long."""

Known = tuple[export.Exported, Metrics]
"""An iteration, and metrics with anything in the place of their arrays."""


def lowered(file: Path, iterate: Callable[..., Any], state: Any, env_params: Any, **placed: Any) -> Any:
    """``iterate(state, env_params) -> (state, Metrics)``, ready to compile: from a file, which is written if it is
    missing or damaged. The given state's memory is reused. None for what no file can hold.

    Args:
        file: where it is kept.
        iterate: of all seeds.
        state, env_params: arrays, or shapes and dtypes.
        **placed: ``in_shardings`` and ``out_shardings``, where there are several devices.
    """
    if not all(x.dtype == jax.random.key(0).dtype for x in jax.tree.leaves((state, env_params)) if _is_key(x)):
        return None
    known = _read(file) or _traced(file, iterate, state, env_params, placed)
    if known is None:
        return None
    exported, metrics = known

    def call(state: Any, env_params: Any) -> Any:
        return _tree(exported.call(_flat(state), _flat(env_params)), (state, metrics))

    return jax.jit(call, donate_argnums=0, **placed).lower(state, env_params)


def _traced(
    file: Path, iterate: Callable[..., Any], state: Any, env_params: Any, placed: dict[str, Any]
) -> Known | None:
    """The iteration, which is also written to the file if that saves some time; None if it cannot be."""
    begin = time.monotonic()
    structures: list[Any] = []

    def flat(state_arrays: list[jax.Array], params_arrays: list[jax.Array]) -> list[jax.Array]:
        found = iterate(_tree(state_arrays, state), _tree(params_arrays, env_params))
        structures[:] = [jax.tree.structure(found)]
        return _flat(found)

    if placed:
        whole, of_params = placed["in_shardings"]
        placed = placed | {"in_shardings": (whole, jax.tree.leaves(jax.tree.broadcast(of_params, env_params)))}
    arrays = [jax.eval_shape(_flat, tree) for tree in (state, env_params)]
    try:
        exported = export.export(jax.jit(flat, **placed))(*arrays)
    except (ValueError, NotImplementedError):  # of tracing itself too, which then says so without this
        return None
    metrics = jax.tree.unflatten(structures[0], exported.out_avals)[1]
    like = _metrics(sorted(metrics.scalars), metrics.tasks is not None)
    after = zip(arrays[0], exported.out_avals, strict=False)
    same = all((x.shape, x.dtype) == (y.shape, y.dtype) for x, y in after)
    if not same or structures[0] != jax.tree.structure((state, like)):
        return None  # a state that changes its form, which whoever traces it tells
    if time.monotonic() - begin >= SOON:
        _write(file, exported, like)
    return exported, like


def _metrics(scalars: list[str], tasks: bool) -> Metrics:
    """Metrics with numbers in the place of arrays."""
    totals = EpisodeTotals(**dict.fromkeys(EpisodeTotals.__dataclass_fields__, 0))  # type: ignore[arg-type]
    return Metrics(totals, dict.fromkeys(scalars, 0), TaskTotals(0, 0) if tasks else None)  # type: ignore[arg-type]


def _write(file: Path, exported: export.Exported, metrics: Metrics) -> None:
    """Write the file, whole or not at all; a disk that does not take it is no reason to stop."""
    names = {"scalars": sorted(metrics.scalars), "tasks": metrics.tasks is not None}
    new = None
    try:
        body = bytes(exported.serialize())
        about = json.dumps(names | {"sha256": _hash(names, body)}).encode()
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".tmp", delete=False) as new:
            new.write(about + b"\n" + body)
        os.replace(new.name, file)
        for old in sorted(file.parent.glob(f"*{SUFFIX}"), key=lambda one: one.stat().st_mtime)[:-MOST_FILES]:
            old.unlink(missing_ok=True)
    except (OSError, ImportError):  # the second without flatbuffers
        if new is not None:
            Path(new.name).unlink(missing_ok=True)


def _hash(names: dict[str, Any], body: bytes) -> str:
    return hashlib.sha256(json.dumps(names, sort_keys=True).encode() + body).hexdigest()


def _read(file: Path) -> Known | None:
    """What the file holds; None if it is not there or not whole."""
    try:
        about, _, body = file.read_bytes().partition(b"\n")
        names = json.loads(about)
        if names.pop("sha256") != _hash(names, body):
            return None
        found = export.deserialize(bytearray(body)), _metrics(names["scalars"], names["tasks"])
    except (OSError, ImportError, ValueError, KeyError, TypeError, AttributeError):
        return None
    with suppress(OSError):  # a folder that is only read
        os.utime(file)
    return found


def _is_key(x: Any) -> bool:
    return jax.dtypes.issubdtype(getattr(x, "dtype", None), jax.dtypes.prng_key)


def _flat(tree: Any) -> list[jax.Array]:
    """The arrays of a tree one by one, keys as the numbers that they are made of."""
    return [jax.random.key_data(x) if _is_key(x) else x for x in jax.tree.leaves(tree)]


def _tree(arrays: list[jax.Array], like: Any) -> Any:
    """The tree of which these are the arrays, with keys where `like` has some."""
    leaves, structure = jax.tree.flatten(like)
    own = [jax.random.wrap_key_data(x) if _is_key(of) else x for x, of in zip(arrays, leaves, strict=True)]
    return jax.tree.unflatten(structure, own)
