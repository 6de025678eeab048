"""A carried state: a segment gives what single steps gave, episodes begin anew, and what is remembered has no names."""

import dataclasses
from functools import partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gated import GatedConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.merged import MergedConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from t2tl_jax.networks.windows import Carried, Segment
from t2tl_jax.training.types import repeated
from tests.agents.test_ppo_merged_context import COLOURS, LIDARS, OBSERVATION, READINGS
from tests.agents.test_ppo_merged_context import NETWORK as MERGED
from tests.parameters import parameters

SEGMENTS, STEPS, BEFORE = 3, 5, 4
CONTEXT = ContextConfig(carried=True, reader=GRUConfig(width=8, output=4), segment_length=STEPS)
NETWORK = dataclasses.replace(MERGED, context=CONTEXT)
STATES = {"merged": MergedConfig(), "flat": FlatConfig()}


def make_network(state="merged", discrete=False, **changes):
    config = dataclasses.replace(NETWORK, state=STATES[state], context=dataclasses.replace(CONTEXT, **changes))
    network = ActorCritic(config, 2, discrete, LIDARS)
    table = compile_tasks(["F a"], ("a", "b", "c"), "at_most_one")
    given = jnp.zeros((1, OBSERVATION)), jnp.full(1, 2), repeated(network.begin(OBSERVATION), 1)
    return network, parameters(network, table, *given, method="initialise")


def drawn(*shape, seed=0, discrete=False):
    """Observations, actions, rewards, ends of episodes and codes of tasks, each of `shape`."""
    rng = np.random.default_rng(seed)
    sizes_of = (OBSERVATION,), (2,), (), (NETWORK.task_encoder.code_size,)
    obs, action, reward, task = (rng.normal(size=(*shape, *size)).astype(np.float32) for size in sizes_of)
    action = rng.integers(2, size=shape) if discrete else action
    return tuple(map(jnp.asarray, (np.abs(obs), action, reward, rng.random(shape) < 0.25, task)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("state", "discrete", "reset"),
    [("merged", False, True), ("merged", True, False), ("flat", True, True), ("flat", False, False)],
)
def test_a_segment_gives_what_single_steps_gave(state, discrete, reset):
    """Features and values after each step, with gradient; the task is another one at every step."""
    network, params = make_network(state, discrete, reset=reset)
    obs, action, reward, ended, task = drawn(SEGMENTS, BEFORE + STEPS, discrete=discrete)
    ended = ended.at[0, BEFORE - 1].set(True)  # one segment begins with a new episode
    next_obs, _, _, _, next_task = drawn(SEGMENTS, BEFORE + STEPS, seed=1)
    assert ended[:, BEFORE:-1].any() and not ended[:, BEFORE:].all()

    def one(params, carry, now):
        obs, action, reward, ended, task, next_obs, next_task = now
        features = network.apply(params, obs, task, carry, method="features")
        after = network.apply(params, carry, obs, action, reward, method="remember")
        value_after = network.apply(params, next_obs, next_task, after, method="value")
        return network.next_episode(after, ended), (features, value_after)

    given = (obs, action, reward, ended, task, next_obs, next_task)
    earlier, during = ([np.swapaxes(x[:, part], 0, 1) for x in given] for part in (slice(BEFORE), slice(BEFORE, None)))

    @jax.jit
    def compute(params):
        start, _ = jax.lax.scan(partial(one, params), repeated(network.begin(OBSERVATION), SEGMENTS), earlier)
        start = jax.lax.stop_gradient(start)

        def by_step(params):
            _, results = jax.lax.scan(partial(one, params), start, during)
            return jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), results)

        def by_segment(params):
            obs, action, reward, ended, task, next_obs, next_task = (x[:, BEFORE:] for x in given)
            segment = Segment(start, action, reward, ended, seen=None)
            features = network.apply(params, obs, task, segment, method="features")
            return features, network.apply(params, obs, next_obs, next_task, segment, method="value_after")

        def loss(results):
            return sum(jnp.sum(jnp.square(x)) for x in results)

        gradients = [jax.grad(lambda params, of=of: loss(of(params)))(params) for of in (by_step, by_segment)]
        return start, by_step(params), by_segment(params), gradients

    start, single, together, (of_single, of_together) = compute(params)
    assert start.state.shape == ((SEGMENTS, COLOURS, 8) if state == "merged" else (SEGMENTS, 8))
    assert start.state[0].any() != reset and start.state[1:].any()
    chex.assert_trees_all_close(together, single, atol=1e-5)
    chex.assert_trees_all_close(of_together, of_single, rtol=1e-4, atol=1e-4)  # sums over all steps
    assert np.abs(together[0][..., -CONTEXT.reader.output :]).max() > 0.1  # the context's part of the features
    of_parts = of_together["params"]["context_encoder"]
    assert all(np.abs(leaf).max() > 1e-4 for name in ("token", "cell") for leaf in jax.tree.leaves(of_parts[name]))


