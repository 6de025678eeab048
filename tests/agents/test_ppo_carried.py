"""PPO with a carried state: the update begins with the state that acted, and what was long ago is remembered."""

import dataclasses

import chex
import jax
import numpy as np
import pytest

from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.merged import MergedConfig
from t2tl_jax.networks.roles import RolesConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import TaskEnv
from tests.agents import sizes
from tests.agents.test_ppo_merged_context import ColouredCueEnv
from tests.agents.watched import check_resumed, check_values_after_steps, check_what_acted_is_learned_from, watched
from tests.parameters import begun_quickly
from tests.probe import CueEnv, success_by_memory

pytestmark = pytest.mark.slow  # every test waits for the compilation of a learner

EPISODE_LENGTH, DELAY = 10, 7
CONTEXT = ContextConfig(carried=True, reader=sizes.GRU, segment_length=8)
NETWORK = NetworkConfig(
    task_encoder=OneHotConfig(),
    env_layers=(16,),
    actor_layers=(16,),
    critic_layers=(),
    value_scale=1.0,
    context=CONTEXT,
)
# One minibatch: its probability ratios are those of the parameters that acted.
PPO = dataclasses.replace(sizes.PPO, num_envs=32, unroll_length=16, epochs=1, minibatch_size=512, learning_rate=1e-2)
ITERATIONS = 50


class LateCueEnv(CueEnv):
    """Decides so long after the cue that no short window holds it any more."""

    delay = DELAY


def make(network=NETWORK, probe=LateCueEnv, tasks=("!Down U Up",), **changes):
    env = TaskEnv(probe(), compile_tasks(tasks, probe.propositions, probe.alphabet))
    return env, make_ppo(env, dataclasses.replace(PPO, network=network, **changes), EPISODE_LENGTH, ITERATIONS)


@pytest.fixture(scope="module")
def learner():
    """That of the default settings."""
    return watched(*make())


def test_the_update_begins_with_the_state_that_acted(learner):
    def nothing_is_left_of_the_episode_before(state):
        np.testing.assert_array_equal(state.carry.state.any(axis=1), state.episodes.elapsed > 0)

    check_what_acted_is_learned_from(learner, nothing_is_left_of_the_episode_before)


def test_the_value_after_a_step_is_that_of_the_state_after_the_step(learner):
    check_values_after_steps(learner)


def test_a_cue_of_long_ago_is_learnt_and_only_by_the_state():
    """Chance is a half."""

    def trained(network):
        env, agent = make(network, num_envs=64, epochs=4, learning_rate=3e-3)
        given = env.make_params(0)
        state, iterate = jax.jit(agent.init)(jax.random.key(0), given), jax.jit(agent.iterate)
        for _ in range(ITERATIONS):
            state, metrics = iterate(state, given)
        return env, agent, state.params, metrics.episodes.successes / metrics.episodes.episodes

    env, agent, params, success = trained(NETWORK)
    played = success_by_memory(env, agent, EPISODE_LENGTH)
    assert success >= 0.95 and played(params, True) >= 0.98 and played(params, False) < 0.7
    *_, success = trained(dataclasses.replace(NETWORK, context=None))
    assert success < 0.7


def test_a_checkpoint_holds_the_states_and_a_resumed_run_goes_on_as_one_that_was_not(learner, tmp_path):
    assert check_resumed(learner, tmp_path).carry.state.any()


def test_states_of_objects_act_and_learn_alike_in_seeds_side_by_side():
    """Of merged states: ratio 1, the tokens are learnt, and a seed is the same beside another one."""
    network = dataclasses.replace(
        NETWORK, task_encoder=RolesConfig(propositions=2), state=MergedConfig(), actor_layers=()
    )
    env, agent = make(network, ColouredCueEnv, ("!Down U Up", "!Up U Down"))
    given = env.make_params(0)
    keys = jax.random.split(jax.random.key(0), 2)

    def play(key, over_seeds=lambda function: function):
        begun = state = jax.jit(over_seeds(lambda key: begun_quickly(agent).init(key, given)))(key)
        iterate, scalars = jax.jit(over_seeds(lambda state: agent.iterate(state, given))), []
        for _ in range(2):
            state, metrics = iterate(state)
            scalars.append(metrics.scalars)
        return begun.params, (state.params, state.carry.state), scalars

    both, one = play(keys, jax.vmap), play(keys[1])
    chex.assert_trees_all_close(jax.tree.map(lambda x: x[1], both), one, rtol=1e-4, atol=1e-5)
    begun, (params, carried), scalars = both
    for of_iteration in scalars:
        assert np.abs(of_iteration["kl"]).max() < 1e-6 and not of_iteration["clip_fraction"].any()
    assert carried.shape == (2, 32, 2, sizes.GRU.width) and carried.any(axis=(1, 3)).all()
    tokens, first = (x["params"]["context_encoder"]["token"]["kernel"] for x in (params, begun))
    assert np.abs(tokens - first)[:, 2:].max(axis=(0, 2)).min() > 1e-5  # a reward is the last of an episode
