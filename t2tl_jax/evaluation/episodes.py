"""Complete episodes of a fixed policy: a fixed number of them, the first one of every environment."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from t2tl_jax.training.types import Agent, Params, repeated


class Environment(Protocol):
    """What evaluation needs of a task environment; unbatched, without time limit or automatic reset."""

    def reset(self, rng: jax.Array) -> Any:
        """First state of an episode."""
        ...

    def step(self, state: Any, action: jax.Array) -> Any:
        """Next state: its ``reward``, and ``done`` once the task is decided."""
        ...

    def verdict(self, state: Any) -> jax.Array:
        """+1 the task is carried out, -1 violated, 0 open."""
        ...

    def row(self, state: Any) -> jax.Array:
        """Row of the task table that is still to be done: ``int32``."""
        ...


@struct.dataclass
class Episodes:
    """Outcomes of E episodes of every evaluated policy, ``[..., E]``. Neither flag means: cut by the time limit."""

    success: jax.Array  # bool, the formula became true
    violation: jax.Array  # bool, the formula became false (or the physics failed)
    total_reward: jax.Array  # float32, undiscounted
    length: jax.Array  # int32, environment steps


def play(
    env: Environment,
    agent: Agent,
    params: Params,
    key: jax.Array,
    episodes: int,
    episode_length: int,
    deterministic: bool,
) -> Episodes:
    """Play ``episodes`` episodes side by side, each to its verdict or to ``episode_length`` steps.

    Works on one seed and is pure: jit it, and vmap it over seeds. Every environment plays one episode only, since
    counting all that end within some time would favour short ones.
    """
    embedding = agent.embed(params)  # once: the policy does not change
    reset_key, act_key = jax.random.split(key)
    state = jax.vmap(env.reset)(jax.random.split(reset_key, episodes))
    nothing = jnp.zeros(episodes, bool)
    start = Episodes(
        success=nothing,
        violation=nothing,
        total_reward=jnp.zeros(episodes, jnp.float32),
        length=jnp.zeros(episodes, jnp.int32),
    )

    def under_way(carry: tuple) -> jax.Array:
        _, _, outcome, step = carry
        return (step < episode_length) & ~(outcome.success | outcome.violation).all()

    def advance(carry: tuple) -> tuple:
        state, memory, outcome, step = carry
        alive = ~(outcome.success | outcome.violation)
        row = jax.vmap(env.row)(state)
        action = agent.act(params, embedding, memory, state.obs, row, jax.random.fold_in(act_key, step), deterministic)
        moved = jax.vmap(env.step)(state, action)
        memory = agent.remember(params, memory, state.obs, action, moved.reward)
        ended, verdict = alive & (moved.done > 0), jax.vmap(env.verdict)(moved)
        outcome = Episodes(
            success=outcome.success | (ended & (verdict > 0)),
            violation=outcome.violation | (ended & (verdict <= 0)),
            total_reward=outcome.total_reward + jnp.where(alive, moved.reward, 0.0),
            length=outcome.length + alive.astype(jnp.int32),
        )
        return moved, memory, outcome, step + 1

    first = (state, repeated(agent.begin(), episodes), start, jnp.int32(0))
    return jax.lax.while_loop(under_way, advance, first)[2]


def evaluate_seeds(
    of_seed: Callable[[jax.Array], tuple[Environment, Agent]],
    seeds: Sequence[int],
    params: Params,
    keys: jax.Array,
    episodes: int,
    episode_length: int,
    deterministic: bool,
) -> Episodes:
    """``play`` for every seed in one program, on the host: ``[seeds, episodes]``.

    Args:
        of_seed: environment and learner (of which ``embed``, ``begin``, ``act`` and ``remember`` are used) by the
            seed's number.
        seeds: the numbers, ``int[seeds]``.
        params: with leading axis [seeds].
        keys: ``key[seeds]``, of the evaluation stream.
        episodes: number of episodes per seed.
        episode_length: time limit in steps.
        deterministic: whether to take the mode of the policy instead of a sample.
    """

    def one_seed(seed: jax.Array, params: Params, key: jax.Array) -> Episodes:
        return play(*of_seed(seed), params, key, episodes, episode_length, deterministic)

    return jax.device_get(jax.jit(jax.vmap(one_seed))(np.asarray(seeds, np.uint32), params, keys))
