"""What a learner offers to the runner, to evaluation and to the plots: a few pure functions.

Every function works on one seed and holds no state, so the runner vmaps it over seeds (and jits it once).
"""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
from flax import struct

Params = Any  # the variables of a Flax module
PolicyMemory = Any  # a pytree: what a policy carries from step to step of an episode


@struct.dataclass
class EpisodeTotals:
    """Sums over the episodes that finished during one iteration; all scalars, so that they add up over iterations.

    `discounted_return` is the paper's "average discounted return" before averaging: undiscounted return of the episode
    times gamma^(length - 1). Lengths count environment steps.
    """

    episodes: jax.Array  # int32
    successes: jax.Array  # int32, formula became true
    violations: jax.Array  # int32, formula became false
    timeouts: jax.Array  # int32, cut by the time limit
    discounted_return: jax.Array  # float32
    length: jax.Array  # float32
    success_length: jax.Array  # float32, over successes only


@struct.dataclass
class Metrics:
    """What one iteration reports: finished episodes and named scalars (losses, entropy, gradient norm, ...)."""

    episodes: EpisodeTotals
    scalars: dict[str, jax.Array]


class TrainState(Protocol):
    """The part of a learner's state that the runner reads; the rest is the learner's own."""

    params: Params  # current parameters
    best_params: Params  # parameters with the highest `best_score` so far
    best_score: jax.Array  # float32 scalar, -inf before the first score


class Agent(NamedTuple):
    """A learner as pure functions of one seed.

    init(key) -> train_state
    iterate(train_state) -> (train_state, Metrics); advances training by `frames_per_iteration` environment steps
    embed(params) -> float32[rows, dim]: the task encoder's output for every row of the task table, computed once
    begin() -> memory of one environment: what the policy remembers of an episode, at its start; () for nothing
    act(params, embedding, memory, obs, row, key, deterministic) -> action; obs [..., O], row int32[...]
    remember(params, memory, obs, action, reward) -> memory after a step: `action` was taken on `obs`, `reward` [...]
        followed. When the episode ends, go on with `begin()`.
    renew(train_state, table) -> train_state that goes on with the tasks of another table of the same shapes; None for
    learners whose tasks are fixed. The state then has the current table as its attribute `table`.
    compare(params, memory, obs, task, other) -> (policy float32[B], value float32[B]): how much the policy changes and
        by how much the value rises at obs [B, O] when the code of the task is `other` instead of `task`, both [dim]. Of
        the policy, the KL divergence KL(task || other) in nats, or for action values 1 where the greedy action is
        another one, else 0. None for learners that do not offer it.

    The arrays of a memory have the leading axes of `obs`.
    """

    init: Callable[[jax.Array], Any]
    iterate: Callable[[Any], tuple[Any, Metrics]]
    embed: Callable[[Params], jax.Array]
    act: Callable[[Params, jax.Array, PolicyMemory, jax.Array, jax.Array, jax.Array, bool], jax.Array]
    frames_per_iteration: int
    renew: Callable[[Any, Any], Any] | None = None
    begin: Callable[[], PolicyMemory] = lambda: ()
    remember: Callable[[Params, PolicyMemory, jax.Array, jax.Array, jax.Array], PolicyMemory] = (
        lambda params, memory, obs, action, reward: memory
    )
    compare: Callable[[Params, PolicyMemory, jax.Array, jax.Array, jax.Array], tuple[jax.Array, jax.Array]] | None = (
        None
    )


def repeated(memory: PolicyMemory, size: int) -> PolicyMemory:
    """The same memory for each of `size` environments, leading axis [size]."""
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (size, *x.shape)), memory)
