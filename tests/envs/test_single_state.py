"""The world with one state: what holds is what was chosen."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.registry import make
from envs.single_state import SingleState, SingleStateConfig


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
