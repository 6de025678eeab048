"""What trainers rely on, of LetterWorld and FlatWorld alike: structure, keys, vmap, and both learners."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.flatworld import FlatWorld, FlatWorldConfig
from envs.letterworld import LetterWorld, LetterWorldConfig
from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import TaskEnv
from tests.agents import sizes

TASKS = {"letterworld": "!a U (b | c | d | e)", "flatworld": "F ((Red & Magenta) & F Yellow)"}


@pytest.fixture(scope="module", params=["letterworld", "flatworld"])
def env(request) -> LabelledEnv:
    if request.param == "letterworld":
        return LetterWorld(LetterWorldConfig(pool_size=16))
    return FlatWorld(FlatWorldConfig(pool_size=16))


@pytest.fixture(scope="module")
def task_env(env, request):
    task = TASKS["letterworld" if isinstance(env, LetterWorld) else "flatworld"]
    return TaskEnv(env, compile_tasks([task], env.propositions, env.alphabet))


def describe(tree):
    """Shapes, dtypes and weak types."""
    return jax.tree.map(lambda x: (x.shape, str(x.dtype), jax.typeof(x).weak_type), tree)


@pytest.mark.parametrize("double", [False, True])
def test_reset_and_step_have_one_structure(env, double):
    with jax.enable_x64(double):
        state = jax.eval_shape(env.reset, jax.random.key(0))
        after = jax.eval_shape(env.step, state, jnp.int32(0))
        labels = jax.eval_shape(env.labels, after)
    assert jax.tree.structure(state) == jax.tree.structure(after) and describe(state) == describe(after)
    assert state.obs.shape == (env.observation_size,) and state.obs.dtype == jnp.float32
    assert labels.shape == (len(env.propositions),) and labels.dtype == jnp.bool_
    assert state.info == {} and state.metrics == {}


@pytest.mark.slow
def test_vmap_and_jit_change_nothing(env):
    keys, actions = jax.random.split(jax.random.key(0), 4), jnp.arange(4)
    together = jax.jit(jax.vmap(env.step))(jax.jit(jax.vmap(env.reset))(keys), actions)
    labels = jax.jit(jax.vmap(env.labels))(together)
    for i in range(4):
        alone = env.step(env.reset(keys[i]), actions[i])
        # To rounding: XLA may contract a product and a sum.
        jax.tree.map(lambda one, many, i=i: np.testing.assert_allclose(one, many[i], atol=1e-6), alone, together)
        np.testing.assert_array_equal(env.labels(alone), labels[i])


def test_typed_and_legacy_keys_give_the_same_reset(env):
    typed, legacy = env.reset(jax.random.key(5)), env.reset(jax.random.PRNGKey(5))
    jax.tree.map(np.testing.assert_array_equal, typed, legacy)
    assert not all(np.array_equal(typed.obs, env.reset(jax.random.key(seed)).obs) for seed in (6, 7, 8))


def make_agent(kind: str, task_env: TaskEnv):
    if kind == "ppo":
        network = NetworkConfig(task_encoder=OneHotConfig(), env_layers=(8,), actor_layers=(8,), critic_layers=(8,))
        return make_ppo(task_env, dataclasses.replace(sizes.PPO, network=network), episode_length=75, iterations=2)
    network = QNetworkConfig(task_encoder=OneHotConfig(), state_layers=(8,), task_layer=8)
    small = DQNConfig(network=network, num_envs=4, unroll_length=32, batch_size=8, buffer_size=512, learning_starts=16)
    return make_dqn(task_env, small, episode_length=75, iterations=2)


def learner_of(env: TaskEnv, trained: bool) -> str:
    """Each learner trains in one world, which compiles long, and is traced with the other one, which does not."""
    return "ppo" if isinstance(env.env, LetterWorld) == trained else "dqn"


def test_a_learner_takes_it(task_env):
    """Traced, which finds what does not fit."""
    kind = learner_of(task_env, trained=False)
    agent, given = make_agent(kind, task_env), task_env.make_params(0)
    state = jax.eval_shape(agent.init, jax.random.key(0), given)
    after, metrics = jax.eval_shape(agent.iterate, state, given)
    assert jax.tree.structure(after) == jax.tree.structure(state) and metrics.episodes.episodes.shape == ()


@pytest.mark.slow
def test_an_iteration_trains(task_env):
    kind = learner_of(task_env, trained=True)
    agent, given = make_agent(kind, task_env), task_env.make_params(0)
    before = jax.jit(agent.init)(jax.random.key(0), given)
    after, _ = jax.jit(agent.iterate)(before, given)
    moved = jax.tree.map(lambda a, b: float(jnp.abs(a - b).max()), before.params, after.params)
    assert max(jax.tree.leaves(moved)) > 0 and all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(after.params))
