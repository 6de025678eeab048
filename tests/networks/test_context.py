"""The context: published size, what a window holds, and that empty slots never matter."""

import dataclasses
from functools import partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.context import ContextEncoder
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.networks.windows import Window, append, empty_where, empty_window, without_oldest
from t2tl_jax.training.types import repeated
from tests.parameters import parameters

SMALL = TransformerConfig(layers=1, width=16, heads=2, feed_forward=32, output=8)
AS_PUBLISHED = TransformerConfig(norm="post", positions="none", masked=False, norm_after_pooling=True, t_fixup=True)
PUBLISHED = NetworkConfig(
    task_encoder=AS_PUBLISHED,
    observation="raw",
    value_scale=1.0,
    context=ContextConfig(
        reader=dataclasses.replace(AS_PUBLISHED, layers=2),
        reset=False,
        aligned=False,
        halved=True,
        recompute=False,
        segment_length=1,
    ),
)


def count(params) -> int:
    return sum(leaf.size for leaf in jax.tree.leaves(params))


def random_window(shape, config, valid=True, seed=0):
    """Windows of `shape`, of 2-d actions and 4-d embeddings."""
    rng, slots = np.random.default_rng(seed), (*shape, config.length)
    return Window(
        *(rng.normal(size=size).astype(np.float32) for size in ((*slots, 2), slots, (*slots, 4))),
        valid=np.broadcast_to(valid, slots),
    )


def coder(config):
    """The encoder's code of windows and its parameters, jitted."""
    module = ContextEncoder(config)
    window = random_window((1,), config)
    params = parameters(module, window, window.seen)
    return params, jax.jit(lambda params, window: module.apply(params, window, window.seen))


@pytest.mark.slow
@pytest.mark.parametrize(("context", "parameters"), [(PUBLISHED.context, 261_509), (None, 243_925)])
def test_published_networks_have_the_published_sizes(context, parameters):
    table = compile_tasks(
        ["F(Red & F(Black & F Yellow))"], ("Black", "White", "Red", "Yellow"), "at_most_one", length=25
    )
    network = ActorCritic(dataclasses.replace(PUBLISHED, context=context), action_size=2)
    init = partial(network.init, method="initialise")
    carry = repeated(network.begin(76), 1)
    variables = jax.eval_shape(init, jax.random.key(0), table, jnp.zeros((1, 76)), jnp.zeros(1, jnp.int32), carry)
    assert count(variables) == parameters
    if context is not None:
        sizes = {name: count(part) for name, part in variables["params"].items()}
        assert sizes == {
            "environment_encoder": 18_112,
            "task_encoder": 202_640,
            "context_encoder": 15_536,
            "actor": 14_788,
            "critic": 10_433,
        }


@pytest.mark.slow
def test_t_fixup_scales_for_the_sizes_before_halving():
    window = random_window((1,), PUBLISHED.context)
    params = jax.jit(ContextEncoder(PUBLISHED.context).init)(jax.random.key(0), window, window.seen)["params"]
    layer = params["encoder"]["layer_0"]
    np.testing.assert_allclose(jnp.linalg.norm(layer["feed_forward_in"]["kernel"], axis=0), 0.67 * 2**-0.25, atol=1e-5)
    assert float(params["token"]["kernel"].std()) == pytest.approx(64**-0.5 * 18**-0.25, rel=0.15)  # 224 draws
    assert "layer_1" not in params["encoder"]


