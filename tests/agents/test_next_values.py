"""V(s') of a rollout: mostly the V(s) of the next step, with the values that a pass over every s' gives."""

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents import ppo
from t2tl_jax.agents.next_values import at_steps, last_steps, segment_and_place, values_of_next
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.agents.ppo_learning import in_parts, in_segments
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import TaskEnv
from tests.parameters import begun_quickly
from tests.probe import ProbeEnv

CONTEXTS = {
    "none": None,
    "window": ContextConfig(length=3, segment_length=4, reader=GRUConfig(width=4, output=2)),
    "carried": ContextConfig(segment_length=4, reader=GRUConfig(width=4, output=2), carried=True),
}


def test_time_outs_and_the_last_step_are_found():
    truncated = np.zeros((10, 4), bool)
    truncated[[0, 3, 6], 0] = truncated[4, 1] = truncated[9, 2] = True
    found = last_steps(jnp.asarray(truncated), episode_length=3)
    np.testing.assert_array_equal(found.T, [[0, 3, 6, 9], [4, 9, 9, 9], [9, 9, 9, 9], [9, 9, 9, 9]])
    assert last_steps(jnp.asarray(truncated), episode_length=50).shape == (2, 4)
    np.testing.assert_array_equal(last_steps(jnp.ones((1, 2), bool), episode_length=50), [[0, 0]])


def test_every_other_value_is_that_of_the_next_step():
    rng = np.random.default_rng(0)
    value, after = rng.normal(size=(12, 3)), rng.normal(size=(12, 3))
    truncated = np.zeros((12, 3), bool)
    truncated[[1, 6, 11], [0, 0, 1]] = True
    steps = last_steps(jnp.asarray(truncated), episode_length=5)
    found = values_of_next(jnp.asarray(value), at_steps(jnp.asarray(after), steps), steps)
    expected = np.concatenate([value[1:], after[-1:]])
    expected[truncated] = after[truncated]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_segments_hold_the_steps_that_they_are_said_to_hold():
    config = PPOConfig(num_envs=3, unroll_length=8, minibatch_size=8, network=NetworkConfig(context=CONTEXTS["window"]))
    number = jnp.arange(8 * 3).reshape(8, 3)  # of a step: time x 3 + environment
    steps = jnp.array([[0, 5, 7], [7, 7, 7]])
    which, place = segment_and_place(config, steps)
    held = in_segments(config, number)[which]
    np.testing.assert_array_equal(held[jnp.arange(6), place.reshape(-1)], (steps * 3 + jnp.arange(3)).reshape(-1))


@pytest.mark.parametrize("count", [2, 3, 6, 7])
def test_parts_are_filled_up_and_cut_again(count):
    config = PPOConfig(
        num_envs=6, unroll_length=8, minibatch_size=24, network=NetworkConfig(context=CONTEXTS["window"])
    )
    x = jnp.arange(count * 4.0).reshape(count, 4)
    widths = set()

    def function(x):
        widths.add(len(x))
        return 2 * x

    np.testing.assert_array_equal(in_parts(config, function, x), 2 * x)
    assert widths == {min(count, 6)}  # as many segments as a minibatch has


@pytest.mark.slow
@pytest.mark.parametrize("context", CONTEXTS)
def test_an_iteration_learns_what_it_would_from_a_pass_over_every_next_state(context, monkeypatch):
    """Time-outs after six steps, so that a rollout of sixteen has several of each environment."""
    world = ProbeEnv()
    env = TaskEnv(world, compile_tasks(["F(Up & F Down)"], world.propositions, world.alphabet))
    network = NetworkConfig(
        task_encoder=OneHotConfig(), env_layers=(8,), actor_layers=(), critic_layers=(8,),
        context=CONTEXTS[context],
    )  # fmt: skip
    config = PPOConfig(network=network, num_envs=4, unroll_length=16, minibatch_size=32, epochs=1, adam_epsilon=1e-3)
    given = env.make_params(0)

    def make():
        return ppo.make_ppo(env, config, 6, iterations=10)

    start = jax.jit(begun_quickly(make()).init)(jax.random.key(0), given)

    def after_two():
        iterate = jax.jit(make().iterate)
        state, metrics = iterate(start, given)
        assert metrics.episodes.timeouts > 0
        return iterate(state, given)[0].params

    few = after_two()
    monkeypatch.setattr(
        ppo, "last_steps", lambda truncated, limit: jnp.tile(jnp.arange(16)[:, None], (1, truncated.shape[1]))
    )
    chex.assert_trees_all_close(few, after_two(), atol=1e-5)
    assert max(jax.tree.leaves(jax.tree.map(lambda x, y: float(jnp.abs(x - y).max()), start.params, few))) > 1e-4
