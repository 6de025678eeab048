"""A learner of one seed made into the one compiled program that trains all seeds of a run."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from t2tl_jax.env import EnvParams, Purpose
from t2tl_jax.garbage import garbage_kept
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training import kept_trace
from t2tl_jax.training.compiler_options import compiler_options
from t2tl_jax.training.devices import SEEDS, fetched, padded, put
from t2tl_jax.training.seeds import TRAINING, stream_keys
from t2tl_jax.training.types import Agent

OVER_SEEDS = TaskParams(env=0, table=None, numbers=0, fault=0)  # type: ignore[arg-type]
"""Axes of the parameters that all seeds are given: what the environment varies is stacked, as are numbers and
faults, and the table is the same."""


@dataclass(frozen=True)
class Later:
    """A function that is lowered when it is compiled, which may be beside other work."""

    lower: Callable[[], Any]
    """Lowers it."""

    def compile(self) -> Any:
        """It, compiled."""
        return self.lower().compile()

    def as_text(self) -> str:
        """What there is to compile."""
        return self.lower().as_text()


@dataclass(frozen=True)
class Program:
    """A training program, traced but not compiled. Every array in a state has a leading axis [seeds]."""

    count: int
    """How many seeds there are; leading axes on the devices may be filled up beyond that, see `training/devices.py`."""
    keys: jax.Array
    """``key[seeds]``: the training stream of each seed."""
    env_params: TaskParams
    """What was given to `trace`, on its devices."""
    state: Any
    """Shapes and dtypes of the training state on the devices, as a tree of ``jax.ShapeDtypeStruct``."""
    sharding: NamedSharding | None
    """Placement of the seeds, and the mesh of all devices; None on a single device."""
    lowered_init: Later
    """``(keys, env_params) -> state``, ready to compile."""
    lowered_iterate: Any
    """``(state, env_params) -> (state, Metrics)``, ready to compile; the given state's memory is reused."""
    lowered_restart: Any = None
    """``(state, env_params) -> state``, ready to compile: all seeds go on with the tasks of another table of the same
    shapes; the given state's memory is reused. None unless asked for."""

    @property
    def stored(self) -> Any:
        """Shapes and dtypes of the training state of the seeds themselves, as it lies on the host and on disk."""
        return jax.tree.map(lambda x: jax.ShapeDtypeStruct((self.count, *x.shape[1:]), x.dtype), self.state)

    def unpadded(self, tree: Any) -> Any:
        """What came from the devices, on the host and of the seeds themselves."""
        return jax.tree.map(lambda x: x[: self.count], fetched(tree))


def params_of_seeds(
    env: TaskEnv,
    seeds: Sequence[int],
    purpose: Purpose = "training",
    numbers: Sequence[Mapping[str, float]] | None = None,
) -> TaskParams:
    """The environment's parameters of every seed with a leading axis [seeds], and one table; see `TaskEnv.make_params`.

    Args:
        env: with the tasks.
        seeds: their numbers, of which some may come more than once.
        purpose: what the parameters are for.
        numbers: those of every seed, by the same names; None where the learner keeps to those of its configuration.

    Raises:
        ValueError: for a seed that the environment has nothing for.
    """
    given = jax.tree.map(lambda *x: np.array(x, np.float32), *(dict(of) for of in numbers)) if numbers else {}
    worlds = of_each_seed(lambda seed: env.make_params(seed, purpose).env, seeds)
    return TaskParams(env=worlds, table=env.table, numbers=given)


def of_each_seed(make: Callable[[int], EnvParams], seeds: Sequence[int]) -> EnvParams:
    """What `make` gives for every seed, stacked with a leading axis [seeds]; made once for seeds that come again."""
    own = {seed: make(seed) for seed in dict.fromkeys(seeds)}
    return jax.tree.map(lambda *x: np.stack(x), *(own[seed] for seed in seeds))


def place_params(env_params: TaskParams, sharding: NamedSharding | None) -> TaskParams:
    """Parameters of all seeds on their devices, which every device shares the table of."""
    table = None if sharding is None else NamedSharding(sharding.mesh, PartitionSpec())
    return env_params.replace(  # type: ignore[attr-defined]
        env=put(padded(env_params.env, sharding), sharding),
        numbers=put(padded(env_params.numbers, sharding), sharding),
        fault=put(padded(env_params.fault, sharding), sharding),
        table=put(env_params.table, table),
    )