@pytest.mark.slow
def test_windows_hold_the_last_steps_of_the_own_episode():
    """Against a slow loop that keeps a list of steps per environment and throws it away when the episode ends."""
    rng, length, envs = np.random.default_rng(0), 3, 4
    step = jax.jit(lambda w, a, r, s, ended: empty_where(without_oldest(append(w, a, r, s)), ended))
    window = repeated(empty_window(length, jnp.zeros(2), 5), envs)
    kept = [[] for _ in range(envs)]
    for _ in range(15):
        action, reward, seen = rng.normal(size=(envs, 2)), rng.normal(size=envs), rng.normal(size=(envs, 5))
        ended = rng.random(envs) < 0.2
        window = step(window, *(jnp.asarray(x, jnp.float32) for x in (action, reward, seen)), ended)
        for i in range(envs):
            kept[i] = [] if ended[i] else [*kept[i], (action[i], reward[i], seen[i])][-length:]
            empty = length - len(kept[i])
            np.testing.assert_array_equal(window.valid[i], [False] * empty + [True] * len(kept[i]))
            for slot, (a, r, s) in enumerate(kept[i], start=empty):
                np.testing.assert_allclose(window.action[i, slot], a, rtol=1e-6)
                np.testing.assert_allclose(window.reward[i, slot], r, rtol=1e-6)
                np.testing.assert_allclose(window.seen[i, slot], s, rtol=1e-6)
            assert not window.seen[i, :empty].any()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["transformer", "gru", "published"])
def test_empty_slots_never_matter_and_order_does_unless_as_published(name):
    published = name == "published"
    reader = GRUConfig(width=16, output=8) if name == "gru" else SMALL
    config = PUBLISHED.context if published else ContextConfig(length=8, reader=reader)
    params, code = coder(config)
    valid = np.arange(8) >= 5
    window, other = (random_window((2,), config, valid, seed) for seed in (0, 1))
    mixed = jax.tree.map(lambda x, y: np.where(valid.reshape(8, *(1,) * (x.ndim - 2)), x, y), window, other)
    np.testing.assert_array_equal(code(params, window), code(params, mixed))
    assert np.abs(code(params, window) - code(params, other)).max() > 1e-3  # the others do matter
    backwards = jax.tree.map(lambda x: np.concatenate([x[:, :5], x[:, :4:-1]], axis=1), window)
    difference = np.abs(code(params, window) - code(params, backwards)).max()
    assert difference < 1e-5 if published else difference > 1e-3

    # No step yet: a code without NaN in value or gradient; 0 where empty slots are masked.
    nothing = random_window((2,), config, False)
    gradient = jax.jit(jax.grad(lambda p: jnp.sum(code(p, nothing) ** 2 + code(p, window) ** 2)))(params)
    chex.assert_tree_all_finite((code(params, nothing), gradient))
    assert published or not code(params, nothing).any()
    np.testing.assert_allclose(code(params, jax.tree.map(lambda x: x[0], window)), code(params, window)[0], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("recompute", [True, False])
def test_gradient_reaches_the_environment_encoder_through_the_window_iff_recomputed(recompute):
    context = ContextConfig(length=3, reader=SMALL, recompute=recompute)
    config = NetworkConfig(task_encoder=OneHotConfig(), env_layers=(6,), context=context)
    network = ActorCritic(config, action_size=1)
    table = compile_tasks(["F a"], ("a",), "at_most_one")
    obs, row = np.ones((2, 4), np.float32), np.full(2, 2)
    begin = repeated(network.begin(4), 2)
    params = parameters(network, table, obs, row, begin, method="initialise")

    @jax.jit
    def compute(params):
        carry = network.apply(params, begin, obs, jnp.ones((2, 1)), jnp.ones(2), method="remember")
        return carry, jax.grad(lambda p: network.apply(p, carry, method="context").sum())(params)["params"]

    carry, gradient = compute(params)
    assert carry.seen.shape == (2, 3, 4 if recompute else 6)
    assert any(np.abs(leaf).max() > 1e-4 for leaf in jax.tree.leaves(gradient["context_encoder"]))
    assert any(leaf.any() for leaf in jax.tree.leaves(gradient["environment_encoder"])) == recompute


def test_impossible_settings_are_refused():
    with pytest.raises(ValueError, match="got length=0"):
        ContextConfig(length=0)
    with pytest.raises(ValueError, match="got layers=1"):
        ContextConfig(halved=True, reader=SMALL)
    with pytest.raises(ValueError, match="got a reader of GRUConfig"):
        ContextConfig(halved=True, reader=GRUConfig())
    with pytest.raises(ValueError, match="needs a window, got tuple"):
        ActorCritic(NetworkConfig(context=ContextConfig()), 2).apply({}, (), method="context")
