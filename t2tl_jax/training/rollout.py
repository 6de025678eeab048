"""Rollouts of many environments in one scan, and generalised advantage estimation."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from t2tl_jax.agent import EpisodeTotals
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.episodes import Episode, Outcome, advance


@struct.dataclass
class Transitions:
    """A rollout of T steps in N environments; every array leads with [T, N], those of the memory excepted."""

    obs: jax.Array  # float32[T, N, O]
    row: jax.Array  # int32[T, N]
    action: jax.Array  # [T, N, A]
    log_prob: jax.Array  # float32[T, N], of the action under the policy that took it
    reward: jax.Array  # float32[T, N]
    terminated: jax.Array  # bool[T, N]
    truncated: jax.Array  # bool[T, N]
    next_obs: jax.Array  # float32[T, N, O], of s' before any reset
    next_row: jax.Array  # int32[T, N]
    memory: Any  # what the policy remembered at the first step of every segment, leading axes [T / segment, N]


# (memory, obs [N, O], row [N], key) -> (memory, action [N, A], log_prob [N]); the memory is whatever the policy needs
# to remember from step to step, such as the last exploration noise.
Memory = Any
Policy = Callable[[Memory, jax.Array, jax.Array, jax.Array], tuple[Memory, jax.Array, jax.Array]]
# (memory, obs, action, outcome of the step) -> memory to go on with, in the next episode where this one has ended.
Remember = Callable[[Memory, jax.Array, jax.Array, Outcome], Memory]


def rollout(
    env: TaskEnv,
    policy: Policy,
    memory: Memory,
    episodes: Episode,
    key: jax.Array,
    steps: int,
    limit: int,
    discount: float,
    remember: Remember = lambda memory, obs, action, outcome: memory,
    segment: int = 1,
) -> tuple[Memory, Episode, Transitions, EpisodeTotals]:
    """Act for `steps` steps in the N environments of `episodes`; returns the totals of all episodes that ended.

    The memory, which may be large, is kept at every `segment`-th step only.
    """
    num_envs = episodes.elapsed.shape[0]

    def step(carry: tuple[Memory, Episode], key: jax.Array):
        memory, episodes = carry
        act_key, reset_key = jax.random.split(key)
        obs, row = episodes.state.obs, episodes.state.pipeline_state.row
        memory, action, log_prob = policy(memory, obs, row, act_key)
        reset_keys = jax.random.split(reset_key, num_envs)
        episodes, outcome = jax.vmap(advance, (None, 0, 0, 0, None, None))(
            env, episodes, action, reset_keys, limit, discount
        )
        transition = Transitions(
            obs=obs,
            row=row,
            action=action,
            log_prob=log_prob,
            reward=outcome.reward,
            terminated=outcome.terminated,
            truncated=outcome.truncated,
            next_obs=outcome.next_obs,
            next_row=outcome.next_row,
            memory=(),
        )
        memory = remember(memory, obs, action, outcome)
        return (memory, episodes), (transition, outcome.totals)

    def steps_of_segment(carry: tuple[Memory, Episode], keys: jax.Array):
        known, _ = carry
        carry, (transitions, totals) = jax.lax.scan(step, carry, keys)
        return carry, (known, transitions, totals)

    keys = jax.random.split(key, steps).reshape(steps // segment, segment)
    (memory, episodes), (known, transitions, totals) = jax.lax.scan(steps_of_segment, (memory, episodes), keys)
    transitions = jax.tree.map(lambda x: x.reshape(steps, *x.shape[2:]), transitions)
    return memory, episodes, replace(transitions, memory=known), jax.tree.map(jnp.sum, totals)


def generalised_advantages(
    reward: jax.Array,
    value: jax.Array,
    next_value: jax.Array,
    terminated: jax.Array,
    truncated: jax.Array,
    discount: float,
    gae_lambda: float,
) -> jax.Array:
    """GAE (Schulman et al., 2016) over the leading time axis; all inputs and the result are [T, ...].

    `next_value` is the value of s' before any reset. Termination zeroes it; truncation keeps it (bootstrapping) but,
    like termination, ends the sum over later advantages, which belong to another episode.
    """
    delta = reward + discount * jnp.where(terminated, 0.0, next_value) - value
    carry_on = jnp.where(terminated | truncated, 0.0, discount * gae_lambda)

    def back(advantage: jax.Array, inputs: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        delta, carry_on = inputs
        advantage = delta + carry_on * advantage
        return advantage, advantage

    return jax.lax.scan(back, jnp.zeros_like(delta[0]), (delta, carry_on), reverse=True)[1]
