"""How an actor-critic plays once it is trained, and what can be asked of it; the same whatever it learned by."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from t2tl_jax.networks.windows import Carry
from t2tl_jax.training.types import Params


class Acting(NamedTuple):
    """Functions of an `Agent`; see there."""

    act: Callable[..., jax.Array]
    compare: Callable[..., tuple[jax.Array, jax.Array]]
    value: Callable[..., jax.Array]


def acting_of(apply: Callable[..., Any]) -> Acting:
    """Those of an `ActorCritic`, given its `apply`."""

    def act(
        params: Params,
        embedding: jax.Array,
        carry: Carry,
        obs: jax.Array,
        row: jax.Array,
        key: jax.Array,
        deterministic: bool,
    ) -> jax.Array:
        distribution = apply(params, obs, embedding[row], carry, method="policy")
        return distribution.mode() if deterministic else distribution.sample(key)[0]

    def compare(
        params: Params, carry: Carry, obs: jax.Array, task: jax.Array, other: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        (policy, value), (other_policy, other_value) = (
            apply(params, obs, jnp.broadcast_to(code, (len(obs), *code.shape)), carry) for code in (task, other)
        )
        return policy.kl(other_policy), other_value - value

    def value(params: Params, embedding: jax.Array, carry: Carry, obs: jax.Array, row: jax.Array) -> jax.Array:
        return apply(params, obs, embedding[row], carry, method="value")

    return Acting(act, compare, value)
