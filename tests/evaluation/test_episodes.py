"""Evaluation counts the first episode of every environment, as what its end says it is."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.env import State
from t2tl_jax.evaluation.episodes import Episodes, play, player_of_seeds
from t2tl_jax.evaluation.report import summarise, table
from t2tl_jax.evaluation.sparkline import sparkline
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.program import params_of_seeds
from t2tl_jax.training.seeds import EVALUATION, TRAINING, stream_keys
from t2tl_jax.training.types import Agent
from tests.probe import ProbeEnv

SUCCESS, VIOLATION, BROKEN = 0.5, 0.3, 0.1


class FateEnv(ProbeEnv):
    """Drawn at the reset: Up at the first step, Down, an end by the environment itself, or nothing ever."""

    observation_size = 1

    def reset(self, rng, params=None):
        return State(jnp.stack([jax.random.uniform(rng), 0.0]), jnp.ones(1), jnp.float32(0), jnp.float32(0))

    def step(self, state, action, params=None):
        fate = state.pipeline_state[0]
        broken = (fate > SUCCESS + VIOLATION) & (fate < SUCCESS + VIOLATION + BROKEN)
        return state.replace(pipeline_state=jnp.stack([fate, 1.0]), done=broken.astype(jnp.float32))

    def labels(self, state):
        fate, acted = state.pipeline_state
        up = fate < SUCCESS
        return jnp.stack([up, ~up & (fate < SUCCESS + VIOLATION)]) & (acted > 0)


IDLE = Agent(
    init=lambda key, env_params: None,
    iterate=lambda state, env_params: (state, None),
    embed=lambda params, table: jnp.zeros((table.num_rows, 1)),
    act=lambda params, embedding, carry, obs, row, key, deterministic: jnp.zeros((*row.shape, 1)),
    frames_per_iteration=1,
)


@pytest.fixture(scope="module")
def env() -> TaskEnv:
    fate = FateEnv()
    return TaskEnv(fate, compile_tasks(["!Down U Up"], fate.propositions, fate.alphabet))


@pytest.fixture(scope="module")
def played(env) -> Episodes:
    seeds = (0, 4)
    given, keys = params_of_seeds(env, seeds, purpose="evaluation"), stream_keys(seeds, EVALUATION)
    played = player_of_seeds(env, IDLE, 2000, 40, 0.9, deterministic=True)(jnp.zeros(2), given, keys)
    return jax.device_get(played)


@pytest.mark.slow
def test_rates_are_those_of_the_environment(played):
    report = summarise(played, (0, 4))
    for seed in report.seeds:
        for estimate, truth in (
            (seed.success_rate, SUCCESS),
            (seed.violation_rate, VIOLATION),
            (seed.env_termination_rate, BROKEN),
            (seed.timeout_rate, 1 - SUCCESS - VIOLATION - BROKEN),
        ):
            assert estimate.count == 2000
            assert abs(estimate.value - truth) < 0.04
            assert estimate.low < estimate.value < estimate.high
        assert seed.success_length.value == 1.0
        assert seed.discounted_return.value == pytest.approx(seed.success_rate.value - seed.violation_rate.value)
    assert report.solved.value == 0.0
    assert "0 of 2 seeds solve" in table({"final deterministic": report})


@pytest.mark.slow
def test_only_the_first_episode_counts(played):
    flags = np.stack([played.success, played.violation, played.env_termination]).astype(int).sum(0)
    assert set(flags.ravel()) == {0, 1}
    assert (played.length[flags == 1] == 1).all()
    assert (played.length[flags == 0] == 40).all()
    np.testing.assert_array_equal(played.total_reward, played.success.astype(float) - played.violation)
    np.testing.assert_array_equal(played.discounted_return, played.total_reward)
    np.testing.assert_array_equal(played.paper_return, played.discounted_return)


def test_seeds_have_their_own_streams(played):
    assert (played.success[0] != played.success[1]).any()
    assert not np.array_equal(
        jax.random.key_data(stream_keys((0,), TRAINING)), jax.random.key_data(stream_keys((0,), EVALUATION))
    )


def test_rewards_are_discounted_from_the_first_step():
    """A reward of 1 at every step; an episode longer than a chunk, and not a multiple of it."""

    class Paying(ProbeEnv):
        def step(self, state, action, params=None):
            return super().step(state, action).replace(reward=jnp.float32(1))

    probe = Paying()
    env = TaskEnv(probe, compile_tasks(["F Up"], probe.propositions, probe.alphabet))
    run = jax.jit(lambda key: play(env, IDLE, None, env.make_params(0), key, 3, 33, 0.9, True))
    episodes = run(jax.random.key(0))
    assert episodes.length.tolist() == [33] * 3 and episodes.total_reward.tolist() == [33] * 3
    np.testing.assert_allclose(episodes.discounted_return, sum(0.9**t for t in range(33)), rtol=1e-5)
    # The paper's measure discounts all of it by the length, which is the same where only the last step pays.
    np.testing.assert_allclose(episodes.paper_return, 33 * 0.9**32, rtol=1e-5)
    assert not (episodes.success | episodes.violation | episodes.env_termination).any()


@pytest.mark.slow
def test_seeds_play_with_their_own_numbers():
    """Where numbers come in with the environment's parameters: the learner's, and the discount factor."""
    probe = ProbeEnv()
    env = TaskEnv(probe, compile_tasks(["F(Up & F Down)"], probe.propositions, probe.alphabet))

    def turning(after):
        """Acts Up in the first row, and in the second as the number says: Down, or nothing."""

        def act(params, embedding, carry, obs, row, key, deterministic):
            return jnp.where(row == env.table.initial_row[0], 1.0, after)[:, None]

        return IDLE._replace(act=act)

    agent = turning(0.0)._replace(given=lambda env_params: turning(env_params.numbers["after"]))
    numbers = [{"after": -1.0, "discount": 0.5}, {"after": 0.0, "discount": 0.5}, {"after": -1.0, "discount": 0.25}]
    given = params_of_seeds(env, (0, 0, 0), numbers=numbers)
    run = player_of_seeds(env, agent, 1, 5, 0.9, deterministic=False)
    episodes = run(jnp.zeros(3), given, stream_keys((0, 0, 0), EVALUATION))
    assert episodes.length.tolist() == [[2], [5], [2]]
    np.testing.assert_allclose(episodes.discounted_return, [[0.5], [0.0], [0.25]])


def test_a_report_by_hand():
    episodes = Episodes(
        success=np.array([[True, False, False, False]]),
        violation=np.array([[False, True, False, False]]),
        env_termination=np.array([[False, False, True, False]]),
        total_reward=np.array([[1.0, -1.0, -10.0, 0.0]], np.float32),
        discounted_return=np.array([[0.25, -0.5, -10.0, 0.0]], np.float32),
        paper_return=np.array([[0.25, -0.5, -10.0, 0.0]], np.float32),
        length=np.array([[3, 2, 1, 5]], np.int32),
    )
    report = summarise(episodes, (0,))
    assert report.seeds[0].discounted_return.value == pytest.approx(-10.25 / 4)
    assert [report.seeds[0].timeout_rate.value, report.env_termination_rate.value] == [0.25, 0.25]
    assert report.success_rate.low is None
    assert "not solved" in table({"final sampled": report})
    assert "solve" not in table({"sampled": report})  # nothing is said of other parameters than the final ones


FEW = Episodes(
    success=np.array([[True, True], [True, False]]),
    violation=np.array([[False, False], [False, True]]),
    env_termination=np.zeros((2, 2), bool),
    total_reward=np.array([[1.0, 1.0], [1.0, -1.0]], np.float32),
    discounted_return=np.array([[0.9, 0.2], [0.5, -0.5]], np.float32),
    paper_return=np.array([[0.9, 0.2], [0.5, -0.5]], np.float32),
    length=np.array([[10, 990], [500, 500]], np.int32),
)
"""Two episodes of each of two seeds, whose intervals are wide."""


def test_intervals_stay_within_what_is_possible():
    report = summarise(FEW, (0, 1), limit=1000, machines=False)
    first = report.seeds[0]
    assert (first.success_length.low, first.success_length.high) == (1.0, 1000.0)
    for estimate in (first.discounted_return, first.paper_return, report.discounted_return):
        assert (estimate.low, estimate.high) == (-1.0, 1.0)
    assert "ranges" not in report.as_json()


def test_returns_have_no_bounds_where_more_than_verdicts_is_paid():
    extra = dataclasses.replace(FEW, total_reward=FEW.total_reward + np.array([[0.0, 0.0], [0.0, 0.25]], np.float32))
    for report in (summarise(FEW, (0, 1), 1000, machines=True), summarise(extra, (0, 1), 1000, machines=False)):
        assert report.seeds[0].discounted_return.high > 1.0 and report.discounted_return.low < -1.0


def test_a_single_seed_is_not_counted():
    report = summarise(jax.tree.map(lambda part: part[:1], FEW), (0,))
    assert "best sampled: success above 95%, mean" in table({"best sampled": report})


def test_seeds_that_all_succeed_leave_an_interval(played):
    """Of two seeds without a failure it is not known how often a third one fails."""
    perfect = dataclasses.replace(
        played,
        success=np.ones_like(played.success),
        violation=np.zeros_like(played.success),
        env_termination=np.zeros_like(played.success),
    )
    report = summarise(perfect, (0, 4))
    assert report.success_rate.value == 1.0 and report.success_rate.low < 0.5
    assert report.violation_rate.value == 0.0 and report.violation_rate.high > 0.5
    assert report.seeds[0].success_rate.low > 0.99  # of its 2,000 different episodes


def test_sparkline():
    assert sparkline(np.array([0.0, 1.0, np.nan])) == "▁█ "
    assert len(sparkline(np.linspace(0, 1, 305))) == 32
