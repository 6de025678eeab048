"""Learning by dynamic programming: its values are those of the world that is played in, and the network learns them."""

import dataclasses
from functools import partial
from itertools import combinations

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents import row_codes
from t2tl_jax.agents.dp import make_dp, solve
from t2tl_jax.agents.dp_config import DPConfig
from t2tl_jax.ltl import compile_pool, compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.single_state import SingleState, SingleStateConfig
from t2tl_jax.task_env import TaskEnv
from tests.agents.sizes import GRAPH, GRU
from tests.parameters import begun_quickly
from tests.probe import DiscreteProbeEnv

COLOURS = ("a", "b", "c", "d")
FORMULAS = (
    *("F(a & F b)", "(!b & !c) U (a & F(d & (!a U b)))", "F a & F b & F c"),
    *("(!a U b) | F(c & F d)", "!a U (b & X c)"),
)
DISCOUNT = 0.9
NETWORK = NetworkConfig(task_encoder=GRU, env_layers=(), actor_layers=(), critic_layers=())


def world(offered, formulas=FORMULAS):
    env = SingleState(SingleStateConfig(COLOURS, offered))
    if isinstance(formulas, str):
        return TaskEnv(env, compile_pool(formulas, COLOURS, env.alphabet, 0, size=12, rows=48, length=24))
    return TaskEnv(env, compile_tasks(list(formulas), COLOURS, env.alphabet))


def slowly(table, offered):
    """Value iteration in plain Python, over every set of propositions that can be offered."""
    following, verdict = (np.asarray(x) for x in (table.automaton().next_row, table.verdict))
    letters = [table.automaton().letter(name) for name in ([colour] for colour in COLOURS)] + [0]
    sets = [(*chosen, 4) for chosen in combinations(range(4), offered)] if offered else [(0, 1, 2, 3)]
    value = np.zeros(len(verdict))
    for _ in range(400):
        after = following[:, letters]  # [rows, actions]
        worth = verdict[after] + DISCOUNT * np.where(verdict[after] == 0, value[after], 0)
        value = np.where(verdict == 0, np.mean([worth[:, list(one)].max(axis=1) for one in sets], axis=0), 0)
    return worth, value


@pytest.mark.parametrize("offered", [0, 1, 2, 4])
def test_values_are_those_of_every_set_that_can_be_offered(offered):
    table = world(offered).table
    solution = jax.jit(partial(solve, offered=offered, discount=DISCOUNT))(table)
    worth, value = slowly(table, offered)
    is_open = np.asarray(table.is_open)
    np.testing.assert_allclose(solution.value, value, atol=1e-4)
    np.testing.assert_allclose(solution.action_value[is_open], worth[is_open], atol=1e-4)


@pytest.mark.parametrize("offered", [0, 2])
def test_who_plays_by_the_values_gets_them_in_the_world_itself(offered):
    env = world(offered)
    solution = solve(env.table, offered, DISCOUNT)

    def play(key):
        def step(carry, _):
            state, left, alive = carry
            row = env.row(state)
            worth = solution.action_value[row][: env.env.num_actions]
            if offered:
                worth = jnp.where(jnp.append(state.obs > 0, True), worth, -jnp.inf)
            state = env.step(state, worth.argmax())
            return (state, left * DISCOUNT, alive * (1 - state.done)), alive * left * state.reward

        state = env.reset(key)
        start = env.row(state)
        _, paid = jax.lax.scan(step, (state, jnp.float32(1), jnp.float32(1)), length=60)
        return start, paid.sum()

    starts, returns = jax.jit(jax.vmap(play))(jax.random.split(jax.random.key(0), 8192))
    for row in np.unique(starts):
        of = np.asarray(returns)[np.asarray(starts) == row]
        assert len(of) > 500
        assert abs(of.mean() - solution.value[row]) < 4 * of.std() / len(of) ** 0.5 + 2e-3


def learner(env, iterations, **fields):
    config = DPConfig(**({"network": NETWORK, "learning_rate": 1e-2, "discount": DISCOUNT} | fields))
    return begun_quickly(make_dp(env, config, 75, iterations))


