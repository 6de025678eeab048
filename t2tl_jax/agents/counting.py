"""How far a run has come, where it has more steps than 32 bits can count.

What programs count are iterations. The steps and gradient steps before one are its number times those of an iteration,
a product that is not taken as a whole number here unless a run ends before it overflows.
"""

import jax
import jax.numpy as jnp

from t2tl_jax import checks


def before(iteration: jax.Array, length: int, total: int) -> jax.Array:
    """Steps before an iteration of `length` steps, in a run of `total`: int32, or float32 where these are too many.

    For schedules, which lose nothing by rounding: they read the share of the run, as float32 in both cases. A run that
    can be counted is counted, so that its numbers are those of earlier versions, to the last bit.
    """
    number = jnp.int32 if total <= checks.COUNTER_LIMIT else jnp.float32
    return iteration.astype(number) * length


def has_reached(iteration: jax.Array, place: jax.Array, length: int, bound: int) -> jax.Array:
    """Whether ``iteration * length + place``, a step, is `bound` or later; `place` counts the steps of the iteration.

    Args:
        iteration: int32, iterations before.
        place: int32, from 0 to `length` - 1.
        length: steps of an iteration.
        bound: a step.
    """
    whole, rest = divmod(bound, length)
    return (iteration > whole) | ((iteration == whole) & (place >= rest))


def product_modulo(number: jax.Array, factor: int, modulus: int) -> jax.Array:
    """``number * factor % modulus`` in int32, where the product may need more: by doubling, for each bit of the factor.

    Args:
        number: int32, 0 or more.
        factor: 0 or more.
        modulus: from 1 to the largest int32.
    """

    def added(a: jax.Array, b: jax.Array) -> jax.Array:
        room = modulus - b  # the sum itself may overflow; then it is not the one that is taken
        return jnp.where(a >= room, a - room, a + b)

    product, power, factor = jnp.zeros_like(number), number % modulus, factor % modulus
    while factor:
        if factor % 2:
            product = added(product, power)
        power, factor = added(power, power), factor // 2
    return product
