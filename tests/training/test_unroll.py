"""The episode loop: what a step hands out before the reset, what an episode counts as, and whose tasks come next."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import compile_reward_machines, compile_tasks, named_machines
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.unroll import Player, begin, by_task, env_scalars, summed, unroll
from tests.probe import DiscreteProbeEnv, ProbeEnv

DISCOUNT = 0.9


def task_env(tasks=("F(Up & F Down)",), probe=None, **changes):
    probe = probe or ProbeEnv()
    return TaskEnv(probe, compile_tasks(list(tasks), probe.propositions, probe.alphabet), **changes)


@pytest.fixture(scope="module")
def env():
    return task_env()


@cache
def program(env, limit, turn):
    """One for all scripts of a length."""

    @jax.jit
    def run(params, script):
        episodes = jax.tree.map(lambda x: x[turn:], begin(env, params, jax.random.key(0), turn + 1, limit))
        player = Player(lambda carry, state, key: (script[carry], carry + 1, ()))
        given = (env, params, player, episodes, 0, jax.random.key(1), len(script), limit, DISCOUNT)
        return unroll(*given, keep=lambda step: step)

    return run


def play(env, actions, limit, turn=0):
    """Where one environment stands after a scripted sequence of actions, and its steps with leading axis [T]."""
    script = jnp.asarray(actions)[:, None]
    episodes, carry, steps = program(env, limit, turn)(env.make_params(0), script)
    assert carry == len(script)  # carried from step to step, over the ends of episodes
    return jax.tree.map(lambda x: x[0], episodes), jax.tree.map(lambda x: x[:, 0] if x.ndim > 1 else x, steps)


def test_tasks_go_on_taking_turns_when_the_number_of_the_episode_overflows():
    env = task_env(("F Up", "F Down", "F(Up & F Down)"))

    @jax.jit
    def started(turn):
        return env.task(env.reset(jax.random.key(0), turn=turn))

    around = jnp.int32(2**31 - 4) + jnp.arange(8, dtype=jnp.int32)
    tasks = [int(started(turn)) for turn in around]
    assert around[3] == 2**31 - 1 and around[4] == -(2**31)
    steps = (np.diff(tasks) % 3).tolist()
    assert set(tasks) == {0, 1, 2} and steps[:3] == steps[4:] == [1, 1, 1]


def test_success_terminates_and_the_next_episode_starts_with_the_whole_task(env):
    episode, steps = play(env, [[1.0], [-1.0]], limit=10)
    assert steps.terminated.tolist() == [False, True] and not steps.truncated.any()
    assert steps.reward.tolist() == [0, 1] and env.row(steps.state)[1] == 0  # the row of true, before the reset
    assert steps.totals.successes.tolist() == [0, 1] and steps.totals.length[1] == 2
    np.testing.assert_allclose(steps.totals.discounted_return, [0, DISCOUNT], rtol=1e-6)
    assert episode.elapsed == 0 and env.row(episode.state) == env.table.initial_row[0]


def test_time_limit_truncates_and_keeps_the_last_row(env):
    episode, steps = play(env, [[1.0], [0.0], [0.0]], limit=3)
    assert steps.truncated.tolist() == [False, False, True] and not steps.terminated.any() and not steps.reward.any()
    assert env.row(steps.state)[-1] != env.table.initial_row[0]  # F Down was left
    assert steps.totals.timeouts[-1] == 1 and not steps.totals.successes.any()
    assert env.row(episode.state) == env.table.initial_row[0]


class Fragile(ProbeEnv):
    """Every step costs 0.25, and an action above 2 breaks it; reports the size of the action."""

    def reset(self, rng, params=None):
        return super().reset(rng).replace(metrics={"effort": jnp.float32(0)})

    def step(self, state, action, params=None):
        state = super().step(state, action)
        return state.replace(
            reward=jnp.float32(-0.25), done=(action[0] > 2.0) * 1.0, metrics={"effort": jnp.abs(action[0])}
        )


def test_what_the_environment_pays_and_ends_is_kept_apart_from_the_task():
    """So that a learner can pay it to every row, and end every row with it."""
    env = task_env(probe=Fragile())
    _, steps = play(env, [[1.0], [-1.0], [3.0]], limit=10)
    assert steps.reward.tolist() == [-0.25, 0.75, -0.25]
    assert steps.shared.reward.tolist() == [-0.25] * 3
    assert steps.shared.ended.tolist() == [False, False, True]
    assert steps.terminated.tolist() == [False, True, True]
    np.testing.assert_allclose(env_scalars(steps.state.metrics)["env_effort"], 5 / 3, rtol=1e-6)


@pytest.mark.slow
def test_an_episode_counts_as_exactly_one_thing():
    """The environment's own end is neither success nor violation, unless the same step decides the task."""
    env = task_env(["!Down U (Up & F Down)"], probe=Fragile())
    cases = {  # by the actions: the outcome, and the rewards by hand
        ((1.0,), (-1.0,)): ("successes", [-0.25, 0.75]),
        ((0.0,), (-1.0,)): ("violations", [-0.25, -1.25]),
        ((0.0,), (0.0,), (0.0,)): ("timeouts", [-0.25] * 3),
        ((0.0,), (3.0,)): ("env_terminations", [-0.25] * 2),
    }
    for actions, (outcome, rewards) in cases.items():
        _, steps = play(env, actions, limit=3)
        totals = summed(steps.totals)
        names = ("successes", "violations", "timeouts", "env_terminations")
        assert {name: int(getattr(totals, name)) for name in names} == {name: int(name == outcome) for name in names}
        assert totals.episodes == 1 and totals.length == len(actions)
        expected = sum(reward * DISCOUNT**t for t, reward in enumerate(rewards))
        np.testing.assert_allclose(totals.discounted_return, expected, rtol=1e-6)
    easy = task_env(["F Up"], probe=Fragile())
    totals = summed(play(easy, [[3.0]], limit=3)[1].totals)  # Up, and broken at once
    assert totals.successes == 1 and totals.env_terminations == 0


