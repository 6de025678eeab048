"""Advantages against a slow loop, and the bookkeeping of episodes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.episodes import advance, begin, by_task
from t2tl_jax.training.rollout import generalised_advantages, rollout
from tests.probe import ProbeEnv

DISCOUNT, LAMBDA = 0.9, 0.8


def slow_advantages(reward, value, next_value, terminated, truncated):
    """The definition: a sum over later errors of the same episode, each weighted by (gamma lambda)^distance."""
    steps = len(reward)
    advantages = np.zeros(steps)
    for t in range(steps):
        weight = 1.0
        for k in range(t, steps):
            bootstrap = 0.0 if terminated[k] else next_value[k]
            advantages[t] += weight * (reward[k] + DISCOUNT * bootstrap - value[k])
            if terminated[k] or truncated[k]:
                break
            weight *= DISCOUNT * LAMBDA
    return advantages


def test_advantages_equal_a_slow_loop():
    rng = np.random.default_rng(0)
    shape = (40, 6)
    reward, value, next_value = rng.normal(size=(3, *shape)).astype(np.float32)
    terminated = rng.random(shape) < 0.1
    truncated = (rng.random(shape) < 0.1) & ~terminated
    fast = generalised_advantages(reward, value, next_value, terminated, truncated, DISCOUNT, LAMBDA)
    slow = np.stack(
        [slow_advantages(*(x[:, i] for x in (reward, value, next_value, terminated, truncated))) for i in range(6)], 1
    )
    np.testing.assert_allclose(fast, slow, atol=1e-4)


@pytest.fixture
def env():
    probe = ProbeEnv()
    return TaskEnv(probe, compile_tasks(["F(Up & F Down)"], probe.propositions, probe.alphabet))


def play(env, actions, limit):
    """Outcomes of a scripted action sequence in one environment."""
    episode = begin(env, jax.random.key(0), limit)
    outcomes = []
    for action in actions:
        episode, outcome = advance(env, episode, jnp.array([action]), jax.random.key(1), limit, DISCOUNT)
        outcomes.append(outcome)
    return episode, outcomes


def test_success_terminates_and_the_next_episode_starts_with_the_whole_task(env):
    episode, outcomes = play(env, [1.0, -1.0], limit=10)
    assert not outcomes[0].terminated and outcomes[1].terminated and not outcomes[1].truncated
    assert outcomes[1].reward == 1.0 and outcomes[1].next_row == 0  # the row of true, before the reset
    assert outcomes[1].totals.successes == 1 and outcomes[1].totals.length == 2
    np.testing.assert_allclose(outcomes[1].totals.discounted_return, DISCOUNT**1)
    assert episode.elapsed == 0 and env.row(episode.state) == env.table.initial_row[0]


def test_time_limit_truncates_and_keeps_the_last_row(env):
    episode, outcomes = play(env, [1.0, 0.0, 0.0], limit=3)
    last = outcomes[-1]
    assert last.truncated and not last.terminated and last.reward == 0
    assert last.next_row != env.table.initial_row[0]  # F Down was left
    assert last.totals.timeouts == 1 and last.totals.successes == 0
    assert env.row(episode.state) == env.table.initial_row[0]


def test_what_the_environment_pays_and_ends_is_kept_apart_from_the_task():
    """So that a learner can pay it to every row, and end every row with it."""

    class Fragile(ProbeEnv):
        """Every step costs 0.25, and an action above 2 breaks it."""

        def step(self, state, action):
            return super().step(state, action).replace(reward=jnp.float32(-0.25), done=(action[0] > 2.0) * 1.0)

    probe = Fragile()
    env = TaskEnv(probe, compile_tasks(["F(Up & F Down)"], probe.propositions, probe.alphabet))
    _, outcomes = play(env, [1.0, -1.0, 3.0], limit=10)
    assert [float(o.reward) for o in outcomes] == [-0.25, 0.75, -0.25]
    assert [float(o.shared.reward) for o in outcomes] == [-0.25] * 3
    assert [bool(o.shared.ended) for o in outcomes] == [False, False, True]
    assert [bool(o.terminated) for o in outcomes] == [False, True, True]
    assert outcomes[2].totals.episodes == 1 and outcomes[2].totals.timeouts == outcomes[2].totals.violations == 0


def test_verdict_on_the_last_step_is_a_termination(env):
    _, outcomes = play(env, [1.0, -1.0], limit=2)
    assert outcomes[-1].terminated and not outcomes[-1].truncated


def test_episodes_that_start_in_a_later_row_are_not_counted():
    probe = ProbeEnv()
    table = compile_tasks(["F(Up & F Down)"], probe.propositions, probe.alphabet)
    env = TaskEnv(probe, table, simultaneous=1.0)
    episodes = jax.vmap(lambda key: begin(env, key, 10))(jax.random.split(jax.random.key(0), 200))
    rows = np.asarray(env.row(episodes.state))
    assert set(rows) == set(np.flatnonzero(np.asarray(table.verdict) == 0))
    np.testing.assert_array_equal(episodes.task >= 0, rows == int(table.initial_row[0]))


def test_rollout_totals_are_sums_over_finished_episodes(env):
    def policy(memory, obs, row, key):
        action = jnp.where(row == env.table.initial_row[0], 1.0, -1.0)[:, None]
        return memory + 1, action, jnp.zeros(row.shape)

    episodes = jax.vmap(lambda key: begin(env, key, 10))(jax.random.split(jax.random.key(0), 4))
    memory, _, transitions, totals = rollout(env, policy, 0, episodes, jax.random.key(1), 10, 10, DISCOUNT)
    assert memory == 10  # carried from step to step
    assert transitions.obs.shape == (10, 4, 3)
    assert totals.episodes == totals.successes == 4 * 5  # two steps each
    assert totals.length == totals.success_length == 40
    assert transitions.terminated.sum() == 20


def test_tasks_take_turns_and_have_scores_of_their_own():
    probe = ProbeEnv()
    table = compile_tasks(["F Up", "F(Up & F Down)"], probe.propositions, probe.alphabet)
    env = TaskEnv(probe, table)
    episode, seen = begin(env, jax.random.key(0), 10, turn=1), []
    for _ in range(4):  # up, down, up, down: the second task takes both, the first only one step
        for action in (1.0, -1.0):
            episode, outcome = advance(env, episode, jnp.array([action]), jax.random.key(1), 10, DISCOUNT)
            seen.append(outcome)
    tasks = [int(outcome.task) for outcome in seen]
    assert tasks == [1, 1, 0, 1, 1, 1, 0, 1]  # the whole task again from "down" on: F(Up & F Down) waits for an "up"
    outcomes = jax.tree.map(lambda *x: jnp.stack(x), *seen)
    apart = by_task(outcomes.totals, outcomes.task, outcomes.score, 2)
    assert apart["episodes_1"] == 2 and apart["score_1"] == apart["best_score_1"] == 1.0
    assert apart["episodes_2"] == 2
    np.testing.assert_allclose([apart["score_2"], apart["best_score_2"]], [(1 / 2 + 1 / 3) / 2, 1 / 2])
