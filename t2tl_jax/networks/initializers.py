"""Weight initialisation: the published unit-norm rows, and T-Fixup's scales."""

from typing import Any

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.networks.types import Initializer


def unit_norm(scale: float = 1.0) -> Initializer:
    """Gaussian weights in which every output unit's incoming vector has length `scale` (T2TL's `nn.Linear` start).

    The untrained policy then moves far, which matters more for finding a sparse reward than any other choice here.
    """

    def init(key: jax.Array, shape: tuple[int, ...], dtype: Any = jnp.float32) -> jax.Array:
        kernel = jax.random.normal(key, shape, dtype)  # [inputs, outputs]
        return scale * kernel / jnp.linalg.norm(kernel, axis=0, keepdims=True)

    return init


def joint_qkv(scale: float = 1.0) -> Initializer:
    """Xavier-uniform as for one joint query-key-value matrix [width, 3 width], which is how PyTorch stores them."""
    # Xavier over (fan_in, 3 fan_out) with fan_in = fan_out has variance 1 / (2 fan_in).
    return nn.initializers.variance_scaling(0.5 * scale**2, "fan_in", "uniform")


def t_fixup_scale(layers: int) -> float:
    """Factor 0.67 layers^(-1/4) on feed-forward and attention output weights (Huang et al., ICML 2020)."""
    return 0.67 * layers**-0.25


def t_fixup_embedding(width: int, layers: int) -> Initializer:
    """Embedding rows N(0, width^-1), shrunk by (9 layers)^(-1/4)."""
    return nn.initializers.normal(stddev=width**-0.5 * (9 * layers) ** -0.25)
