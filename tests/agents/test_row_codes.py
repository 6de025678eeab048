"""Large tables: only the rows of a minibatch are encoded, with the values and gradients of the whole table."""

import dataclasses
import math
from functools import partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents import row_codes
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.agents.ppo_learning import in_segments, minibatch_order
from t2tl_jax.ltl import compile_pool
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.joined import JoinedConfig
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.roles import RolesConfig
from t2tl_jax.networks.task_encoders import AutomatonConfig, OneHotConfig, make_task_encoder
from t2tl_jax.single_state import SingleState
from t2tl_jax.task_env import TaskEnv, TaskParams
from tests.agents.sizes import GRAPH, GRU, TRANSFORMER
from tests.parameters import begun_quickly, parameters

ENV = SingleState()
TABLE = compile_pool("Until_1_2_1_1", ENV.propositions, ENV.alphabet, 0, size=8, rows=48, length=14)
JOINED = JoinedConfig(first=LookaheadConfig(propositions=4, steps=1), second=GRAPH)
APART = {"transformer": TRANSFORMER, "gru": GRU, "joined": JOINED}  # of the graph network, which is read by the last
ROWS_AT_ONCE = 4


@pytest.fixture
def small(monkeypatch):
    """Every table is large, and a few rows are many."""
    monkeypatch.setattr(row_codes, "ROWS_AT_ONCE", ROWS_AT_ONCE)
    monkeypatch.setattr(row_codes, "LARGE", 8)


@pytest.mark.parametrize(("held", "room"), [([7, 3, 3, 30, 7, 2], 8), ([5] * 60, 48), ([1], 4), (list(range(48)), 48)])
def test_each_row_once(small, held, room):
    rows = jnp.array(held).reshape(-1, 1)
    distinct, place, count = jax.jit(row_codes.distinct_rows, static_argnums=1)(rows, 48)
    expected, inverse = np.unique(held, return_inverse=True)
    assert len(distinct) == room and count == len(expected)
    np.testing.assert_array_equal(distinct, [*expected, *[1] * (room - len(expected))])
    np.testing.assert_array_equal(place, inverse.reshape(-1, 1))


@pytest.mark.slow
@pytest.mark.parametrize("at_once", [ROWS_AT_ONCE, 20])  # in rounds; and all 20 samples, which are few for 48 rows
@pytest.mark.parametrize("name", APART)
def test_values_and_gradients_are_those_of_the_whole_table(small, name, at_once, monkeypatch):
    monkeypatch.setattr(row_codes, "ROWS_AT_ONCE", at_once)
    reader = APART[name]
    encoder = make_task_encoder(reader)
    assert reader.rows_apart and reader.learned
    params, others = (parameters(encoder, TABLE, seed=seed) for seed in (0, 1))
    rows = jax.random.randint(jax.random.key(2), (10, 2), 2, 20)
    weights = jax.random.normal(jax.random.key(3), (10, 2, reader.code_size))
    codes = row_codes.make_codes(reader, False, encoder.apply, partial(encoder.apply, method="of_rows"))

    @jax.jit  # one program of all that is compared
    def compute(params, others):
        known = codes.every(others, TABLE)  # with parameters of before

        def whole(params):
            return (weights * encoder.apply(params, TABLE)[rows]).sum()

        def some(params):
            return (weights * codes.of(params, TABLE, known, rows)).sum()

        return known, encoder.apply(others, TABLE), [jax.value_and_grad(loss)(params) for loss in (some, whole)]

    known, there, ((value, gradient), (expected, wanted)) = compute(params, others)
    np.testing.assert_allclose(known, there, atol=1e-6)
    np.testing.assert_allclose(value, expected, rtol=1e-5)
    chex.assert_trees_all_close(gradient, wanted, atol=1e-5)


@pytest.mark.parametrize(("samples", "encoded"), [(24, 24), (25, 48)])
def test_a_minibatch_with_fewer_samples_than_rows_has_them_encoded(samples, encoded):
    """Half the rows of the table or fewer: the arithmetic is theirs."""
    encoder = make_task_encoder(TRANSFORMER)
    codes = row_codes.make_codes(TRANSFORMER, False, encoder.apply, partial(encoder.apply, method="of_rows"))
    params, rows = parameters(encoder, TABLE), jnp.zeros(samples, int)
    known = jnp.zeros((TABLE.num_rows, TRANSFORMER.code_size))

    def flops(function):
        return jax.jit(function).lower(params).cost_analysis()["flops"]

    apart = flops(lambda params: encoder.apply(params, TABLE, jnp.arange(encoded), None, method="of_rows"))
    assert flops(lambda params: codes.of(params, TABLE, known, rows)) == pytest.approx(apart, rel=0.01)