@pytest.mark.slow
def test_what_is_remembered_is_known_by_its_role_alone():
    """Two colours that change places in all observations and in the task change nothing; in one of them they do."""
    network, params = make_network()
    obs, action, reward, _, task = drawn(5, BEFORE + 1)
    read, remember = (jax.jit(partial(network.apply, method=method)) for method in ("features", "remember"))

    def features(obs, task):
        carry = repeated(network.begin(OBSERVATION), len(obs))
        for t in range(BEFORE):
            carry = remember(params, carry, obs[:, t], action[:, t], reward[:, t])
        return np.asarray(read(params, obs[:, BEFORE], task[:, BEFORE], carry)), carry

    order = np.array([2, 1, 0])
    lidars = obs[..., 1:].reshape(5, BEFORE + 1, COLOURS, READINGS)[..., order, :].reshape(5, BEFORE + 1, -1)
    other_obs = np.concatenate([obs[..., :1], lidars], -1)
    remembered_alone = np.concatenate([other_obs[:, :BEFORE], obs[:, BEFORE:]], 1)
    other_task = task.reshape(5, BEFORE + 1, COLOURS, -1)[..., order, :].reshape(task.shape)
    (first, carry), (renamed, other_carry) = features(obs, task), features(other_obs, other_task)
    np.testing.assert_allclose(renamed, first, atol=1e-6)
    np.testing.assert_allclose(other_carry.state, carry.state[:, order], atol=1e-6)
    for given in ((other_obs, task), (obs, other_task), (remembered_alone, task)):
        context = np.abs(features(*given)[0] - first)[:, -CONTEXT.reader.output :]
        assert context.max(axis=1).min() > 1e-3


@pytest.mark.slow
def test_a_new_episode_begins_without_memory_and_an_old_one_goes_on():
    network, params = make_network("flat")
    obs, action, reward, *_ = drawn(2)
    carry = network.apply(params, repeated(network.begin(OBSERVATION), 2), obs, action, reward, method="remember")
    assert np.abs(carry.state).max(axis=-1).min() > 1e-3
    state = network.next_episode(carry, np.array([True, False])).state
    np.testing.assert_array_equal(state, np.stack([np.zeros(8), carry.state[1]]))


def test_the_parameters_are_those_of_a_gru_over_windows():
    """Of flat states, so that both are of equal size."""
    carried, window = (
        jax.tree.map(np.shape, make_network("flat", carried=carried)[1]["params"]) for carried in (True, False)
    )
    parts = carried.pop("context_encoder")
    assert parts == {"token": (of := window.pop("context_encoder"))["token"], **of["encoder"]} and carried == window


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ContextConfig(carried=True), "network.context.reader=gru, got a reader of TransformerConfig"),
        (
            lambda: dataclasses.replace(CONTEXT, length=9),
            "its length=9 would mean nothing: leave it at 8",
        ),
        (
            lambda: dataclasses.replace(CONTEXT, segment_length=1),
            "carried=True needs segment_length=2 or more, got segment_length=1",
        ),
        (
            lambda: dataclasses.replace(CONTEXT, recompute=False),
            "needs aligned=True and recompute=True, got aligned=True and recompute=False",
        ),
        (
            lambda: dataclasses.replace(CONTEXT, aligned=False, segment_length=1),
            "carried=True needs segment_length=2 or more",  # which misaligned windows do not have
        ),
        (
            lambda: dataclasses.replace(NETWORK, state=GatedConfig()),
            "network.context.carried=True needs network.state=flat, got gated; use flat, or network.state=merged",
        ),
        (lambda: QNetworkConfig(context=CONTEXT), "network.context.carried=True is PPO's; use carried=False"),
        (
            lambda: ActorCritic(dataclasses.replace(NETWORK, env_layers=()), 2, objects=LIDARS).apply(
                {}, *drawn()[::4], method="features"
            ),
            "a network with carried=True needs the state that it carries, got tuple",
        ),
        (
            lambda: ActorCritic(dataclasses.replace(NETWORK, state=FlatConfig(), context=ContextConfig()), 2).apply(
                {}, Carried(np.zeros(8)), method="context"
            ),
            "a network with context needs a window, got Carried",
        ),
    ],
)
def test_what_cannot_be_carried_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