def test_rewards_of_a_machine_count_where_they_fall():
    probe = DiscreteProbeEnv()
    probe.propositions = tuple("abcdef")  # of the published tasks; the probe only ever makes the first two true
    probe.labels = lambda state: jnp.zeros(6, bool).at[3].set(state.pipeline_state > 0.5)
    table = compile_reward_machines(named_machines("rm_t10_published"), probe.propositions, "every_subset")
    env = TaskEnv(probe, table)
    _, steps = play(env, [1, 1, 1, 0], limit=4)
    rewards = np.asarray(steps.reward)
    last = int(np.flatnonzero(np.asarray(steps.terminated | steps.truncated))[0])
    expected = sum(rewards[t] * DISCOUNT**t for t in range(last + 1))
    np.testing.assert_allclose(steps.totals.discounted_return[last], expected, rtol=1e-6)


def test_verdict_on_the_last_step_is_a_termination(env):
    _, steps = play(env, [[1.0], [-1.0]], limit=2)
    assert steps.terminated[-1] and not steps.truncated[-1]


def test_episodes_that_start_in_a_later_row_are_not_counted():
    env = task_env(random_starts=1.0)
    episodes = jax.jit(lambda given: begin(env, given, jax.random.key(0), 200, 10))(env.make_params(0))
    rows = np.asarray(env.row(episodes.state))
    assert set(rows) == set(np.flatnonzero(np.asarray(env.table.verdict) == 0))
    np.testing.assert_array_equal(episodes.task >= 0, rows == int(env.table.initial_row[0]))


def test_totals_are_sums_over_finished_episodes(env):
    def act(carry, state, key):
        return jnp.where(env.row(state) == env.table.initial_row[0], 1.0, -1.0)[:, None], carry, ()

    def observe(carry, state, action, reward, ended):
        return carry + ended

    params = env.make_params(0)

    @jax.jit
    def play_all(key):
        return unroll(
            env,
            params,
            Player(act, observe),
            begin(env, params, key, 4, 10),
            jnp.zeros(4),
            key,
            10,
            10,
            DISCOUNT,
            keep=lambda step: (step.obs, step.totals),
        )

    _, ends, (obs, totals) = play_all(jax.random.key(0))
    totals = summed(totals)
    assert obs.shape == (10, 4, 3) and ends.tolist() == [5] * 4
    assert totals.episodes == totals.successes == 4 * 5  # two steps each
    assert totals.length == totals.success_length == 40


def test_first_episodes_can_be_staggered(env):
    @jax.jit
    def limits(key):
        return [begin(env, env.make_params(0), key, 100, 10, staggered).limit for staggered in (True, False)]

    staggered, equal = limits(jax.random.key(0))
    assert set(staggered.tolist()) == set(range(1, 11)) and (equal == 10).all()


@pytest.mark.slow
def test_tasks_take_turns_and_have_scores_of_their_own():
    env = task_env(["F Up", "F(Up & F Down)"])
    # Up, down, up, down: the second task takes both, the first only one step.
    _, steps = play(env, [[1.0], [-1.0]] * 4, limit=10, turn=1)
    assert steps.task.tolist() == [1, 1, 0, 1, 1, 1, 0, 1]  # from "down" on, F(Up & F Down) waits for an "up"
    apart = by_task(steps.totals.episodes, steps.task, steps.total / steps.elapsed, 2)
    assert apart["episodes_1"] == 2 and apart["score_1"] == apart["best_score_1"] == 1.0
    assert apart["episodes_2"] == 2
    np.testing.assert_allclose([apart["score_2"], apart["best_score_2"]], [(1 / 2 + 1 / 3) / 2, 1 / 2])
