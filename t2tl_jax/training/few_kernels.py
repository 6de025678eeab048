"""Fewer kernels for what is done to all arrays of a network: on a GPU small ones take longer than their arithmetic.

XLA makes one kernel of arrays of one shape that go through the same operation together with an array that all of them
read. It does not where that is a single number, nor for sums over arrays. Arrays that are clipped each by a norm of its
own still have a sum each.
"""

from typing import Any

import jax
import jax.numpy as jnp
import optax


def global_norm(tree: Any) -> jax.Array:
    """float32[]: the norm of all arrays together, up to rounding that of `optax.tree.norm`.

    Of each array that would take a kernel of its own; here all are put into one array first, those of a frozen part
    too. They are of one dtype, and there is at least one.
    """
    return optax.tree.norm(jnp.concatenate([jnp.ravel(x) for x in jax.tree.leaves(tree)]))


def read_by_many(number: jax.Array) -> jax.Array:
    """The same number, to go into an operation on each of many arrays.

    It is one of two that the compiler does not know to be equal, so that arrays share more than a single number. With
    several seeds they share one of each anyway.
    """
    return jax.lax.optimization_barrier(jnp.stack([number, number]))[0]
