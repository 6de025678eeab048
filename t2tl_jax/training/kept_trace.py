"""A traced training on disk: to read it takes a later start a fraction of the time that tracing takes.

How a run begins and its iteration are a file each (`trace_file.py`). They hold functions of arrays alone; beside them
stands what the trees that they give are made of. What has to be the same for a file to be the right one is not known
here but put into its name, see `runs/kept_traces.py`.
"""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax
from jax import export

from t2tl_jax.training import trace_file, tree_names
from t2tl_jax.training.compiler_options import compiler_options
from t2tl_jax.training.types import EpisodeTotals, Metrics, TaskTotals

SOON = 1.0
"""Seconds of tracing from which on it is kept, as JAX keeps what it compiles for as long."""

KEY = "key"
"""Stands for an array of keys where a state is described."""

CALLS = frozenset(
    ("qr", "geqrf", "householder_product", "cholesky", "lu", "svd", "eig", "eigh", "triangular_solve", "ffi_call")
)
"""Operations that call functions of the process, for which `trace_file.write` would write nothing: to find that out
takes longer."""

Known = tuple[export.Exported, Metrics]
"""An iteration, and metrics with anything in the place of their arrays."""


def beginning(file: Path, init: Any, keys: Any, env_params: Any, **placed: Any) -> tuple[Any, Callable[[], Any]] | None:
    """Shapes and dtypes of ``init(keys, env_params) -> state``, and a function that lowers it: from a file, which is
    written if it is missing or damaged. None for what no file can hold.

    Args:
        file: where it is kept.
        init: of all seeds, jitted.
        keys, env_params: arrays, or shapes and dtypes.
        **placed: ``in_shardings`` and ``out_shardings``, where there are several devices.
    """
    if not _has_usual_keys((keys, env_params)):
        return None
    known = _read_init(file) or _traced_init(file, init, keys, env_params, placed)
    if known is None:
        return None
    exported, state = known

    def call(keys: Any, env_params: Any) -> Any:
        return _tree(exported.call(_flat(keys), _flat(env_params)), state)

    return state, lambda: jax.jit(call, **placed).lower(keys, env_params)


def _traced_init(
    file: Path, init: Any, keys: Any, env_params: Any, placed: dict[str, Any]
) -> tuple[export.Exported, Any] | None:
    """How a run begins, which is also written to the file if that saves some time; None if it cannot be. It is all done
    here, since settings of JAX may hold for this thread alone."""
    begin = time.monotonic()
    traced = init.trace(keys, env_params)
    state = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), traced.out_info)
    about = tree_names.described(state, lambda x: KEY if _is_key(x) else tree_names.LEAF)
    if about is None or not _has_usual_keys(state) or not CALLS.isdisjoint(_operations(traced.jaxpr.jaxpr)):
        return None

    def flat(key_arrays: list[jax.Array], params_arrays: list[jax.Array]) -> list[jax.Array]:
        return _flat(init(_tree(key_arrays, keys), _tree(params_arrays, env_params)))  # which was traced above

    arrays = [jax.eval_shape(_flat, tree) for tree in (keys, env_params)]
    try:
        exported = export.export(jax.jit(flat, **_flat_placed(placed, env_params)))(*arrays)
    except (ValueError, NotImplementedError):
        return None
    if time.monotonic() - begin >= SOON:
        trace_file.write(file, exported, {"state": about})
    return exported, state


