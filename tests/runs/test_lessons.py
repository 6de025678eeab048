"""A curriculum in training: which pool is of which stage, tasks drawn by failure, resuming as if nothing had been."""

import dataclasses
import json
from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import t2tl_jax
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import Chains, Curriculum, LTLError, Stage, compile_pool
from t2tl_jax.ltl.turns import in_turns
from t2tl_jax.registry import AGENTS, make_env
from t2tl_jax.runs import config_files
from t2tl_jax.runs.config import PoolConfig
from t2tl_jax.runs.lessons import Lesson, Lessons
from t2tl_jax.runs.pools import make_pools
from t2tl_jax.single_state import SingleState
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.types import TaskTotals
from t2tl_jax.training.unroll import Player, begin, task_totals, unroll
from tests import fake_agent, fake_learner
from tests.fake_runs import StopAfter

ONE, NONE = (1, 1), (0, 0)
FIRST = Stage(Chains(ONE, ONE, NONE), 0.6, "least", 0.5)
TASK = Curriculum((FIRST, Stage(Chains((2, 2), ONE, NONE), 0.9), Stage(Chains((3, 3)))))
PERIOD, SIZE = 2, 8
CONFIG = dataclasses.replace(
    fake_learner.CONFIG, task=TASK, pool=PoolConfig(size=SIZE, rows=64, length=30, period=PERIOD, finish=True),
    episode_length=2, seeds="0,2",
)  # fmt: skip


