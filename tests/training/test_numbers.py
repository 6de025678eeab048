"""Numbers that only enter arithmetic are arguments: one program for all of their values, and the same results."""

import dataclasses
from dataclasses import replace
from functools import cache

import chex
import jax
import numpy as np
import pytest

from t2tl_jax import Config, EnvConfig
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.runs.experiment import build
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.numbers import make_given, numbers_of
from t2tl_jax.training.optimizer import clipped_adam
from t2tl_jax.training.program import OVER_SEEDS, params_of_seeds
from t2tl_jax.training.seeds import TRAINING, stream_keys
from tests.fake_agent import FakeConfig, make_agent
from tests.probe import DiscreteProbeEnv, ProbeEnv

ONE_HOT = OneHotConfig(2)
PPO = PPOConfig(
    network=NetworkConfig(task_encoder=ONE_HOT, env_layers=(8,), actor_layers=(8,), critic_layers=(8,)),
    num_envs=4,
    unroll_length=8,
    epochs=1,
    minibatch_size=32,
    task_encoder_learning_rate=1e-3,
)
DQN = DQNConfig(
    network=QNetworkConfig(task_encoder=ONE_HOT, state_layers=(8,), task_layer=8),
    num_envs=4,
    unroll_length=8,
    batch_size=8,
    buffer_size=64,
    learning_starts=8,
    task_encoder_learning_rate=1e-3,
)
LEARNERS = {"ppo": (PPO, ProbeEnv()), "dqn": (DQN, DiscreteProbeEnv())}


def other_numbers(learner):
    """The same learner with every number that is an argument halved."""
    return replace(learner, **{name: value / 2 for name, value in learner.numbers.items()})


@cache
def experiment(name, halved=False):
    """Cached, since every trace takes seconds."""
    learner, probe = LEARNERS[name]
    task = Config(env=EnvConfig(), task="F(Up & F Down)", learner=learner, frames=96, episode_length=6)
    if halved:
        return build(replace(task, learner=other_numbers(learner), random_starts=0.25), probe)
    return build(replace(task, random_starts=0.5), probe)


@pytest.mark.slow
@pytest.mark.parametrize("name", LEARNERS)
def test_every_number_is_an_argument(name):
    learner = LEARNERS[name][0]
    floats = {field.name for field in dataclasses.fields(learner) if type(getattr(learner, field.name)) is float}
    assert set(learner.numbers) == floats
    assert set(numbers_of(learner, 0.5)) == {*floats, "random_starts"}
    one, other = (experiment(name, halved).program for halved in (False, True))
    assert one.lowered_init.as_text() == other.lowered_init.as_text()
    assert one.lowered_iterate.as_text() == other.lowered_iterate.as_text()


def test_where_there_is_no_number_the_program_is_another():
    without = replace(PPO, task_encoder_learning_rate=None)
    assert set(PPO.numbers) - set(without.numbers) == {"task_encoder_learning_rate"}
    assert "random_starts" not in numbers_of(PPO, 0.0)


def test_a_learner_that_names_none_gets_none():
    class Plain(FakeConfig):
        traced = ()

    assert FakeConfig(rate=0.5).numbers == {"rate": 0.5} and Plain(rate=0.5).numbers == {}
    changed = FakeConfig(rate=0.5).with_numbers({"rate": "anything"})
    assert (changed.rate, type(changed), changed.discount) == ("anything", FakeConfig, 0.9)


@pytest.mark.slow
def test_a_lane_learns_what_its_number_as_a_constant_does():
    rates, seeds = (1e-2, 5e-2), (3, 3)
    env = TaskEnv(ProbeEnv(), experiment("ppo").table)
    agent, keys = make_given(make_agent, env, FakeConfig(rate=7.0), 5, 1), stream_keys(seeds, TRAINING)

    def trained(agent, keys, given):
        def train(key, env_params):
            state = agent.init(key, env_params)
            return jax.lax.scan(lambda state, _: agent.iterate(state, env_params), state, length=3)

        return jax.device_get(jax.jit(jax.vmap(train, (0, OVER_SEEDS)))(keys, given)[0].params)

    lanes = trained(agent, keys, params_of_seeds(env, seeds, numbers=[{"rate": rate} for rate in rates]))
    for lane, rate in enumerate(rates):
        alone = trained(make_agent(config=FakeConfig(rate=rate)), keys[lane:][:1], params_of_seeds(env, seeds[:1]))
        own = jax.tree.map(lambda x, lane=lane: x[lane : lane + 1], lanes)
        chex.assert_trees_all_close(own, alone, rtol=1e-6)
    assert not np.allclose(*lanes["params"]["w"])


def test_the_optimiser_takes_arguments():
    """As constants they give the same steps, and the same structure of its state."""
    params = {"params": {"task_encoder": {"w": np.ones(3, np.float32)}, "actor": {"w": np.ones(2, np.float32)}}}
    gradients = jax.tree.map(lambda x: 0.1 * np.arange(1, 1 + x.size, dtype=np.float32), params)

    def stepped(rate, norm, epsilon, own):
        optimizer = clipped_adam(rate, norm, 10, True, epsilon, own)
        updates, state = optimizer.update(gradients, optimizer.init(params), params)
        return optimizer.update(gradients, state, updates)

    numbers = (1e-2, 0.2, 1e-3, 1e-4)
    constants, arguments = jax.jit(lambda: stepped(*numbers))(), jax.jit(stepped)(*numbers)
    chex.assert_trees_all_close(arguments, constants, rtol=1e-6)
