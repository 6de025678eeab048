"""Rows that are drawn for each transition: their targets are those of all rows, and on average so is the loss."""

import dataclasses

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents import row_codes
from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.learning_rows import drawn_rows, marks
from t2tl_jax.agents.td_learning import Marked, Transition, dqn_loss
from t2tl_jax.ltl import compile_pool
from t2tl_jax.ltl.turns import in_turns
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.registry import make_env
from t2tl_jax.runs.config import Config, PoolConfig
from t2tl_jax.runs.pools import make_pools
from t2tl_jax.single_state import SingleState, SingleStateConfig
from t2tl_jax.task_env import Shared, TaskEnv, TaskParams
from tests.agents.sizes import GRAPH
from tests.parameters import begun_quickly, parameters


class Seen(SingleState):
    """Something is observed, which says nothing."""

    observation_size = 2

    def reset(self, rng, params=None):
        return super().reset(rng, params).replace(obs=jnp.ones(2))


ENV = Seen()
SIZE = 24


def pool(number, length=14):
    return compile_pool("Until_1_2_1_1", ENV.propositions, ENV.alphabet, number, size=4, rows=24, length=length)


def turns(number):
    return in_turns(pool(number), pool(number - 1) if number else None, number)


def batch_of(table, key, row=None):
    keys = jax.random.split(key, 4)
    open_rows = np.flatnonzero(table.is_open)
    row = jax.random.choice(keys[0], open_rows, (SIZE,)) if row is None else row
    letter = jax.random.randint(keys[1], (SIZE,), 0, table.num_letters)
    shared = Shared(letter, jnp.linspace(-0.1, 0.1, SIZE), jnp.arange(SIZE) % 5 == 0)
    obs, after = jax.random.normal(keys[2], (2, SIZE, 2))
    action = jax.random.randint(keys[3], (SIZE,), 0, 4)
    return Marked(obs, action, after, row, shared, jnp.arange(SIZE) % 3 == 0, mark=marks(table)[row])


@pytest.mark.slow
def test_marks_are_those_of_formulas_wherever_they_stand():
    one, longer, joined = pool(0), pool(0, length=20), turns(1)
    for table in (one, longer, joined):
        by_text: dict[str, set[int]] = {}
        for row, mark in enumerate(np.asarray(marks(table)).tolist()):
            by_text.setdefault(table.text(row), set()).add(mark)
        assert all(len(found) == 1 for found in by_text.values())
        assert len(set.union(*by_text.values())) == len(by_text) > 8
    np.testing.assert_array_equal(marks(one), marks(longer))
    moved = [row for row in range(24, 46) if joined.is_open[row]]
    np.testing.assert_array_equal(marks(joined)[jnp.array(moved)], marks(pool(1))[jnp.array(moved) - 22])


@pytest.mark.slow
def test_rows_are_drawn_from_all_that_are_open_and_the_played_one_is_first_as_long_as_it_is_there():
    old, kept, new = turns(0), turns(1), turns(2)
    batch = batch_of(old, jax.random.key(0))
    draw = jax.jit(drawn_rows, static_argnums=3)
    for table, there in ((old, True), (kept, True), (new, False)):
        rows = np.asarray(
            jax.vmap(lambda key, table=table: draw(table, batch, marks(table), 5, key))(
                jax.random.split(jax.random.key(1), 200)
            )
        )  # [200, B, 5]
        played = rows[..., 0] == np.asarray(batch.row)
        assert played.all() if there else played.mean() < 0.5
        counts = np.bincount(rows[..., 1:].reshape(-1), minlength=table.num_rows)
        is_open = np.asarray(table.is_open)
        assert not counts[~is_open].any()
        expected = counts.sum() / is_open.sum()
        assert np.abs(counts[is_open] - expected).max() < 5 * np.sqrt(expected)


@pytest.mark.slow
@pytest.mark.parametrize(("head", "changes"), [("film", {}), ("bilinear", {"printed_argmax": True, "double": False})])
def test_drawn_rows_have_the_targets_of_all_rows(head, changes):
    """With every open row once for each transition, loss and gradients are those of learning all rows; so drawn
    uniformly they are unbiased."""
    table = turns(1)
    batch = batch_of(table, jax.random.key(2))
    config = DQNConfig(discount=0.9, **changes)
    network = QNetwork(QNetworkConfig(LookaheadConfig(4), state_layers=(8,), task_layer=8, head=head), num_actions=4)
    every = jnp.broadcast_to(np.flatnonzero(table.is_open), (SIZE, int(table.is_open.sum())))

    @jax.jit
    def both(params, target):
        codes = network.apply(params, table, method="embed")

        def loss(params, rows):
            return dqn_loss(config, network, table, params, codes, target, 0.5 * codes, batch, rows=rows)[0]

        return [jax.value_and_grad(loss)(params, rows) for rows in (None, every)]

    given = (parameters(network, table, batch.obs, seed=seed, method="initialise") for seed in (0, 1))
    (loss, gradient), (same, other) = both(*given)
    assert float(loss) == pytest.approx(float(same), rel=1e-5)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-5), gradient, other)
    assert max(float(jnp.abs(x).max()) for x in jax.tree.leaves(gradient)) > 1e-3