@garbage_kept()
def trace(
    agent: Agent,
    seeds: Sequence[int],
    env_params: TaskParams,
    restartable: bool = False,
    sharding: NamedSharding | None = None,
    kept: Path | None = None,
) -> Program:
    """Vmap a learner over seeds and trace it, which finds most mistakes before anything is compiled or written.

    A single seed gets a leading axis as well, so that there is one kind of program.

    Args:
        agent: the learner.
        seeds: their numbers.
        env_params: of `params_of_seeds`.
        restartable: whether the tasks are to change during training.
        sharding: placement of the seeds, of `seed_sharding`; None for a single device.
        kept: file that holds `iterate` as it was traced before, or is to, with `init` beside it; None for neither.

    Raises:
        TypeError: if ``agent.iterate`` returns a state of other shapes or dtypes than it was given.
        ValueError: if the tasks of this learner cannot change.
    """
    if restartable and agent.restart is None:
        raise ValueError("this learner cannot go on with other tasks: it remembers steps of the former ones")
    tasks = _placement(sharding)
    keys = put(padded(stream_keys(seeds, TRAINING), sharding), sharding)
    env_params = place_params(env_params, sharding)

    axes = (0, OVER_SEEDS)
    placed: dict[str, Any] = {}
    if sharding is not None:
        placed = {"in_shardings": (sharding, tasks), "out_shardings": sharding}

    def of_seeds(function: Any) -> Any:
        return jax.vmap(function, in_axes=axes, spmd_axis_name=None if sharding is None else SEEDS)

    def lowered(function: Any, *arguments: Any) -> Any:
        program = jax.jit(of_seeds(function), donate_argnums=0, compiler_options=compiler_options(), **placed)
        return program.lower(*arguments)

    def meshed() -> Any:
        return nullcontext() if sharding is None else jax.set_mesh(sharding.mesh)  # type: ignore[arg-type]

    def beginning() -> tuple[Any, Callable[[], Any]]:
        """Shapes and dtypes of the state, and what lowers `init`."""
        init = jax.jit(of_seeds(lambda key, env_params: _strongly_typed(agent.init(key, env_params))), **placed)
        if kept is not None:
            found = kept_trace.beginning(kept.with_stem(f"{kept.stem}_init"), init, keys, env_params, **placed)
            if found is not None:
                return found
        traced = init.trace(keys, env_params)
        return _shapes(traced.out_info), traced.lower

    def lowered_init() -> Any:
        with meshed():
            return lower_init()

    with meshed():
        state, lower_init = beginning()
        lowered_iterate = None
        if kept is not None:
            lowered_iterate = kept_trace.iteration(kept, of_seeds(agent.iterate), state, env_params, **placed)
        if lowered_iterate is None:
            lowered_iterate = lowered(agent.iterate, state, env_params)
        _require_same("iterate", state, _shapes(lowered_iterate.out_info[0]))
        lowered_restart = None
        if restartable:
            lowered_restart = lowered(agent.restart, state, env_params)
            _require_same("restart", state, _shapes(lowered_restart.out_info))
    return Program(
        count=len(seeds),
        keys=keys,
        env_params=env_params,
        state=state,
        sharding=sharding,
        lowered_init=Later(lowered_init),
        lowered_iterate=lowered_iterate,
        lowered_restart=lowered_restart,
    )


def _placement(sharding: NamedSharding | None) -> Any:
    """Where the parameters of all seeds lie: what is stacked with their seeds, the table on every device."""
    if sharding is None:
        return None
    table = NamedSharding(sharding.mesh, PartitionSpec())
    return TaskParams(env=sharding, table=table, numbers=sharding, fault=sharding)  # type: ignore[arg-type]


def _strongly_typed(tree: Any) -> Any:
    """Fix the dtype of values that Python numbers left open: they would change type after one iteration."""
    return jax.tree.map(lambda x: jax.lax.convert_element_type(x, jax.numpy.asarray(x).dtype), tree)


def _shapes(tree: Any) -> Any:
    return jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), tree)


def _require_same(function: str, before: Any, after: Any) -> None:
    old, new = jax.tree_util.tree_leaves_with_path(before), jax.tree_util.tree_leaves_with_path(after)
    if [path for path, _ in old] != [path for path, _ in new]:
        raise TypeError(f"{function} returned a training state of another structure than it was given")
    for (path, a), (_, b) in zip(old, new, strict=True):
        if a.shape != b.shape or a.dtype != b.dtype:
            raise TypeError(
                f"{function} changed train_state{jax.tree_util.keystr(path)} from {a.dtype}{list(a.shape)}"
                f" to {b.dtype}{list(b.shape)} (first axis: seeds)"
            )
