"""PPO with discrete actions: the same learner with another distribution."""

import dataclasses

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.single_state import SingleState
from t2tl_jax.task_env import TaskEnv
from tests.agents import sizes
from tests.parameters import begun_quickly
from tests.probe import DiscreteProbeEnv

NETWORK = NetworkConfig(
    task_encoder=sizes.GRAPH,
    env_layers=(),
    actor_layers=(),
    critic_layers=(),
)
PPO = dataclasses.replace(sizes.PPO, network=NETWORK, entropy_coefficient=0.01)


@pytest.fixture(scope="module")
def probe():
    env = DiscreteProbeEnv()
    return TaskEnv(env, compile_tasks(["F(Up & F(Down & F Up))"], env.propositions, env.alphabet))


def train(env, agent, iterations):
    given = env.make_params(0)
    start, iterate = jax.jit(agent.init)(jax.random.key(0), given), jax.jit(agent.iterate)
    state = start
    for _ in range(iterations):
        state, metrics = iterate(state, given)
    return start, state, metrics


@pytest.mark.slow
def test_replaying_a_stored_rollout_gives_probability_ratio_one(probe):
    network = dataclasses.replace(NETWORK, task_encoder=OneHotConfig())  # compiles faster
    config = dataclasses.replace(PPO, network=network, epochs=1, minibatch_size=256, learning_rate=0.0)
    *_, metrics = train(probe, begun_quickly(make_ppo(probe, config, episode_length=20, iterations=1)), 1)
    assert metrics.episodes.episodes > 0
    assert abs(metrics.scalars["kl"]) < 1e-6 and metrics.scalars["clip_fraction"] == 0
    assert 0 < metrics.scalars["entropy"] <= np.log(3) + 1e-6


@pytest.mark.slow
def test_probe_is_solved_by_choosing_while_the_frozen_encoder_stays(probe):
    """A random encoder tells the three sub-tasks apart, so the other layers can learn from it."""
    network = dataclasses.replace(NETWORK, actor_layers=(16,), freeze_task_encoder=True)
    agent = make_ppo(probe, dataclasses.replace(PPO, network=network), episode_length=20, iterations=30)
    start, state, metrics = train(probe, agent, 30)
    assert metrics.episodes.length / metrics.episodes.episodes < 4.5  # optimal 3, at random about 9
    row = probe.table.initial_row[0]
    embedding = jax.jit(agent.embed)(state.params, probe.table)
    act = jax.jit(agent.act, static_argnums=6)
    action = act(state.params, embedding, (), jnp.ones(3), row, jax.random.key(0), True)
    assert action == 1 and action.dtype == jnp.int32  # Up
    start, after = start.params["params"], state.params["params"]
    chex.assert_trees_all_equal(start["task_encoder"], after["task_encoder"])
    assert (start["actor"]["logits"]["kernel"] != after["actor"]["logits"]["kernel"]).any()


def test_network_without_observation_has_one_linear_layer_each():
    env = SingleState()
    env = TaskEnv(env, compile_tasks(["F Red"], env.propositions, env.alphabet))
    agent = make_ppo(env, PPO, episode_length=20, iterations=1)
    params = jax.eval_shape(agent.init, jax.random.key(0), env.make_params(0)).params["params"]
    shapes = jax.tree.map(jnp.shape, {name: params[name] for name in ("actor", "critic")})
    chex.assert_trees_all_equal(
        shapes,
        {
            "actor": {"logits": {"kernel": (8, 4), "bias": (4,)}},
            "critic": {"value": {"kernel": (8, 1), "bias": (1,)}},
        },
    )
    assert set(params) == {"task_encoder", "actor", "critic"}
