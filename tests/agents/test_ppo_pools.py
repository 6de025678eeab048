"""PPO on tasks that change: one compilation, episodes of the new tasks only, padding without any influence."""

import dataclasses

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.ltl import compile_pool, compile_tasks, named_task
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.single_state import EPISODE_LENGTH, SingleState
from t2tl_jax.task_env import TaskEnv, TaskParams
from tests.agents.sizes import GRAPH
from tests.parameters import begun_quickly

NETWORK = NetworkConfig(
    task_encoder=GRAPH,
    env_layers=(),
    actor_layers=(),
    critic_layers=(),
)
PPO = PPOConfig(
    network=NETWORK, num_envs=8, unroll_length=16, epochs=1, minibatch_size=64, discount=0.9, learning_rate=3e-3
)


def pool(number):
    env = SingleState()
    return compile_pool("Until_1_2_1_1", env.propositions, env.alphabet, number, size=8, rows=64, length=14)


@pytest.fixture(scope="module")
def learner():
    """(agent, init, iterate, restart), compiled once for both tests."""
    agent = begun_quickly(make_ppo(TaskEnv(SingleState(), pool("evaluation")), PPO, 20, iterations=10))
    return agent, jax.jit(agent.init), jax.jit(agent.iterate), jax.jit(agent.restart)


@pytest.mark.slow
def test_tables_take_turns_in_one_program(learner):
    agent, init, iterate, restart = learner
    state = init(jax.random.key(0), TaskParams((), pool("evaluation")))
    for number in range(3):
        before, key, given = state.params, state.key, TaskParams((), pool(number))
        state = restart(state, given)
        chex.assert_trees_all_equal(state.params, before)
        assert (state.episodes.elapsed == 0).all()
        assert jax.random.key_data(state.key).tolist() != jax.random.key_data(key).tolist()
        rows = np.asarray(state.episodes.state.pipeline_state.row)
        assert set(rows) <= set(np.asarray(given.table.initial_row)) and len(set(rows)) > 1
        for _ in range(2):
            state, metrics = iterate(state, given)
        assert metrics.episodes.episodes > 0 and all(np.isfinite(x) for x in metrics.scalars.values())
    assert state.iteration == 6
    assert iterate._cache_size() == restart._cache_size() == 1  # traced and compiled once each
    assert jax.eval_shape(agent.embed, state.params, pool(3)).shape == (64, 8)


@pytest.mark.slow
def test_left_over_rows_have_no_influence(learner):
    _, init, iterate, restart = learner
    table = pool(0)
    unused = jnp.arange(64) > np.flatnonzero(table.verdict == 0).max()
    assert unused.sum() > 10
    other = table.replace(
        tokens=jnp.where(unused[:, None], table.tokens[2], table.tokens),
        mask=jnp.where(unused[:, None], table.mask[2], table.mask),
        branches=tuple(jnp.where(unused, 0, branch) for branch in table.branches),
    )

    def one_iteration(tasks):
        given = TaskParams((), tasks)
        return iterate(restart(init(jax.random.key(1), given), given), given)[0]

    one, same = one_iteration(table), one_iteration(other)
    chex.assert_trees_all_equal(one.params, same.params)
    chex.assert_trees_all_equal(one.episodes, same.episodes)


def test_a_random_start_among_open_rows_never_takes_a_left_over_one():
    env = TaskEnv(SingleState(), pool(0), random_starts=1.0)
    state = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 500))
    assert (env.table.verdict[state.pipeline_state.row] == 0).all()


@pytest.mark.slow
def test_pretraining_learns_phi_zone_quickly():
    """A small network; the published one needs 200,000 frames with its schedule to get to 3.15 steps."""
    env = SingleState()
    table = compile_tasks([named_task("phi_zone")], env.propositions, env.alphabet)
    config = dataclasses.replace(
        PPO,
        num_envs=64,
        unroll_length=32,
        epochs=4,
        minibatch_size=512,
        gae_lambda=0.5,
        entropy_coefficient=0.01,
        staggered_start=False,
    )
    given = TaskParams((), table)
    agent = make_ppo(TaskEnv(env, table), config, EPISODE_LENGTH, iterations=30)
    state, iterate = jax.jit(agent.init)(jax.random.key(0), given), jax.jit(agent.iterate)
    for _ in range(30):
        state, metrics = iterate(state, given)
    totals = metrics.episodes
    assert totals.successes == totals.episodes and totals.length / totals.episodes < 3.2  # at random 12
