"""Sums of lidars weighed by the task's code, against a loop; what cannot be added up is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gated import GatedConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.state_encoders import make_state_encoder
from t2tl_jax.objects import Objects

READER = GRUConfig(output=5)
LIDARS = Objects.blocks((1, 4, 7), 3, (1, 0, 1))  # three lidars of three numbers, two of them of proposition 1
GATES = 2


@pytest.fixture(scope="module")
def gated():
    """An encoder with random parameters."""
    encoder = make_state_encoder(GatedConfig(GATES), LIDARS, READER)
    return encoder, encoder.init(jax.random.key(0), jnp.zeros(11), jnp.zeros(5))


def test_every_sum_weighs_propositions_by_the_code(gated):
    encoder, params = gated
    obs, code = jax.random.uniform(jax.random.key(1), (4, 11)), jax.random.normal(jax.random.key(2), (4, 5))
    found = jax.jit(encoder.apply)(params, obs, code)
    layer = params["params"]["gates"]
    assert found.shape == (4, 2 + GATES * 3) and layer["kernel"].shape == (5, 2 * GATES)
    for seen, said, features in zip(np.asarray(obs), np.asarray(code), np.asarray(found), strict=True):
        weights = 1 / (1 + np.exp(-(said @ layer["kernel"] + layer["bias"]))).reshape(2, GATES)
        expected = [seen[0], seen[10]]
        for gate in range(GATES):
            blocks = zip((1, 4, 7), LIDARS.proposition, strict=True)
            expected += [*sum(seen[start : start + 3] * weights[of, gate] for start, of in blocks)]
        np.testing.assert_allclose(features, expected, rtol=1e-5)


def test_one_observation_is_read_for_many_tasks(gated):
    encoder, params = gated
    obs, codes = jnp.arange(11.0), jax.random.normal(jax.random.key(3), (6, 5))
    together = encoder.apply(params, obs, codes)
    for code, features in zip(codes, together, strict=True):
        np.testing.assert_allclose(encoder.apply(params, obs, code), features, rtol=1e-5)


def test_the_code_can_single_out_a_proposition(gated):
    """One layer shows one lidar for one code, and another for another."""
    encoder, params = gated
    layer = {"kernel": jnp.zeros((5, 4)).at[0].set(100.0 * jnp.array([1, 0, -1, 0])), "bias": jnp.zeros(4)}
    params = {"params": {"gates": layer}}
    obs = jnp.arange(11.0)
    first, second = (encoder.apply(params, obs, jnp.zeros(5).at[0].set(sign))[2:5] for sign in (1.0, -1.0))
    np.testing.assert_allclose(first, obs[4:7])  # of proposition 0
    np.testing.assert_allclose(second, obs[1:4] + obs[7:10])  # of proposition 1


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: make_state_encoder(GatedConfig(), None, READER), "network.state=gated needs an environment that says"),
        (
            lambda: make_state_encoder(GatedConfig(), Objects.blocks((0, 4), 4, (0, 1), place=2), READER),
            "places cannot be added up",
        ),
        (lambda: GatedConfig(0), "gates"),
        (
            lambda: NetworkConfig(state=GatedConfig(), context=ContextConfig()),
            "no context window can hold these states",
        ),
    ],
)
def test_what_does_not_fit_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
