"""Hidden layers in both heads of the action values: what they are, how they begin, and what they leave as it was."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig

TABLE = compile_tasks(["F(a & F b)"], ("a", "b"), "at_most_one")
CODES = np.eye(3, dtype=np.float32)
OBS = np.random.default_rng(0).normal(size=(4, 7)).astype(np.float32)
ACTIONS = 5
TRUNK = {"state_encoder_0": (7, 24), "state_encoder_1": (24, 20)}
OWN = {
    "concat": {"task_share": (3, 24)},
    "film": {"scale": (3, 20), "shift": (3, 20), "hidden": (20, 20)},
    "bilinear": {"matrix": (20, 4 * (ACTIONS + 1))},
}
OUTPUTS = {"advantage": ACTIONS, "state_value": 1}


def network(head, layers=()):
    config = QNetworkConfig(OneHotConfig(3), state_layers=(24,), task_layer=20, head=head, head_layers=layers)
    return QNetwork(config, ACTIONS)


@cache
def parameters(head, layers=()):
    init = jax.jit(lambda key: network(head, layers).init(key, TABLE, OBS, method="initialise"))
    return jax.device_get(init(jax.random.key(0)))["params"]


def shapes(params):
    return {name: part["kernel"].shape for name, part in params.items()}


@pytest.mark.parametrize("head", OWN)
def test_without_them_all_parameters_have_the_names_and_sizes_that_are_stored(head):
    ends = {} if head == "bilinear" else {name: (20, size) for name, size in OUTPUTS.items()}
    assert shapes(parameters(head)) == TRUNK | OWN[head] | ends


@pytest.mark.parametrize("head", ["concat", "film"])
def test_each_head_has_layers_of_its_own_and_all_before_them_begins_as_without(head):
    params, without = parameters(head, (16, 8)), parameters(head)
    layers = {f"{name}_layers_{i}": size for name in OUTPUTS for i, size in enumerate([(20, 16), (16, 8)])}
    assert shapes(params) == TRUNK | OWN[head] | layers | {name: (8, size) for name, size in OUTPUTS.items()}
    for name in TRUNK | OWN[head]:
        jax.tree.map(np.testing.assert_array_equal, params[name], without[name])
    assert not np.array_equal(params["advantage_layers_0"]["kernel"], params["state_value_layers_0"]["kernel"])


def test_heads_with_layers_begin_as_published():
    """Uniform as far as Xavier's bound, biases zero. Of a uniform variable the variance is a third of its bound's
    square; that of n draws is within 4 standard deviations of it, sqrt(4 / (5 n)) of it each."""
    params = parameters("concat", (400,))
    for name in ("advantage_layers_0", "state_value_layers_0", "advantage", "state_value"):
        kernel, bias = params[name]["kernel"], params[name]["bias"]
        bound = np.sqrt(6 / sum(kernel.shape))
        assert np.abs(kernel).max() <= bound and not bias.any()
        assert np.var(kernel) == pytest.approx(bound**2 / 3, rel=4 * np.sqrt(0.8 / kernel.size))


@pytest.mark.parametrize("dueling", [True, False])
def test_concatenation_with_head_layers_is_a_plain_network_on_state_and_code_side_by_side(dueling):
    params = jax.tree.map(lambda x: x + 0.1, parameters("concat", (16,)))  # biases too

    def layer(name, x, kernel=None):
        return x @ (params[name]["kernel"] if kernel is None else kernel) + params[name]["bias"]

    def relu(x):
        return np.maximum(x, 0)

    side_by_side = np.concatenate([np.repeat(OBS[:, None], 3, 1), np.repeat(CODES[None], 4, 0)], axis=-1)
    first = np.concatenate([params["state_encoder_0"]["kernel"], params["task_share"]["kernel"]])
    x = relu(layer("state_encoder_1", relu(layer("state_encoder_0", side_by_side, first))))
    advantage, value = (layer(name, relu(layer(f"{name}_layers_0", x))) for name in OUTPUTS)
    expected = value + advantage - advantage.mean(axis=-1, keepdims=True) if dueling else advantage
    config = QNetworkConfig(OneHotConfig(3), state_layers=(24,), task_layer=20, head="concat", head_layers=(16,))
    one = QNetwork(config if dueling else QNetworkConfig(**vars(config) | {"dueling": False}), ACTIONS)
    every = one.apply({"params": params}, OBS, CODES, method="every_row")
    np.testing.assert_allclose(every, expected, rtol=1e-4, atol=1e-4)  # products of float32 in another order
    row = jnp.array([0, 2, 1, 0])
    own = one.apply({"params": params}, OBS, CODES, row)
    np.testing.assert_allclose(own, expected[np.arange(4), row], rtol=1e-4, atol=1e-4)