@pytest.mark.slow
def test_as_many_rounds_as_the_rows_need(small):
    """Counted where they are made, forwards and backwards, for two seeds side by side: as many as the slower needs."""
    seen = []

    def encode(params, table, rows, known):
        jax.debug.callback(lambda rows: seen.append(np.asarray(rows)), rows)
        return params * table.tokens[rows, :1]

    lookup = row_codes.make_lookup(encode)
    known = jnp.zeros((TABLE.num_rows, 1))

    def loss(params, rows):
        return lookup(params, TABLE, known, rows).sum()

    rows = jnp.array([list(range(2, 12)) + [3] * 20, [7] * 30])
    gradient = jax.jit(jax.vmap(jax.grad(loss)))(jnp.ones(2), rows)
    jax.effects_barrier()
    np.testing.assert_allclose(gradient, np.asarray(TABLE.tokens)[rows, 0].sum(axis=1))
    assert {row for some in seen for row in some.ravel().tolist()} == {1, *range(2, 12)}
    assert len(seen) == 2 * 2 * math.ceil(10 / ROWS_AT_ONCE)  # two seeds, two ways


@pytest.mark.parametrize("reader", [LookaheadConfig(propositions=4), RolesConfig(propositions=4), OneHotConfig(48)])
def test_codes_without_parameters_are_read_off_once(reader):
    def fail(*_):
        raise AssertionError("nothing is encoded in a gradient step")

    codes = row_codes.make_codes(reader, False, fail, fail)
    known = jax.jit(make_task_encoder(reader).apply)({}, TABLE)
    np.testing.assert_array_equal(codes.of({}, TABLE, known, jnp.array([3, 2])), known[jnp.array([3, 2])])


def test_messages_over_the_table_need_all_of_it():
    for reader in (AutomatonConfig(), JoinedConfig(second=AutomatonConfig()), OneHotConfig()):
        assert not reader.rows_apart


@pytest.mark.slow
def test_an_iteration_of_ppo_learns_the_same(monkeypatch):
    """Two seeds side by side, by the rows of minibatches and by the whole table."""
    config = PPOConfig(
        network=NetworkConfig(task_encoder=JOINED, env_layers=(), actor_layers=(8,), critic_layers=()),
        num_envs=8, unroll_length=16, epochs=2, minibatch_size=32, adam_epsilon=1e-3,
    )  # fmt: skip
    given = TaskParams((), TABLE)

    agent, keys = make_ppo(TaskEnv(ENV, TABLE), config, 20, iterations=10), jax.random.split(jax.random.key(0), 2)
    start = jax.jit(jax.vmap(begun_quickly(agent).init, (0, None)))(keys, given)

    def after_one():
        agent = make_ppo(TaskEnv(ENV, TABLE), config, 20, iterations=10)
        return jax.jit(jax.vmap(agent.iterate, (0, None)))(start, given)[0].params

    whole = after_one()
    monkeypatch.setattr(row_codes, "ROWS_AT_ONCE", ROWS_AT_ONCE)
    monkeypatch.setattr(row_codes, "LARGE", 8)
    chex.assert_trees_all_close(after_one(), whole, atol=1e-5)
    difference = jax.tree.map(lambda x, y: float(jnp.abs(x - y).max()), start.params, whole)
    assert max(jax.tree.leaves(difference)) > 1e-4  # it learns something


def test_minibatches_of_environments_hold_all_of_their_steps_and_each_step_once():
    config = PPOConfig(num_envs=12, unroll_length=8, minibatch_size=32, minibatches_of="environments")
    number = jnp.arange(8 * 12).reshape(8, 12)  # of a step: time x 12 + environment
    order = minibatch_order(config, jax.random.key(0))
    steps = np.asarray(in_segments(config, number)[order]).reshape(3, 32)
    assert sorted(steps.ravel().tolist()) == list(range(96))
    envs = [set((of % 12).tolist()) for of in steps]
    assert [len(of) for of in envs] == [4, 4, 4] and envs[0] | envs[1] | envs[2] == set(range(12))
    assert not np.array_equal(order, minibatch_order(config, jax.random.key(1)))
    with pytest.raises(ValueError, match="num_envs=12 for 8 minibatches"):
        dataclasses.replace(config, minibatch_size=12)