def iteration(file: Path, iterate: Callable[..., Any], state: Any, env_params: Any, **placed: Any) -> Any:
    """``iterate(state, env_params) -> (state, Metrics)``, ready to compile: from a file, which is written if it is
    missing or damaged. The given state's memory is reused. None for what no file can hold.

    Args:
        file: where it is kept.
        iterate: of all seeds.
        state, env_params: arrays, or shapes and dtypes.
        **placed: ``in_shardings`` and ``out_shardings``, where there are several devices.
    """
    if not _has_usual_keys((state, env_params)):
        return None
    known = _read_iterate(file) or _traced(file, iterate, state, env_params, placed)
    if known is None:
        return None
    exported, metrics = known

    def call(state: Any, env_params: Any) -> Any:
        return _tree(exported.call(_flat(state), _flat(env_params)), (state, metrics))

    program = jax.jit(call, donate_argnums=0, compiler_options=compiler_options(), **placed)
    return program.lower(state, env_params)


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

    arrays = [jax.eval_shape(_flat, tree) for tree in (state, env_params)]
    try:
        exported = export.export(jax.jit(flat, **_flat_placed(placed, env_params)))(*arrays)
    except (ValueError, NotImplementedError):  # of tracing itself too, which then says so without this
        return None
    metrics = jax.tree.unflatten(structures[0], exported.out_avals)[1]
    like = _metrics(sorted(metrics.scalars), metrics.tasks is not None)
    after = zip(arrays[0], exported.out_avals, strict=False)
    same = all((x.shape, x.dtype) == (y.shape, y.dtype) for x, y in after)
    if not same or structures[0] != jax.tree.structure((state, like)):
        return None  # a state that changes its form, which whoever traces it tells
    if time.monotonic() - begin >= SOON:
        trace_file.write(file, exported, {"scalars": sorted(like.scalars), "tasks": like.tasks is not None})
    return exported, like


def _flat_placed(placed: dict[str, Any], env_params: Any) -> dict[str, Any]:
    """The same placement for a function of lists of arrays."""
    if not placed:
        return {}
    whole, of_params = placed["in_shardings"]
    return placed | {"in_shardings": (whole, jax.tree.leaves(jax.tree.broadcast(of_params, env_params)))}


def _operations(jaxpr: Any) -> Iterator[str]:
    """Names of all operations of a traced function, and of those that are inside of others."""
    for equation in jaxpr.eqns:
        yield equation.primitive.name
        for value in jax.tree.leaves(equation.params, is_leaf=lambda x: hasattr(x, "jaxpr") or hasattr(x, "eqns")):
            inner = getattr(value, "jaxpr", value)
            if hasattr(inner, "eqns"):
                yield from _operations(inner)


def _metrics(scalars: list[str], tasks: bool) -> Metrics:
    """Metrics with numbers in the place of arrays."""
    totals = EpisodeTotals(**dict.fromkeys(EpisodeTotals.__dataclass_fields__, 0))  # type: ignore[arg-type]
    return Metrics(totals, dict.fromkeys(scalars, 0), TaskTotals(0, 0) if tasks else None)  # type: ignore[arg-type]


def _read_iterate(file: Path) -> Known | None:
    """The iteration that the file holds; None if it is not there or not whole."""
    try:
        exported, about = trace_file.read(file)
        return exported, _metrics(about["scalars"], about["tasks"])
    except trace_file.NOT_WHOLE:
        return None


def _read_init(file: Path) -> tuple[export.Exported, Any] | None:
    """How a run begins, and the shapes and dtypes of its state; None if the file is not there or not whole."""
    try:
        exported, about = trace_file.read(file)
        kinds, structure = jax.tree.flatten(tree_names.like(about["state"], str))
        arrays = zip(kinds, exported.out_avals, strict=True)
        return exported, jax.tree.unflatten(structure, [_shape(x, kind == KEY) for kind, x in arrays])
    except trace_file.NOT_WHOLE:
        return None


def _shape(numbers: Any, of_keys: bool) -> jax.ShapeDtypeStruct:
    """Of an array, or of the keys that are made of its numbers."""
    if not of_keys:
        return jax.ShapeDtypeStruct(numbers.shape, numbers.dtype)
    return jax.eval_shape(jax.random.wrap_key_data, jax.ShapeDtypeStruct(numbers.shape, numbers.dtype))


def _has_usual_keys(tree: Any) -> bool:
    """Whether all keys are of JAX's usual kind."""
    return all(x.dtype == jax.random.key(0).dtype for x in jax.tree.leaves(tree) if _is_key(x))


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
