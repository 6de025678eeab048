"""Segments of successive steps: windows, loss and gradients are those of samples that each bring their own window."""

import dataclasses
from functools import partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.agents.ppo_learning import Batch, ppo_loss
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.windows import Segment, stack_windows, valid_in_windows
from t2tl_jax.training.types import repeated
from tests.agents import sizes
from tests.parameters import parameters

SWITCHES = ((True, False), (True, False))
SEGMENTS, STEPS, WINDOW, OBSERVATION = 6, 5, 3, 4
CONTEXT = ContextConfig(length=WINDOW, reader=sizes.TRANSFORMER, segment_length=STEPS)
NETWORK = NetworkConfig(task_encoder=OneHotConfig(), env_layers=(16,), actor_layers=(), critic_layers=())


def make_network(**changes):
    return ActorCritic(dataclasses.replace(NETWORK, context=dataclasses.replace(CONTEXT, **changes)), 2)


def parameters_of(network):
    table = compile_tasks(["F a"], ("a",), "at_most_one")
    carry = repeated(network.begin(OBSERVATION), 1)
    return parameters(network, table, jnp.zeros((1, OBSERVATION)), jnp.full(1, 2), carry, method="initialise")


def act(network, params):
    """Steps as if acted: arrays [segments, S, ...], the windows at every step and after it, and segments.

    Their starts come from steps before, in which episodes ended too; the first one's is empty.
    """
    rng, before = np.random.default_rng(0), WINDOW + 2
    shape = (before + STEPS, SEGMENTS)
    obs, action, reward = (rng.normal(size=(*shape, *size)).astype(np.float32) for size in ((OBSERVATION,), (2,), ()))
    ended = rng.random(shape) < 0.25
    ended[before - 1, 0] = True

    def step(carry, now):
        obs, action, reward, ended = now
        after = network.apply(params, carry, obs, action, reward, method="remember")
        return network.next_episode(after, ended), (carry, after)

    start = repeated(network.begin(OBSERVATION), SEGMENTS)
    _, windows = jax.jit(lambda *given: jax.lax.scan(step, *given))(start, (obs, action, reward, ended))
    windows, after, (obs, action, reward, ended) = jax.tree.map(
        lambda x: np.swapaxes(x[before:], 0, 1), (*windows, (obs, action, reward, ended))
    )
    assert ended[:, :-1].any() and not ended.all()
    seen = None if network.config.context.recompute else jax.jit(partial(network.apply, method="see"))(params, obs)
    start = jax.tree.map(lambda x: x[:, 0], windows)
    return obs, action, windows, after, Segment(start, action, reward, ended, seen)


@pytest.mark.slow
@pytest.mark.parametrize("reset", [True, False])
def test_windows_of_a_segment_are_those_that_acted(reset):
    network = make_network(reset=reset)
    obs, _, windows, after, segment = act(network, {})  # which remembers what was seen, without any parameter

    @partial(jax.jit, static_argnums=3)
    def from_segment(segment, obs, action, later):
        valid = valid_in_windows(segment, reset, later)
        stacks = ((segment.start.seen, obs), (segment.start.action, action))
        stacks = [stack_windows(jnp.concatenate(parts, 1), 1, STEPS, later) for parts in stacks]
        return valid, *(jnp.where(valid[..., None], stacked, 0) for stacked in stacks)

    for later, expected in ((False, windows), (True, after)):
        stacked = from_segment(segment, obs, segment.action, later)
        jax.tree.map(np.testing.assert_array_equal, stacked, (expected.valid, expected.seen, expected.action))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reader", "reset", "recompute"),  # every two of the switches in all four ways
    [
        (sizes.TRANSFORMER, True, True),
        (dataclasses.replace(sizes.TRANSFORMER, masked=False), True, False),
        (dataclasses.replace(sizes.TRANSFORMER, masked=False), False, True),
        (sizes.TRANSFORMER, False, False),
        (sizes.GRU, True, True),
        (sizes.GRU, False, False),
    ],
)
def test_loss_gradients_and_values_are_those_of_samples_with_their_own_windows(reader, reset, recompute):
    network = make_network(reset=reset, recompute=recompute, reader=reader)
    params = parameters_of(network)
    obs, action, windows, after, segment = act(network, params)
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(3, SEGMENTS, STEPS)).astype(np.float32)
    task = rng.normal(size=(SEGMENTS, STEPS, NETWORK.task_encoder.code_size)).astype(np.float32)
    next_obs = rng.normal(size=obs.shape).astype(np.float32)
    log_prob, value, advantage = normal
    batch = Batch(obs, np.zeros((SEGMENTS, STEPS), int), action, log_prob - 3, value, advantage, segment)
    flat = lambda tree: jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), tree)  # noqa: E731

    def loss(params, task, batch):
        return ppo_loss(PPOConfig(clip_eps=10.0, clip_value=False), network, params, task, batch)[0]

    @jax.jit  # one program of all that is compared
    def compute(params, task, batch, windows, after):
        apart = flat(dataclasses.replace(batch, carry=windows))
        together = (
            jax.value_and_grad(loss)(params, task, batch),
            network.apply(params, obs, next_obs, task, segment, method="value_after"),
        )
        samples = (
            jax.value_and_grad(loss)(params, flat(task), apart),
            network.apply(params, next_obs, task, after, method="value"),
        )
        return together, samples

    together, samples = compute(params, task, batch, windows, after)
    chex.assert_trees_all_close(together, samples, rtol=1e-5, atol=1e-6)
    (_, gradient), _ = together
    assert any(jnp.abs(leaf).max() > 1e-4 for leaf in jax.tree.leaves(gradient["params"]["context_encoder"]))


def test_segments_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="got segment_length=0"):
        ContextConfig(segment_length=0)
    with pytest.raises(ValueError, match="needs segment_length=1, got segment_length=8"):
        ContextConfig(aligned=False)
    network = dataclasses.replace(NETWORK, context=dataclasses.replace(CONTEXT, segment_length=8))
    for name, sizes_of in (
        ("unroll_length", {"num_envs": 4, "unroll_length": 12, "minibatch_size": 16}),
        ("minibatch_size", {"num_envs": 4, "unroll_length": 16, "minibatch_size": 4}),
    ):
        with pytest.raises(ValueError, match=rf"must divide {name}, got segment_length=8 and {name}="):
            PPOConfig(network=network, **sizes_of)
