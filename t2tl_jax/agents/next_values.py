"""The values of the states that steps led to, V(s').

Where an episode goes on, s' is the s of the next step, whose value is computed in any case. After a termination it
counts nothing. What is left is computed by itself: the last step of a rollout, and time-outs, whose s' is seen by
nobody, since a new episode begins in its place.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from t2tl_jax.agents.ppo_config import PPOConfig


def last_steps(truncated: jax.Array, episode_length: int) -> jax.Array:
    """At which steps V(s') has to be computed: int32[K, N], in ascending order, a step more than once where there are
    fewer.

    Args:
        truncated: bool[T, N], cut by the time limit.
        episode_length: the limit. Two time-outs of an environment are at least so many steps apart, so that no rollout
            holds more of them than K - 1 = 1 + (T - 2) // limit before its last step.
    """
    length = len(truncated)
    most = 1 + (length - 2) // episode_length if length > 1 else 0

    def before_the_last(truncated: jax.Array) -> jax.Array:
        return jnp.nonzero(truncated[:-1], size=most, fill_value=length - 1)[0]

    before = _of_each_env(before_the_last)(truncated)
    return jnp.concatenate([before, jnp.full_like(before, length - 1, shape=(1, truncated.shape[1]))]).astype(jnp.int32)


def at_steps(x: Any, steps: jax.Array) -> Any:
    """Of a tree with leading axes [T, N] what is at the steps int32[K, N]: [K, N, ...]."""
    return jax.tree.map(lambda x: _of_each_env(lambda x, steps: x[steps])(x, steps), x)


def segment_and_place(config: PPOConfig, steps: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Which segments, in the order of `in_segments`, hold the steps int32[K, N]; and where in them, int32[K, N].

    The segments are int32[K x N].
    """
    segment, place = jnp.divmod(steps, config.segment_length)
    return (segment * config.num_envs + jnp.arange(config.num_envs)).reshape(-1), place


def values_of_next(value: jax.Array, after: jax.Array, steps: jax.Array) -> jax.Array:
    """V(s') of every step that did not terminate, float32[T, N], from V(s) [T, N] and V(s') at `steps`, both [K, N]."""
    following = jnp.concatenate([value[1:], value[-1:]])
    return _of_each_env(lambda following, steps, after: following.at[steps].set(after))(following, steps, after)


def _of_each_env(function: Callable[..., jax.Array]) -> Callable[..., jax.Array]:
    """Batched over axis 1, the environments, which may be spread over devices."""
    return jax.vmap(function, in_axes=1, out_axes=1)
