"""Potential-based reward shaping from the task table, as in the reward-machine benchmark (Toro Icarte et al., 2022).

A step from row u to row u' is learned as if it paid `r + gamma * Phi(u') - Phi(u)`. Along an episode this adds up to a
constant of its start, so that no policy gains on another: the best policies stay the best (Ng et al., 1999).
"""

import jax
import jax.numpy as jnp

from t2tl_jax.ltl import TaskTable
from t2tl_jax.ltl.ahead import best_worth

TOLERANCE = 1e-7
"""Value iteration stops when no value changes by more, as published, or when it cannot change by more."""


def potential(table: TaskTable, discount: float | jax.Array) -> jax.Array:
    """Phi of every row, float32[rows]: minus the value of the row to somebody who chooses the letters.

    That value is V(u) = max over letters of r + gamma V(u'), by value iteration on the table alone; rows with a verdict
    are worth 0. The minus sign is published: the closer to the end, the lower Phi, so that staying pays a little, and
    to fall back pays. What it speeds up is not obvious; that it changes no best policy is.

    Args:
        table: of formulas, or of reward machines with what they pay.
        discount: gamma, `0 <= gamma < 1`. It may be traced, so it is not checked here: at 1 iteration would stop after
            its first step, with wrong values. `DQNConfig` refuses 1 where rewards are shaped.
    """

    def improve(carry: tuple[jax.Array, jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array, jax.Array]:
        value, _, count = carry
        better = jnp.where(table.is_open, best_worth(table, value, discount), 0.0)
        return better, jnp.abs(better - value).max(), count + 1

    most = jnp.maximum(1.0, jnp.ceil(jnp.log(TOLERANCE) / jnp.log(discount)))  # of a discount of 0 the quotient is 0
    start = (jnp.zeros(table.num_rows, jnp.float32), jnp.float32(jnp.inf), jnp.int32(0))
    value, _, _ = jax.lax.while_loop(lambda carry: (carry[1] > TOLERANCE) & (carry[2] < most), improve, start)
    return -value