def ended(by_place):
    """Totals of two seeds: (episodes, successes) of each place of the present pool and of the one before."""
    counts = np.zeros((2, 2, 2, SIZE), int)  # [episodes or successes, seed, age, place]
    for (age, place), (episodes, successes) in by_place.items():
        counts[:, :, age, place] = [
            [episodes - episodes // 2, episodes // 2],
            [successes - successes // 2, successes // 2],
        ]
    return TaskTotals(*counts)


NAMES = [[f"F {letter}" for letter in "abcdabcd"], ["F a"] * 8]


def test_what_ended_in_a_period_decides_about_the_pool_after_the_next():
    lessons = Lessons(TASK, PERIOD, SIZE)
    assert lessons.knows(1) and not lessons.knows(2)
    all_won = {(0, place): (2, 2) for place in range(3)}
    lessons.add(1, ended(all_won), NAMES[:1])
    assert not lessons.knows(2)
    lessons.add(2, ended({(0, 3): (5, 2), (0, 7): (5, 3)}), NAMES[:1])  # F d twice: 5 of 10, and the worst counts
    assert lessons.of(2).stage == 0 and dict(lessons.of(2).success) == {"F a": 1, "F b": 1, "F c": 1, "F d": 0.5}
    assert lessons.success == pytest.approx(3.5 / 4)
    for iteration in (3, 4):  # F d of the pool before counts, too; what did not end now is remembered
        lessons.add(iteration, ended({(1, 0): (5, 4), (0, 3): (5, 4)}), [NAMES[0], NAMES[0]])
    assert lessons.of(3) == Lesson(1) and lessons.of(2).stage == 0 and not lessons.knows(0)
    for iteration in (5, 6):  # pool 2 is of the first stage: its success says nothing of the second one's
        lessons.add(iteration, ended(all_won), [NAMES[0], NAMES[0]])
    assert lessons.of(4) == Lesson(1)
    for iteration in (7, 8):
        lessons.add(iteration, ended({(0, 0): (9, 9), (0, 1): (1, 1)}), [NAMES[0], NAMES[0]])
    assert lessons.of(5) == Lesson(2)


def test_lessons_go_on_from_their_state():
    def play(lessons, first, last):
        for iteration in range(first, last):
            episodes = np.random.default_rng(iteration).integers(0, 5, (2, 2, SIZE))
            names = [NAMES[0]] * (1 if iteration <= PERIOD else 2)
            lessons.add(iteration, TaskTotals(episodes, episodes - (episodes > 3)), names)
        return lessons

    whole = play(Lessons(TASK, PERIOD, SIZE), 1, 12)
    for stop in (2, 5, 8):
        stored = json.loads(json.dumps(play(Lessons(TASK, PERIOD, SIZE), 1, stop).state()))
        assert play(Lessons(TASK, PERIOD, SIZE, stored), stop, 12).state() == whole.state()


def test_pools_are_of_their_stage_and_failing_tasks_come_more_often():
    env = make_env(fake_learner.FakeEnvConfig())
    config = dataclasses.replace(CONFIG, pool=dataclasses.replace(CONFIG.pool, size=60, rows=300))
    pools = make_pools(config, env)
    success = (("F Black", 1.0), ("F Red", 0.0), ("F White", 1.0), ("F Yellow", 1.0))
    lessons = {0: Lesson(), 1: Lesson(0, success), 2: Lesson(1), 3: Lesson(2)}
    tables = [pools.training(number, lessons.get) for number in lessons]
    assert len({str(jax.tree.map(jnp.shape, table)) for table in tables}) == 1
    texts = [Counter(table.text(row) for row in table.initial_row.tolist()) for table in tables]
    assert texts[0].keys() == {"F Black", "F Red", "F White", "F Yellow"} and max(texts[0].values()) < 30
    # exp(-0 / 0.5) against exp(-1 / 0.5): 71 % of the places for the one that fails.
    assert 32 < texts[1]["F Red"] < 54
    # All that there are but what is left of tasks to evaluate on, again and again.
    assert 8 <= len(texts[2]) <= 16 and max(texts[2].values()) - min(texts[2].values()) <= 1
    assert pools.names(1, lessons.get) == [
        [table.text(row) for row in table.initial_row.tolist()] for table in (tables[1], tables[0])
    ]
    # What is reported on is of the last stage.
    assert any(pools.evaluation.text(row).count("F") == 3 for row in pools.evaluation.initial_row.tolist())


@pytest.mark.slow
def test_episodes_are_counted_by_the_pool_that_they_began_in():
    """Against a count in Python, over a renewal."""
    env = SingleState()
    old, new = (
        compile_pool("Until_1_2_1_1", env.propositions, env.alphabet, number, size=4, rows=24, length=14)
        for number in (0, 1)
    )
    task_env = TaskEnv(env, old, random_starts=0.2)
    player = Player(lambda carry, state, key: (jax.random.randint(key, state.done.shape, 0, 4), carry, ()))

    @jax.jit
    def play(before, table, key):
        def keep(step):
            return task_totals(step, table), step.turn, step.task, step.totals

        return unroll(task_env, TaskParams((), table), player, before, (), key, 4, 5, 0.9, keep)

    tables = [in_turns(old, None, 0), in_turns(new, old, 1)]
    start = jax.jit(lambda key: begin(task_env, TaskParams((), tables[0]), key, 300, 5))(jax.random.key(0))
    middle, _, (first, *_) = play(start, tables[0], jax.random.key(1))
    assert not first.episodes[:, 1].any()
    _, _, (totals, turn, task, ended) = play(middle, tables[1], jax.random.key(2))
    expected = np.zeros((2, 2, 4), int)
    age = np.asarray(turn == middle.turn).astype(int)
    for t, n in np.argwhere(np.asarray(task) >= 0):
        expected[:, age[t, n], task[t, n]] += [ended.episodes[t, n], ended.successes[t, n]]
    np.testing.assert_array_equal([totals.episodes.sum(axis=0), totals.successes.sum(axis=0)], expected)
    assert (expected[0] > 0).all() and expected[1].sum() > 20


def make_agent(task_env, config, episode_length, iterations):
    """The fake learner, which also reports success by task: always, from its third iteration on."""
    agent = fake_agent.make_agent()

    def iterate(state, env_params):
        won = jnp.where(state.iteration >= 2, 3, 1) * jnp.ones((2, SIZE), jnp.int32)
        tokens = env_params.table.tokens.sum().astype(jnp.float32)
        state, metrics = agent.iterate(state, env_params)
        return state, metrics.replace(tasks=TaskTotals(3 + 0 * won, won), scalars=metrics.scalars | {"tokens": tokens})

    return agent._replace(iterate=iterate)


@dataclasses.dataclass(frozen=True)
class CountingConfig(fake_agent.FakeConfig):
    """The fake learner that counts by task."""


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setattr(AGENTS, "_kinds", dict(AGENTS._kinds))
    t2tl_jax.register_agent("counting", CountingConfig, make_agent)


@pytest.mark.slow
def test_a_resumed_run_is_the_uninterrupted_one(tmp_path):
    config = dataclasses.replace(CONFIG, learner=CountingConfig(), frames=1600)
    whole = t2tl_jax.train(config, folder=tmp_path / "whole")
    # The tasks of period 0 fail, those of period 1 do not, and decide about pool 3; its own about pool 5.
    expected = [0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2]
    np.testing.assert_array_equal(whole.metrics["stage"], [expected] * 2)
    np.testing.assert_allclose(whole.metrics["task_success"][0, :5], [np.nan, 1 / 3, 1 / 3, 1.0, 1.0])
    assert len(set(whole.metrics["tokens"][0].tolist())) == 8
    for stop in (4, 7):
        part = t2tl_jax.train(config, folder=tmp_path / str(stop), callbacks=[StopAfter(stop)])
        assert part.metrics["stage"].shape[1] == stop
        t2tl_jax.resume(tmp_path / str(stop))
        assert (tmp_path / str(stop) / "metrics.csv").read_text() == (tmp_path / "whole" / "metrics.csv").read_text()


def test_a_curriculum_is_stored_and_what_cannot_be_is_refused():
    config = dataclasses.replace(CONFIG, learner=CountingConfig())
    assert config_files.from_json(config_files.to_json(config), "test") == config
    assert dataclasses.replace(config, task="deepltl_zones").task == t2tl_jax.ltl.DEEPLTL_ZONES
    cut = dataclasses.replace(config, pool=dataclasses.replace(config.pool, finish=False))
    with pytest.raises(UserError, match=r"set pool\.finish=True"):
        t2tl_jax.train(cut)
    endless = Curriculum((Stage(t2tl_jax.ltl.Named("Until_1_2_1_1"), temperature=0.5),))
    with pytest.raises(UserError, match="cannot be; set the temperature of its stage to 0"):
        t2tl_jax.train(dataclasses.replace(config, task=endless))
    with pytest.raises(LTLError, match="no curriculum itself"):
        Curriculum((Stage(TASK),))
    with pytest.raises(UserError, match="this learner does not report"):
        t2tl_jax.train(CONFIG)
