"""A linear layer of vectors in parts, which are not put side by side for it."""

import itertools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from flax import linen as nn
from flax.typing import Initializer


class DenseOfParts(nn.Module):
    """What `nn.Dense` makes of the parts' concatenation, to rounding, with the same parameters: the sum of what their
    rows of the kernel make of each. The concatenation of long parts would cost more than their product."""

    features: int
    kernel_init: Initializer = nn.linear.default_kernel_init

    @nn.compact
    def __call__(self, parts: Sequence[jax.Array]) -> jax.Array:
        """Parts [..., size] of any sizes, broadcast against each other -> [..., features]."""
        ends = list(itertools.accumulate(part.shape[-1] for part in parts))
        kernel = self.param("kernel", self.kernel_init, (ends[-1], self.features))
        bias = self.param("bias", nn.initializers.zeros, (self.features,))
        rows = jnp.split(kernel, ends[:-1])
        return sum((part @ of_part for part, of_part in zip(parts, rows, strict=True)), start=bias)