LEARNER = DQNConfig(
    network=QNetworkConfig(LookaheadConfig(4), state_layers=(8,), task_layer=8),
    num_envs=8, unroll_length=10, batch_size=16, buffer_size=400, learning_starts=0, target_period=7,
    rows_per_transition=3, discount=0.9, learning_rate=1e-3,
)  # fmt: skip


@pytest.mark.slow
def test_rows_encoded_apart_give_the_same_learning_as_all_of_them(monkeypatch):
    """An encoder that learns, on a table that counts as large or not."""
    network = QNetworkConfig(GRAPH, state_layers=(), task_layer=8, head="bilinear", dueling=False)
    config = dataclasses.replace(LEARNER, network=network)
    given = TaskParams((), turns(1))
    agent = begun_quickly(make_dqn(TaskEnv(ENV, given.table), config, 20, iterations=4))
    start = jax.jit(agent.init)(jax.random.key(0), given)
    found = []
    for large in (1024, 8):
        monkeypatch.setattr(row_codes, "LARGE", large)
        monkeypatch.setattr("t2tl_jax.agents.dqn.LARGE", large)
        agent = make_dqn(TaskEnv(ENV, given.table), config, 20, iterations=4)
        if large == 8:
            start = dataclasses.replace(start, target_embedding=())
        chex.assert_trees_all_equal_shapes(start, jax.eval_shape(agent.init, jax.random.key(0), given))
        state, metrics = jax.jit(agent.iterate)(start, given)
        found.append((state.params, metrics.scalars["loss"], metrics.tasks))
    (params, *rest), (same, *others) = found
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-3), rest, others)
    chex.assert_trees_all_close(params, same, atol=2e-4)


@pytest.mark.slow
def test_learning_goes_on_over_tables_in_one_program():
    """Pools in turns: episodes under way go on, replay stays, and codes of the target are those of the new rows."""
    agent = begun_quickly(make_dqn(TaskEnv(ENV, turns(0)), LEARNER, 20, iterations=10))
    iterate, embed, given = jax.jit(agent.iterate), jax.jit(agent.embed), TaskParams((), turns(0))
    state = jax.jit(agent.init)(jax.random.key(0), given)
    for number in range(4):
        given = TaskParams((), turns(number))
        before = state
        for _ in range(2):
            state, metrics = iterate(state, given)
        assert metrics.tasks.episodes.shape == (2, 4) and np.isfinite(metrics.scalars["loss"])
        np.testing.assert_array_equal(state.target_embedding, embed(state.target_params, given.table))
        assert any((a != b).any() for a, b in zip(*map(jax.tree.leaves, (state.params, before.params)), strict=True))
    assert iterate._cache_size() == 1
    restarted = jax.jit(agent.restart)(state, TaskParams((), turns(0)))
    assert (restarted.episodes.elapsed == 0).all()
    jax.tree.map(np.testing.assert_array_equal, restarted.buffer, state.buffer)
    assert set(np.asarray(restarted.episodes.state.pipeline_state.row)) <= set(np.asarray(turns(0).initial_row))
    np.testing.assert_array_equal(restarted.target_embedding, embed(state.target_params, turns(0)))


def test_plain_dqn_draws_no_rows_and_keeps_no_marks():
    with pytest.raises(ValueError, match="plain DQN learns the row that the agent was in"):
        dataclasses.replace(LEARNER, counterfactual=False)
    plain = dataclasses.replace(LEARNER, counterfactual=False, rows_per_transition=0)
    assert plain.rows_drawn == 0
    given = TaskParams((), turns(0))
    every = dataclasses.replace(LEARNER, rows_per_transition=0)
    for config, kind in ((LEARNER, Marked), (plain, Transition), (every, Transition)):
        agent = make_dqn(TaskEnv(ENV, given.table), config, 20, iterations=2)
        buffer = jax.eval_shape(agent.init, jax.random.key(0), given).buffer
        assert type(buffer.experience) is kind  # what is stored has its fields by name, empty ones too


FAMILY = Config(
    env=SingleStateConfig(), task="Until_1_2_1_1", learner=LEARNER, pool=PoolConfig(size=4, rows=600), episode_length=20
)


def test_families_are_refused_for_plain_dqn_and_for_all_rows_of_large_tables():
    env = make_env(FAMILY.env)

    def check(finish, **changes):
        pool = dataclasses.replace(FAMILY.pool, finish=finish)
        make_pools(dataclasses.replace(FAMILY, learner=dataclasses.replace(LEARNER, **changes), pool=pool), env)

    with pytest.raises(ValueError, match=r"plain DQN learns the row .* train families with learner\.counterfactual"):
        check(finish=False, counterfactual=False, rows_per_transition=0)
    check(finish=True)
    check(finish=False, rows_per_transition=0)
    with pytest.raises(ValueError, match=r"1,198 rows.*learner\.rows_per_transition=8"):
        check(finish=True, rows_per_transition=0)
