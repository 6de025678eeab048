"""A plan at play: the way that the critic values most, and nothing else where there is one way only."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents.plan import planning
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.env import LabelledEnv, State
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.episodes import play
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.lookahead import LookaheadConfig, LookaheadTaskEncoder
from t2tl_jax.networks.roles import RolesConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.types import Agent
from tests.agents.sizes import GRU, PPO, TRANSFORMER
from tests.parameters import parameters

PLACES = jnp.array([9, -1, -2])
"""Where a, b and c are on a line; the agent starts at 0."""

READER = LookaheadConfig(propositions=3, steps=2)


class Line(LabelledEnv):
    """A line on which each letter has one place; an action is a step to either side."""

    propositions, alphabet = ("a", "b", "c"), "at_most_one"
    observation_size, action_size, num_actions, backend = 1, 1, None, "none"

    def reset(self, rng, params=None):
        return self.at(jnp.float32(0))

    def step(self, state, action, params=None):
        return self.at(state.pipeline_state + jnp.sign(action[0]))

    def labels(self, state):
        return state.pipeline_state == PLACES

    def at(self, x):
        return State(x, x[None], jnp.float32(0), jnp.float32(0))


def wanted(code):
    """What a code says is to be touched now and then, bool[..., 2, 3]."""
    return code[..., :-1].reshape(*code.shape[:-1], 2, 2, 3)[..., 1, :] > 0


def act(params, embedding, carry, obs, row, key, deterministic):
    """Walks to the nearest of the letters that bring the task on."""
    gap = jnp.where(wanted(embedding[row])[..., 0, :], PLACES - obs, jnp.inf)
    nearest = jnp.abs(gap).argmin(axis=-1, keepdims=True)
    return jnp.take_along_axis(gap, nearest, axis=-1)


def value(params, embedding, carry, obs, row):
    """Minus the steps of the walk along the code's way."""
    told, at, steps = wanted(embedding[row]), obs, 0.0
    for k in range(2):
        gap = jnp.where(told[..., k, :], jnp.abs(PLACES - at), jnp.inf)
        some = told[..., k, :].any(axis=-1)
        steps = steps + jnp.where(some, gap.min(axis=-1), 0.0)
        at = jnp.where(some[..., None], PLACES[gap.argmin(axis=-1)][..., None], at)
    return -steps


def embed(params, table):
    return LookaheadTaskEncoder(READER).apply({}, table)


WALKER = Agent(None, None, embed, act, 1, value=value)
TRAP = "F a | F(b & F c)"


@pytest.mark.slow
def test_a_longer_way_is_taken_where_it_is_the_nearer_one():
    """One letter nine steps away, or two letters two steps away: the shortest way counts letters, the critic steps."""
    env = TaskEnv(Line(), compile_tasks([TRAP], Line.propositions, Line.alphabet))

    def played(agent):
        return jax.jit(lambda key: play(env, agent, {}, env.make_params(0), key, 2, 5, 0.9, True))(jax.random.key(0))

    plain, plan = played(WALKER), played(planning(WALKER, READER))
    assert not plain.success.any() and (plain.length == 5).all()
    assert plan.success.all() and (plan.length == 2).all()


@pytest.mark.slow
def test_a_choice_stands_until_another_way_is_worth_more_by_the_margin_or_the_row_changes():
    """The agent stands between a, and b with c behind it; the values are minus the steps."""
    table = compile_tasks([TRAP], Line.propositions, Line.alphabet)
    start = table.initial_row[0]
    plan = planning(WALKER, READER, margin=1.5)
    ahead = jax.jit(plan.embed)({}, table)
    act = jax.jit(lambda obs, kept: plan.act({}, ahead, kept, obs, start, None, True))
    to_a, by_b = ahead.whose[start, :2].tolist()
    kept, decided, decide = plan.begin(), [], jax.jit(plan.decide)
    for x in (3.0, 4.0, 5.0, 4.0, 3.0, 2.0):  # a is 9 - x steps away, b and c x + 2
        kept = decide({}, ahead, kept, jnp.array([x]), start)
        decided.append(int(kept.way))
        assert (act(jnp.array([x]), kept)[0] > 0) == (kept.way == to_a)
    assert decided == [by_b, by_b, to_a, to_a, to_a, by_b]  # at 4 and 3 the other one is worth 1 more
    after_b = table.progress(start, table.letter(jnp.array([False, True, False])))
    assert int(decide({}, ahead, kept, jnp.array([-1.0]), after_b).way) in ahead.whose[after_b].tolist()


@pytest.mark.slow
def test_of_one_way_the_policy_acts_bit_for_bit_and_of_several_as_under_the_best():
    """A policy with memory; what it remembers is the same for all ways."""
    config = NetworkConfig(
        task_encoder=RolesConfig(3), env_layers=(8,), actor_layers=(), critic_layers=(),
        context=ContextConfig(length=2, reader=GRU),
    )  # fmt: skip
    table = compile_tasks([TRAP], Line.propositions, Line.alphabet)
    agent = make_ppo(TaskEnv(Line(), table), dataclasses.replace(PPO, network=config), 20, 5)
    plan = planning(agent, config.task_encoder)
    size, keys = 64, jax.random.split(jax.random.key(1), 4)
    obs, row = jax.random.normal(keys[0], (size, 1)), jax.random.randint(keys[1], (size,), 2, table.num_rows)
    first = jax.tree.map(lambda x: jnp.broadcast_to(x, (size, *x.shape)), plan.begin())
    network = ActorCritic(config, 1)
    params = parameters(network, table, obs, row, first.carry, method="initialise")

    @jax.jit
    def prepared(params):
        seen = plan.remember(params, first, -obs, jnp.ones((size, 1)), jnp.zeros(size))
        ahead = plan.embed(params, table)
        ways = [jnp.full(size, k) for k in range(ahead.whose.shape[1])]
        worth = [agent.value(params, ahead.codes, seen.carry, obs, ahead.whose[row, way]) for way in ways]
        return agent.embed(params, table), ahead, plan.decide(params, ahead, seen, obs, row), jnp.stack(worth, 1)

    codes, ahead, decided, worth = prepared(params)
    act, planned = jax.jit(agent.act, static_argnums=6), jax.jit(plan.act, static_argnums=6)
    action = np.asarray(planned(params, ahead, decided, obs, row, keys[3], False))
    single = np.asarray((ahead.whose[row] == row[:, None]).all(axis=1))
    own = np.asarray(act(params, codes, decided.carry, obs, row, keys[3], False))
    assert single.any() and not single.all()
    np.testing.assert_array_equal(action[single], own[single])
    assert (action[~single] != own[~single]).any()
    best = jnp.take_along_axis(ahead.whose[row], worth.argmax(axis=1)[:, None], axis=1)[:, 0]
    np.testing.assert_array_equal(decided.way, best)
    np.testing.assert_array_equal(action, act(params, ahead.codes, decided.carry, obs, best, keys[3], False))


def test_what_cannot_plan_is_refused():
    with pytest.raises(UserError, match="a plan needs a critic"):
        planning(WALKER._replace(value=None), READER)
    with pytest.raises(UserError, match="a code of TransformerConfig is the same for all ways"):
        planning(WALKER, TRANSFORMER)
