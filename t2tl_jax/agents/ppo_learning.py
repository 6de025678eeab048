"""What PPO learns from a minibatch: the clipped surrogate; and how the samples of a rollout lie in segments."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.networks.actor_critic import ActorCritic
from t2tl_jax.networks.windows import Segment
from t2tl_jax.training.devices import over_envs
from t2tl_jax.training.types import Params


@struct.dataclass
class Batch:
    """Samples of a rollout in segments of S successive steps, [B / S, S]; S is 1 without context."""

    obs: jax.Array
    row: jax.Array
    action: jax.Array
    log_prob: jax.Array
    value: jax.Array
    advantage: jax.Array
    carry: Segment | tuple[()] = ()  # the windows, or states, that acted


def ppo_loss(
    config: PPOConfig, network: ActorCritic, params: Params, task: jax.Array, batch: Batch
) -> tuple[jax.Array, dict[str, jax.Array]]:
    """Clipped surrogate, clipped value loss and entropy; `task` is the encoded formula of every sample, [..., dim]."""
    apply: Callable[..., Any] = network.apply  # Flax declares more results than this call can have
    distribution, value = apply(params, batch.obs, task, batch.carry)
    ratio = jnp.exp(distribution.log_prob(batch.action) - batch.log_prob)
    advantage = batch.advantage
    if config.normalise_advantage:
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    clipped_ratio = jnp.clip(ratio, 1 - config.clip_eps, 1 + config.clip_eps)
    policy_loss = -jnp.minimum(ratio * advantage, clipped_ratio * advantage).mean()

    target = batch.value + batch.advantage
    value_error = jnp.square(value - target)
    if config.clip_value:
        clipped_value = batch.value + jnp.clip(value - batch.value, -config.clip_eps, config.clip_eps)
        value_error = jnp.maximum(value_error, jnp.square(clipped_value - target))
    value_loss = value_error.mean()

    entropy = distribution.entropy().mean()  # over samples and action dimensions
    loss = policy_loss - config.entropy_coefficient * entropy + config.value_coefficient * value_loss
    return loss, {
        "policy_loss": policy_loss,
        "value_loss": value_loss,
        "entropy": entropy,
        "value": value.mean(),
        "clip_fraction": (jnp.abs(ratio - 1) > config.clip_eps).mean(),
        "kl": (ratio - 1 - jnp.log(ratio)).mean(),
    }


def minibatch_order(config: PPOConfig, key: jax.Array) -> jax.Array:
    """Which segments each minibatch of an epoch is made of, in the order of `in_segments`: int32[minibatches, k]."""
    segments, minibatches = config.batch_size // config.segment_length, config.num_minibatches
    if config.minibatches_of == "steps":
        return jax.random.permutation(key, segments).reshape(minibatches, -1)
    envs = jax.random.permutation(key, config.num_envs).reshape(minibatches, 1, -1)
    starts = jnp.arange(0, segments, config.num_envs)
    return (starts[:, None] + envs).reshape(minibatches, -1)


def in_segments(config: PPOConfig, x: jax.Array) -> jax.Array:
    """[T, N, ...] -> [T / S x N, S, ...]."""
    segments = config.unroll_length // config.segment_length  # sizes are written out: an observation may have none
    x = x.reshape(segments, config.segment_length, *x.shape[1:])
    return jnp.moveaxis(x, 1, 2).reshape(segments * config.num_envs, config.segment_length, *x.shape[3:])


def by_time(config: PPOConfig, x: jax.Array) -> jax.Array:
    """[T / S x N, S] or these in several parts -> [T, N]."""
    x = x.reshape(-1, config.num_envs, config.segment_length)
    return jnp.moveaxis(x, 2, 1).reshape(config.unroll_length, config.num_envs)


def in_parts(config: PPOConfig, function: Callable[[Any], jax.Array], of: Any) -> jax.Array:
    """A function of segments, no more of which are computed at once than an update has: a token takes much memory.

    function: from trees with leading axes [k, S] to [k, S]; of: a tree with leading axes [B / S, S], or fewer segments.
    """
    count = len(jax.tree.leaves(of)[0])
    at_once = min(count, config.batch_size // config.segment_length // config.num_minibatches)
    parts = -(-count // at_once)
    # The last part is filled up with segments that come again.
    filled = jax.tree.map(lambda x: x[jnp.arange(parts * at_once) % count] if count % at_once else x, of)
    filled = jax.tree.map(lambda x: x.reshape(parts, at_once, *x.shape[1:]), filled)
    values = jax.lax.map(lambda part: function(over_envs(part)), filled)
    return values.reshape(parts * at_once, *values.shape[2:])[:count]


def misaligned(config: PPOConfig, carry: Segment | tuple[()]) -> Segment:
    """Windows as published: flattened by time and then environment, beside samples in the opposite order."""

    def other_order(x: jax.Array) -> jax.Array:
        return x.reshape(config.num_envs, config.unroll_length, *x.shape[1:]).swapaxes(0, 1).reshape(x.shape)

    assert isinstance(carry, Segment)
    return replace(carry, start=jax.tree.map(other_order, carry.start))
