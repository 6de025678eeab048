"""The world with one state: what holds is what was chosen."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.registry import make_env
from t2tl_jax.single_state import EPISODE_LENGTH, SingleState, SingleStateConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.unroll import Player, begin, unroll


def test_the_action_is_the_label():
    env = make_env("SingleState")
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
    params = env.make_params(0)
    idle = Player(lambda carry, state, key: (jnp.zeros(1, jnp.int32), carry, ()))

    def steps():
        episodes = begin(env, params, jax.random.key(0), 1, EPISODE_LENGTH)
        key = jax.random.key(1)
        return unroll(env, params, idle, episodes, (), key, 160, EPISODE_LENGTH, 0.9, keep=lambda step: step)[2]

    kept = jax.jit(steps)()
    truncated = np.asarray(kept.truncated)[:, 0]
    np.testing.assert_array_equal(np.flatnonzero(truncated) + 1, [75, 150])
    np.testing.assert_array_equal(np.asarray(kept.totals.length).reshape(160)[truncated], 75)


@pytest.fixture
def offering():
    """Four propositions, two of which are offered at a time."""
    return SingleState(SingleStateConfig(("a", "b", "c", "d"), offered=2))


def test_only_what_is_offered_can_be_chosen(offering):
    state, step = offering.reset(jax.random.key(0)), jax.jit(offering.step)
    assert (offering.num_actions, offering.observation_size) == (5, 4) and not offering.fixed_start
    for action in [*range(5), *range(5)]:
        offered = np.asarray(state.obs)
        state = step(state, jnp.int32(action))
        expected = (np.arange(4) == action) & (offered > 0)
        np.testing.assert_array_equal(offering.labels(state), expected)
        assert np.asarray(state.obs).sum() == 2 and set(np.asarray(state.obs)) <= {0.0, 1.0}


def test_every_pair_is_offered_as_often(offering):
    def offers(key):
        def step(state, _):
            return offering.step(state, jnp.int32(4)), state.obs

        return jax.lax.scan(step, offering.reset(key), None, 100)[1]

    seen = np.asarray(jax.jit(jax.vmap(offers))(jax.random.split(jax.random.key(1), 60))).reshape(-1, 4)
    pairs, counts = np.unique(seen, axis=0, return_counts=True)
    assert len(pairs) == 6 and (abs(counts / len(seen) - 1 / 6) < 0.02).all()  # 4 standard deviations


def test_typed_and_legacy_keys_give_the_same_offers(offering):
    typed, legacy = jax.random.key(3), jax.random.PRNGKey(3)
    jax.tree.map(np.testing.assert_array_equal, offering.reset(typed), offering.reset(legacy))
    assert SingleState().fixed_start


@pytest.mark.parametrize("offered", [-1, 3])
def test_no_more_than_there_is_can_be_offered(offered):
    with pytest.raises(ValueError, match=f"0 to 2 can be offered, got offered={offered}"):
        SingleStateConfig(("a", "b"), offered=offered)
