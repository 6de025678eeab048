"""A learner of one seed made into the one compiled program that trains all seeds of a run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from t2tl_jax.training.seeds import TRAINING, seed_sharding, stream_keys
from t2tl_jax.training.types import Agent


@dataclass(frozen=True)
class Program:
    """A training program, traced but not compiled. Every array in a state has a leading axis [seeds]."""

    keys: jax.Array
    """``key[seeds]``: the training stream of each seed."""
    state: Any
    """Shapes and dtypes of the training state, as a tree of ``jax.ShapeDtypeStruct``."""
    sharding: NamedSharding | None
    """Placement of the seeds; None on a single device."""
    lowered_init: Any
    """``keys -> state``, ready to compile."""
    lowered_iterate: Any
    """``state -> (state, Metrics)``, ready to compile; the given state's memory is reused for the result."""
    lowered_renew: Any = None
    """``(state, table) -> state``, ready to compile: all seeds go on with one new table. None where tasks are fixed."""


def trace(agent: Agent | Callable[[jax.Array], Agent], seeds: Sequence[int]) -> Program:
    """Vmap a learner over seeds and trace it, which finds most mistakes before anything is compiled or written.

    A single seed gets a leading axis as well, so that there is one kind of program.

    Args:
        agent: the learner, or the learner of each seed as a function of its number (``uint32`` scalar, traced).
        seeds: their numbers.

    Raises:
        TypeError: if ``agent.iterate`` returns a state of other shapes or dtypes than it was given.
    """
    sharding = seed_sharding(len(seeds))
    placement: dict[str, Any] = {} if sharding is None else {"in_shardings": sharding, "out_shardings": sharding}
    keys = stream_keys(seeds, TRAINING)
    if sharding is not None:
        keys = jax.device_put(keys, sharding)
    numbers = np.asarray(seeds, np.uint32)

    def of_seed(seed: jax.Array) -> Agent:
        return agent if isinstance(agent, Agent) else agent(seed)

    def init_all(keys: jax.Array) -> Any:
        return jax.vmap(lambda seed, key: _strongly_typed(of_seed(seed).init(key)))(numbers, keys)

    def iterate_all(states: Any) -> Any:
        return jax.vmap(lambda seed, state: of_seed(seed).iterate(state))(numbers, states)

    init = jax.jit(init_all, **placement)
    iterate = jax.jit(iterate_all, donate_argnums=0, **placement)
    state = _shapes(jax.eval_shape(init, keys))
    lowered = iterate.lower(state)
    _require_same(state, _shapes(lowered.out_info[0]))
    return Program(keys, state, sharding, init.lower(keys), lowered, _lower_renew(of_seed, numbers, state, sharding))


def _lower_renew(
    of_seed: Callable[[jax.Array], Agent], numbers: np.ndarray, state: Any, sharding: NamedSharding | None
) -> Any:
    tables = getattr(state, "table", None)
    if tables is None:
        return None

    def renew_all(states: Any, table: Any) -> Any:
        def one(seed: jax.Array, state: Any) -> Any:
            renew = of_seed(seed).renew
            assert renew is not None, "a state with a table comes with a way to renew it"
            return renew(state, table)

        return jax.vmap(one)(jax.numpy.asarray(numbers), states)

    placement: dict[str, Any] = {}
    if sharding is not None:
        everywhere = NamedSharding(sharding.mesh, PartitionSpec())
        placement = {"in_shardings": (sharding, everywhere), "out_shardings": sharding}
    table = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), tables)
    lowered = jax.jit(renew_all, donate_argnums=0, **placement).lower(state, table)
    _require_same(state, _shapes(lowered.out_info))
    return lowered


def _strongly_typed(tree: Any) -> Any:
    """Fix the dtype of values that Python numbers left open: they would change type after one iteration."""
    return jax.tree.map(lambda x: jax.lax.convert_element_type(x, jax.numpy.asarray(x).dtype), tree)


def _shapes(tree: Any) -> Any:
    return jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), tree)


def _require_same(before: Any, after: Any) -> None:
    old, new = jax.tree_util.tree_leaves_with_path(before), jax.tree_util.tree_leaves_with_path(after)
    if [path for path, _ in old] != [path for path, _ in new]:
        raise TypeError("iterate returned a training state of another structure than it was given")
    for (path, a), (_, b) in zip(old, new, strict=True):
        if a.shape != b.shape or a.dtype != b.dtype:
            raise TypeError(
                f"iterate changed train_state{jax.tree_util.keystr(path)} from {a.dtype}{list(a.shape)}"
                f" to {b.dtype}{list(b.shape)} (first axis: seeds)"
            )
