"""A linear layer of parts is one of their concatenation, with the same parameters, also the first ones."""

import chex
import jax
import jax.numpy as jnp
import pytest
from flax import linen as nn

from t2tl_jax.networks.initializers import unit_norm
from t2tl_jax.networks.parts import DenseOfParts

SHORT, LONG = jax.random.normal(jax.random.key(1), (5, 1, 3)), jax.random.normal(jax.random.key(2), (5, 4, 16))
"""Of parts that are broadcast against each other."""


class Layers(nn.Module):
    """One layer of a kind, in a module as those that hold it."""

    kind: type[nn.Module]

    def setup(self):
        """Name it."""
        self.token = self.kind(8, kernel_init=unit_norm())

    def __call__(self, x):
        """What the layer makes of x."""
        return self.token(x)


def test_it_is_dense_of_the_concatenation():
    """Parameters, values and gradients."""
    parted, dense = Layers(DenseOfParts), Layers(nn.Dense)
    whole = jnp.concatenate([jnp.broadcast_to(SHORT, (5, 4, 3)), LONG], axis=-1)
    params = parted.init(jax.random.key(0), [SHORT, LONG])
    chex.assert_trees_all_equal(params, dense.init(jax.random.key(0), whole))

    def of(layers, x):
        return jax.value_and_grad(lambda params: jnp.sin(layers.apply(params, x)).sum())(params)

    chex.assert_trees_all_close(of(parted, [SHORT, LONG]), of(dense, whole), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("count", [1, 3])
def test_any_number_of_parts(count):
    """One part is `nn.Dense`; of three each has its own rows."""
    parts = [LONG[..., i : i + 2] for i in range(0, 2 * count, 2)]
    layer = DenseOfParts(8)
    params = layer.init(jax.random.key(0), parts)
    expected = nn.Dense(8).apply(params, jnp.concatenate(parts, axis=-1))
    chex.assert_trees_all_close(layer.apply(params, parts), expected, rtol=1e-5, atol=1e-5)