def trained(env, agent, iterations, key=0):
    given = env.make_params(0)
    state = jax.jit(agent.init)(jax.random.key(key), given)
    state, metrics = jax.jit(
        lambda state: jax.lax.scan(lambda s, _: agent.iterate(s, given), state, length=iterations)
    )(state)
    return state, metrics


@pytest.mark.slow
def test_the_network_comes_to_act_by_these_values():
    """Each gradient step draws its offers anew; here it is asked for all that there are."""
    env, iterations = world(2, "Until_1_2_1_1"), 300
    agent = learner(env, iterations)
    state, metrics = trained(env, agent, iterations)
    scalars = jax.tree.map(np.asarray, metrics.scalars)
    assert scalars["agreement"][:5].mean() < 0.8 and scalars["agreement"][-20:].mean() > 0.98
    assert scalars["value_loss"][-20:].mean() < 1e-3 and not np.asarray(metrics.episodes.episodes).any()

    solution, codes = solve(env.table, 2, DISCOUNT), agent.embed(state.params, env.table)
    rows = np.flatnonzero(env.table.is_open)
    chances = []
    for chosen in combinations(range(4), 2):
        obs = jnp.zeros(4).at[jnp.array(chosen)].set(1.0)
        act = partial(agent.act, state.params, codes, (), obs)
        free = np.array([*chosen, 4])
        worth = np.asarray(solution.action_value)[rows][:, free]
        taken = [int(act(row, jax.random.key(0), True)) for row in rows]
        chances += [
            one in free and solution.action_value[row, one] >= best - 0.02
            for row, one, best in zip(rows, taken, worth.max(axis=1), strict=True)
        ]
    assert np.mean(chances) > 0.97


@pytest.mark.slow
def test_seeds_beside_each_other_learn_what_each_learns_alone():
    env = world(2)
    agent, given = learner(env, 3), env.make_params(0)
    keys = jax.random.split(jax.random.key(1), 2)

    def run(key):
        state = agent.init(key, given)
        return jax.lax.scan(lambda s, _: agent.iterate(s, given), state, length=3)[0].params

    together, alone = jax.jit(jax.vmap(run))(keys), [jax.jit(run)(key) for key in keys]
    chex.assert_trees_all_close(together, jax.tree.map(lambda *x: jnp.stack(x), *alone), atol=1e-5)


@pytest.mark.slow
def test_rows_of_large_tables_are_learned_from_as_those_of_small_ones(monkeypatch):
    env = world(2, "Until_1_2_1_1")
    small, _ = trained(env, learner(env, 2, minibatch_size=20), 2)
    monkeypatch.setattr(row_codes, "ROWS_AT_ONCE", 8)
    monkeypatch.setattr(row_codes, "LARGE", 8)
    large, _ = trained(env, learner(env, 2, minibatch_size=20), 2)
    chex.assert_trees_all_close(small.params, large.params, atol=1e-4)


def test_a_frozen_reader_stays_as_it_is():
    env = world(0)
    agent = learner(env, 1, network=dataclasses.replace(NETWORK, task_encoder=GRAPH, freeze_task_encoder=True))
    given = env.make_params(0)
    before = jax.jit(agent.init)(jax.random.key(0), given)
    after, _ = jax.jit(agent.iterate)(before, given)
    old, new = before.params["params"], after.params["params"]
    chex.assert_trees_all_equal(old["task_encoder"], new["task_encoder"])
    assert (old["actor"]["logits"]["kernel"] != new["actor"]["logits"]["kernel"]).any()


def test_what_it_cannot_solve_is_refused():
    env = DiscreteProbeEnv()
    probe = TaskEnv(env, compile_tasks(["F Up"], env.propositions, env.alphabet))
    with pytest.raises(ValueError, match="world of a single state, single_state, and not DiscreteProbeEnv"):
        make_dp(probe, DPConfig(), 20, 1)
    with pytest.raises(ValueError, match="no context to read"):
        DPConfig(network=dataclasses.replace(NETWORK, context=ContextConfig()))
    with pytest.raises(ValueError, match="discount"):
        DPConfig(discount=1.0)
