"""PPO with context: the update sees the window that acted, memory is learnt and kept."""

import dataclasses

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents import ppo
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context import ContextConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.advantages import generalised_advantages
from tests.agents import sizes
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


values = []  # of the learner's last iterations: (value, next_value, ended), each [T, N]


@pytest.fixture(scope="module")
def learner():
    """Environment, agent, and the agent's functions compiled once for all tests of the default settings."""
    env, agent = make()

    def spy(reward, value, next_value, terminated, truncated, *constants):
        jax.debug.callback(lambda *arrays: values.append(arrays), value, next_value, terminated | truncated)
        return generalised_advantages(reward, value, next_value, terminated, truncated, *constants)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ppo, "generalised_advantages", spy)
        key, given = jax.eval_shape(jax.random.key, 0), env.make_params(0)
        iterate = jax.jit(agent.iterate).lower(jax.eval_shape(agent.init, key, given), given).compile()
    init = jax.jit(agent.init)
    return env, agent, lambda key: init(key, given), lambda state: iterate(state, given)


def test_the_update_sees_the_window_that_acted(learner):
    """Ratio 1 in every iteration, across the ends of episodes and of rollouts; windows fit their episodes."""
    _, _, init, iterate = learner
    state = init(jax.random.key(0))
    for _ in range(3):
        state, metrics = iterate(state)
        assert metrics.episodes.successes > 0 and metrics.episodes.timeouts > 0
        assert abs(metrics.scalars["kl"]) < 1e-6 and metrics.scalars["clip_fraction"] == 0
        age = np.minimum(state.episodes.elapsed, CONTEXT.length)  # nothing is left of the episode before
        np.testing.assert_array_equal(state.carry.valid.sum(axis=1), age)


def test_the_value_after_a_step_is_that_of_the_window_after_the_step(learner):
    """Within an episode the next state is valued twice: after the step that led there, and before the next."""
    _, _, init, iterate = learner
    jax.block_until_ready(iterate(init(jax.random.key(0))))
    jax.effects_barrier()
    value, next_value, ended = map(np.asarray, values[-1])
    goes_on = ~ended[:-1]
    np.testing.assert_allclose(next_value[:-1][goes_on], value[1:][goes_on], atol=1e-5)
    assert np.abs(next_value[:-1] - value[1:])[~goes_on].max() > 1e-3  # another episode's value is another


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
    env, agent = make(network=SMALL, **published)
    given = env.make_params(0)
    state = jax.jit(begun_quickly(agent).init)(jax.random.key(0), given)
    iterate = jax.jit(agent.iterate)
    for _ in range(2):
        state, metrics = iterate(state, given)
        assert (abs(metrics.scalars["kl"]) < 1e-6) == aligned
    assert state.carry.valid.all() and (state.episodes.elapsed == 0).any()


def test_a_task_that_needs_memory_is_learnt_and_evaluation_remembers_too(learner):
    env, agent, init, iterate = learner
    state = init(jax.random.key(0))
    for _ in range(100):
        state, metrics = iterate(state)
    assert metrics.episodes.successes >= 0.95 * metrics.episodes.episodes

    success = success_by_memory(env, agent, EPISODE_LENGTH)
    assert success(state.params, True) >= 0.98
    assert success(state.params, False) < 0.7


def test_a_checkpoint_holds_the_windows(learner, tmp_path):
    _, _, init, iterate = learner
    state, _ = iterate(init(jax.random.key(0)))
    with Checkpoints(tmp_path) as checkpoints:
        checkpoints.save(1, state, {})
        _, restored = checkpoints.restore(jax.eval_shape(lambda: state))
    assert restored.carry.valid.any() and not restored.carry.valid.all()
    chex.assert_trees_all_equal(restored.carry, state.carry)
    resumed, straight = (iterate(jax.tree.map(jnp.asarray, start))[0] for start in (restored, state))
    chex.assert_trees_all_equal(resumed.carry, straight.carry)
    chex.assert_trees_all_equal(resumed.params, straight.params)
