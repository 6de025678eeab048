"""Pools that take turns: what a row means stays as long as an episode can be in it."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments import configs  # noqa: F401, registers
from t2tl_jax.ltl import compile_pool
from t2tl_jax.ltl.turns import in_turns
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs.config import PoolConfig
from t2tl_jax.runs.pools import make_pools
from t2tl_jax.single_state import SingleState, SingleStateConfig
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.unroll import Player, begin, unroll

ENV = SingleState()
ROWS = 24


def pool(number):
    return compile_pool("Until_1_2_1_1", ENV.propositions, ENV.alphabet, number, size=4, rows=ROWS, length=14)


def table(number):
    return in_turns(pool(number), pool(number - 1) if number else None, number)


def same(a, b):
    jax.tree.map(np.testing.assert_array_equal, a, b)


@pytest.mark.slow
def test_every_row_says_and_becomes_what_it_did_in_its_pool():
    for number in (0, 1, 2):
        joined = table(number)
        assert joined.num_rows == 2 * ROWS - 2
        for pool_number in (number, number - 1)[: 1 + (number > 0)]:
            own, offset = pool(pool_number), (ROWS - 2) * (pool_number % 2)
            for row in np.flatnonzero(own.is_open).tolist():
                there = row + offset
                assert joined.text(there) == own.text(row) and joined.is_open[there]
                after = np.asarray(own.next_row[row])
                np.testing.assert_array_equal(joined.next_row[there], np.where(after < 2, after, after + offset))
            assert joined.starts[2 + offset : ROWS + offset].sum() == (
                own.is_open.sum() if pool_number == number else 0
            )
        assert [joined.text(row) for row in joined.initial_row] == [
            pool(number).text(row) for row in pool(number).initial_row
        ]
        assert joined.starts[joined.initial_row].all() and not (joined.starts & ~joined.is_open).any()
    assert not table(0).is_open[ROWS:].any()


@pytest.mark.slow
def test_an_episode_under_way_gets_the_same_rewards_across_a_renewal():
    """Random actions, the same ones with and without the renewal; new episodes have new tasks."""
    env = TaskEnv(ENV, pool(0), random_starts=0.3)
    player = Player(lambda carry, state, key: (jax.random.randint(key, state.done.shape, 0, 4), carry, ()))
    steps, limit = 3, 30

    @jax.jit
    def play(before, tasks, key):
        return unroll(
            env, TaskParams((), tasks), player, before, (), key, steps, limit, 0.9,
            lambda step: (step.row, step.reward, step.terminated, step.turn, step.totals),
        )  # fmt: skip

    given = TaskParams((), table(1))
    start = jax.jit(lambda key: begin(env, given, key, 1000, limit))(jax.random.key(0))
    start, _, _ = play(start, table(1), jax.random.key(1))
    with_renewal, _, renewed = play(start, table(2), jax.random.key(2))
    _, _, kept = play(start, table(1), jax.random.key(2))
    under_way = renewed[3] == start.turn
    assert under_way.all(axis=0).any() and (renewed[1][under_way] > 0).sum() > 20 and (renewed[1][under_way] < 0).any()
    for a, b in zip(jax.tree.leaves(renewed), jax.tree.leaves(kept), strict=True):
        np.testing.assert_array_equal(np.where(under_way, a, 0), np.where(under_way, b, 0))
    # What began since then is of the new pool, random starts included.
    new = with_renewal.turn > start.turn
    assert table(2).starts[with_renewal.state.pipeline_state.row[new]].all()
    assert not table(2).starts[with_renewal.state.pipeline_state.row[~new]].any()


def test_a_resumed_training_meets_the_same_tables():
    config = dataclasses.replace(
        named_config("pretrain_zone"), task="Until_1_2_1_1",
        pool=PoolConfig(size=2, rows=16, length=14, finish=True, period=100),
    )  # fmt: skip
    env = make_env(SingleStateConfig())
    pools = make_pools(config, env)
    tables = [pools.training(number) for number in range(4)]
    same(make_pools(config, env).training(3), tables[3])
    alone = make_pools(dataclasses.replace(config, pool=dataclasses.replace(config.pool, finish=False)), env)
    assert jax.tree.map(jnp.shape, tables[0]) == jax.tree.map(jnp.shape, tables[3])
    assert [tables[3].text(row) for row in tables[3].initial_row] == [
        alone.training(3).text(row) for row in alone.training(3).initial_row
    ]


def test_pools_that_change_too_soon_to_finish_are_refused():
    config = named_config("pretrain_zone")
    config = dataclasses.replace(config, pool=PoolConfig(period=1, finish=True), episode_length=1000)
    with pytest.raises(ValueError, match=r"episodes of up to 1000 steps cannot finish.*set pool.period to"):
        make_pools(config, make_env(SingleStateConfig()))


def test_a_random_start_is_in_any_open_row_of_the_present_pool():
    env = TaskEnv(ENV, pool(0), random_starts=1.0)
    tasks = TaskParams((), table(1))
    state = jax.jit(jax.vmap(lambda key: env.reset(key, tasks)))(jax.random.split(jax.random.key(0), 4000))
    counts = np.bincount(state.pipeline_state.row, minlength=2 * ROWS - 2)
    possible = np.asarray(table(1).starts)
    expected = 4000 / possible.sum()
    assert not counts[~possible].any()
    assert (abs(counts[possible] - expected) < 5 * np.sqrt(expected)).all()
