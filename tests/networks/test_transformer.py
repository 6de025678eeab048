"""The Transformer: published size, what masking and positions promise, attention on request."""

from dataclasses import replace
from functools import cache, partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import linen as nn

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.task_encoders import TransformerTaskEncoder, attention_weights
from t2tl_jax.networks.transformer import TokenTransformer, TransformerConfig, short_attention, sinusoidal_positions
from tests.parameters import parameters

PUBLISHED = TransformerConfig(norm="post", positions="none", masked=False, norm_after_pooling=True, t_fixup=True)
PROPOSITIONS = ("Black", "White", "Red", "Yellow")
PHI_ZONE = "F(Red & F(Black & F Yellow))"
# These compile much faster than the defaults, and promise the same.
CORRECTED, AS_PUBLISHED = TransformerConfig(layers=2), replace(PUBLISHED, layers=1)


def count(params) -> int:
    return sum(leaf.size for leaf in jax.tree.leaves(params))


@cache
def encoder(config: TransformerConfig):
    """The function of parameters, tokens, and which of them count; and parameters, which know no length."""
    model, tokens = TokenTransformer(config, 22), np.ones((1, 1), np.int32)
    return jax.jit(model.apply), parameters(model, tokens, tokens > 0)


def encode(config: TransformerConfig, tokens: list[list[int]], length: int) -> np.ndarray:
    padded = np.array([row + [0] * (length - len(row)) for row in tokens], np.int32)
    apply, params = encoder(config)
    return np.asarray(apply(params, padded, padded > 0))


def test_published_t1tl_has_243_925_parameters():
    table = compile_tasks([PHI_ZONE], PROPOSITIONS, "at_most_one", length=25)
    network = ActorCritic(NetworkConfig(task_encoder=PUBLISHED), action_size=2)
    init = partial(network.init, method="initialise")
    variables = jax.eval_shape(init, jax.random.key(0), table, jnp.zeros((1, 76)), jnp.zeros(1, jnp.int32))
    assert count(variables["params"]["task_encoder"]) == 202_640
    assert count(variables["params"]["environment_encoder"]) == 18_112
    assert count(variables) == 243_925


@pytest.mark.slow
def test_masked_encoding_does_not_depend_on_padding():
    tokens = [[5, 3, 12, 5, 10], [5, 10]]
    np.testing.assert_allclose(encode(CORRECTED, tokens, 5), encode(CORRECTED, tokens, 40), atol=1e-5)


@pytest.mark.slow
def test_published_encoding_depends_on_padding():
    tokens = [[5, 3, 12, 5, 10], [5, 10]]
    assert np.abs(encode(AS_PUBLISHED, tokens, 5) - encode(AS_PUBLISHED, tokens, 25)).max() > 1e-3


@pytest.mark.slow
def test_positions_tell_the_order_of_tokens_and_the_published_code_does_not():
    swapped = [[5, 3, 12, 5, 10], [5, 3, 10, 5, 12]]
    with_positions = encode(CORRECTED, swapped, 5)
    without = encode(AS_PUBLISHED, swapped, 5)
    assert np.abs(with_positions[0] - with_positions[1]).max() > 1e-2
    np.testing.assert_allclose(without[0], without[1], atol=1e-5)


def test_sinusoidal_positions_follow_the_formula():
    table = sinusoidal_positions(50, 64)
    assert table[7, 10] == pytest.approx(np.sin(7 / 10_000 ** (10 / 64)), abs=1e-6)
    assert table[7, 11] == pytest.approx(np.cos(7 / 10_000 ** (10 / 64)), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("norm", ["pre", "post"])
def test_output_is_bounded_and_differentiable(norm):
    config = replace(CORRECTED, layers=1, norm=norm)
    table = compile_tasks([PHI_ZONE], PROPOSITIONS, "at_most_one")
    encoder = TransformerTaskEncoder(config)
    params = parameters(encoder, table)
    out, gradient = jax.jit(jax.value_and_grad(lambda p: jnp.sum(encoder.apply(p, table) ** 2)))(params)
    assert out > 0
    chex.assert_tree_all_finite(gradient)
    norms = {
        jax.tree_util.keystr(path): float(np.abs(leaf).max()) for path, leaf in jax.tree.leaves_with_path(gradient)
    }
    # A key bias shifts all of a query's scores alike, so softmax makes its gradient zero; everything else learns.
    assert all(norm > 0 for name, norm in norms.items() if "['key']['bias']" not in name)


@pytest.mark.parametrize("masked", [True, False])
def test_short_attention_is_attention(masked):
    """Values and gradients, where keys are masked and where none is."""
    inputs = jax.random.normal(jax.random.key(0), (3, 5, 7, 2, 4))
    mask = jnp.arange(7) < jnp.array([7, 3, 5, 1, 4])[:, None, None, None] if masked else None

    def of(attention):
        return jax.jit(jax.value_and_grad(lambda qkv: jnp.sin(attention(*qkv, mask=mask)).sum()))(inputs)

    chex.assert_trees_all_close(of(short_attention), of(nn.dot_product_attention), atol=1e-5)


@pytest.mark.slow
def test_attention_weights_are_distributions_over_real_tokens():
    table = compile_tasks([PHI_ZONE], PROPOSITIONS, "at_most_one", length=12)
    encoder = TransformerTaskEncoder(CORRECTED)
    weights = jax.jit(partial(attention_weights, encoder))(parameters(encoder, table)["params"], table)
    assert weights.shape == (2, table.num_rows, 8, 12, 12)
    np.testing.assert_allclose(weights.sum(-1), 1.0, atol=1e-5)
    padding = ~np.asarray(table.mask)[None, :, None, None, :]
    assert np.abs(np.where(padding, weights, 0.0)).max() == 0.0
