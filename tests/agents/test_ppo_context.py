"""PPO with context: the update sees the window that acted, memory is learnt and kept."""

import dataclasses

import jax
import numpy as np
import pytest

from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import TaskEnv
from tests.agents import sizes
from tests.agents.watched import check_resumed, check_values_after_steps, check_what_acted_is_learned_from, watched
from tests.parameters import begun_quickly
from tests.probe import CueEnv, success_by_memory

pytestmark = pytest.mark.slow  # every test waits for the compilation of a learner

CONTEXT = ContextConfig(length=2, reader=sizes.TRANSFORMER)
NETWORK = NetworkConfig(
    task_encoder=OneHotConfig(),
    env_layers=(16,),
    actor_layers=(16,),
    critic_layers=(),
    value_scale=1.0,
    context=CONTEXT,
)
# One minibatch: its probability ratios are those of the parameters that acted.
PPO = dataclasses.replace(sizes.PPO, num_envs=32, unroll_length=8, epochs=1, minibatch_size=256, learning_rate=1e-2)
SMALL = dataclasses.replace(NETWORK, actor_layers=())  # compiles faster
EPISODE_LENGTH = 5


def make(iterations=100, network=NETWORK, **changes):
    probe = CueEnv()
    env = TaskEnv(probe, compile_tasks(["!Down U Up"], probe.propositions, probe.alphabet))
    network = dataclasses.replace(network, context=dataclasses.replace(CONTEXT, **changes))
    return env, make_ppo(env, dataclasses.replace(PPO, network=network), EPISODE_LENGTH, iterations)


@pytest.fixture(scope="module")
def learner():
    """That of the default settings."""
    return watched(*make())


def test_the_update_sees_the_window_that_acted(learner):
    def nothing_is_left_of_the_episode_before(state):
        age = np.minimum(state.episodes.elapsed, CONTEXT.length)
        np.testing.assert_array_equal(state.carry.valid.sum(axis=1), age)

    check_what_acted_is_learned_from(learner, nothing_is_left_of_the_episode_before)


def test_the_value_after_a_step_is_that_of_the_window_after_the_step(learner):
    check_values_after_steps(learner)


def test_a_gru_reads_the_window_that_acted():
    env, agent = make(network=SMALL, reader=sizes.GRU, segment_length=4)
    given = env.make_params(0)
    state, iterate = jax.jit(begun_quickly(agent).init)(jax.random.key(0), given), jax.jit(agent.iterate)
    for _ in range(3):
        state, metrics = iterate(state, given)
        assert metrics.episodes.timeouts > 0 and abs(metrics.scalars["kl"]) < 1e-6


@pytest.mark.parametrize("aligned", [True, False])
def test_published_windows_run_on_and_belong_to_other_samples(aligned):
    published = {"reset": False, "recompute": False, "aligned": aligned, "segment_length": 8 if aligned else 1}
    env, agent = make(network=SMALL, **published, first_token="made_up")
    given = env.make_params(0)
    state = jax.jit(begun_quickly(agent).init)(jax.random.key(0), given)
    iterate = jax.jit(agent.iterate)
    for _ in range(2):
        state, metrics = iterate(state, given)
        assert (abs(metrics.scalars["kl"]) < 1e-6) == aligned
    assert state.carry.valid.all() and (state.episodes.elapsed == 0).any()


def test_a_task_that_needs_memory_is_learnt_and_evaluation_remembers_too(learner):
    state = learner.init(jax.random.key(0))
    for _ in range(100):
        state, metrics = learner.iterate(state)
    assert metrics.episodes.successes >= 0.95 * metrics.episodes.episodes

    success = success_by_memory(learner.env, learner.agent, EPISODE_LENGTH)
    assert success(state.params, True) >= 0.98
    assert success(state.params, False) < 0.7


def test_a_checkpoint_holds_the_windows(learner, tmp_path):
    valid = check_resumed(learner, tmp_path).carry.valid
    assert valid.any() and not valid.all()
