"""The world with one state: what holds is what was chosen."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from envs.registry import make
from t2tl_jax.training.episodes import advance, begin

from envs.single_state import EPISODE_LENGTH, SingleState, SingleStateConfig
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv


def test_the_action_is_the_label():
    env = make("SingleState")
    state = env.reset(jax.random.key(0))
    assert not env.labels(state).any() and state.obs.shape == (env.observation_size,) == (0,)
    for action in range(env.num_actions):
        state = jax.jit(env.step)(state, jnp.int32(action))
        np.testing.assert_array_equal(env.labels(state), np.arange(4) == action)
        assert state.reward == state.done == 0


def test_reset_and_step_have_one_structure():
    env = SingleState(SingleStateConfig(("a", "b")))
    state = jax.eval_shape(env.reset, jax.random.key(0))
    after = jax.eval_shape(env.step, state, jnp.int32(0))
    assert jax.tree.map(lambda x: (x.shape, x.dtype), state) == jax.tree.map(lambda x: (x.shape, x.dtype), after)
    assert env.propositions == ("a", "b") and env.num_actions == 2


@pytest.mark.parametrize("propositions", [(), ("a", "a")])
def test_propositions_have_different_names(propositions):
    with pytest.raises(ValueError, match="different names"):
        SingleStateConfig(propositions)


def test_an_episode_has_at_most_75_steps():
    """The original's longest has 76: it ends when more than 75 steps were taken."""
    world = SingleState(SingleStateConfig(("a", "b")))
    env = TaskEnv(world, compile_tasks("F b", world.propositions, world.alphabet))
    first = begin(env, jax.random.key(0), EPISODE_LENGTH)

    def step(episode, key):
        return advance(env, episode, jnp.int32([0]), key, EPISODE_LENGTH, 0.9)

    _, outcomes = jax.jit(lambda: jax.lax.scan(step, first, jax.random.split(jax.random.key(1), 160)))()
    np.testing.assert_array_equal(np.flatnonzero(outcomes.truncated) + 1, [75, 150])
    np.testing.assert_array_equal(outcomes.totals.length[outcomes.truncated], 75)
