"""Generalised advantage estimation (Schulman et al., 2016)."""

import jax
import jax.numpy as jnp


def generalised_advantages(
    reward: jax.Array,
    value: jax.Array,
    next_value: jax.Array,
    terminated: jax.Array,
    truncated: jax.Array,
    discount: float,
    gae_lambda: float,
) -> jax.Array:
    """GAE over the leading time axis; all inputs and the result are [T, ...].

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
