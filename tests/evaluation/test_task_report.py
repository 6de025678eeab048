"""Reports on many tasks as one table."""

import re

import numpy as np
import pytest

from t2tl_jax.evaluation.episodes import Episodes
from t2tl_jax.evaluation.report import Report, summarise
from t2tl_jax.evaluation.statistics import two_way_mean
from t2tl_jax.evaluation.task_report import RowsMet, over_tasks, tasks_table
from t2tl_jax.ltl import Share


def report(*successes: int) -> Report:
    """Ten episodes of each seed, so many of which succeed in 5 steps; of the others one runs out of time."""
    success = np.arange(10) < np.array(successes)[:, None]
    none = np.zeros_like(success)
    violation = ~success & (np.arange(10) < 9)
    total = success * 1.0 - violation
    lengths = np.full(success.shape, 5)
    return summarise(Episodes(success, violation, none, total, total, total, lengths), range(len(successes)))


def test_means_are_over_seeds_and_tasks():
    found = over_tasks([report(8, 4, 6), report(2, 0, 1)])
    rates = np.array([[0.8, 0.2], [0.4, 0.0], [0.6, 0.1]])
    assert found.success_rate == two_way_mean(rates, 0.0, 1.0) and found.success_rate.value == pytest.approx(0.35)
    assert found.success_rate.low == 0.0 and found.success_rate.high > 0.6
    assert found.success_length.value == 5.0 and found.success_length.count == 5  # one seed never succeeds
    assert found.timeout_rate.value == pytest.approx(0.1) and found.env_termination_rate.value == 0.0


def test_the_means_of_all_tasks_stay_within_what_is_possible():
    success = np.array([[True, True], [True, False]])
    none, lengths = np.zeros_like(success), np.array([[10, 900], [990, 10]])
    total = success * 1.0
    episodes = Episodes(success, none, none, total, total, total, lengths)
    reports = [summarise(episodes, (0, 1), 1000, machines=False) for _ in range(2)]
    found = over_tasks(reports)
    assert (found.success_length.low, found.success_length.high) == (1.0, 1000.0)
    assert found.discounted_return.high == 1.0


def columns(table: str) -> list[list[str]]:
    """Task, both counts and success of the lines of two tasks and of all."""
    return [re.split(r"\s{2,}", line)[1:5] for line in table.splitlines()[2:5]]


def test_a_table_has_a_line_for_each_task_and_one_for_all():
    reports = {"F Up": report(8, 4), "F(Up | Down)": report(10, 6)}
    met = RowsMet({"F Up": (Share(0, 1), Share(1, 1))}, ["From somewhere."])
    table = tasks_table({"final sampled": reports}, met)
    assert re.split(r"\s{2,}", table.splitlines()[0])[:5] == ["policy", "task", "rows met", "renamed", "success"]
    one, other, both = columns(table)
    assert one[:3] == ["F Up", "0/1", "1/1"] and one[3].startswith("0.600 [")
    assert other[:3] == ["F(Up | Down)", "-", "-"]  # nothing is known of it, nor then of both
    assert both[:3] == ["all tasks", "-", "-"] and both[3].startswith("0.700 [")
    assert "over seeds and tasks" in table and "From somewhere." in table


def test_the_line_of_all_tasks_has_the_sums_of_their_rows():
    reports = {"F Up": report(8, 4), "F(Up | Down)": report(10, 6)}
    shares = {"F Up": (Share(0, 1), Share(1, 1)), "F(Up | Down)": (Share(2, 3), Share(3, 3))}
    *_, both = columns(tasks_table({"final sampled": reports}, RowsMet(shares)))
    assert both[:3] == ["all tasks", "2/4", "4/4"]
    part = {"F Up": (Share(0, 1, True), Share(1, 1, True)), "F(Up | Down)": (Share(2, 3), Share(3, 3))}
    table = tasks_table({"final sampled": reports}, RowsMet(part))
    one, _, both = columns(table)
    assert one[1:3] == [">=0/1", "1/1"] and both[1:3] == [">=2/4", "4/4"]
    assert "a task that is new" not in table  # which a count of 0 from some pools does not show


def test_one_seed_has_intervals_over_its_episodes_only():
    text = tasks_table({"final sampled": {"F Up": report(8), "F Down": report(10)}})
    lines = text.splitlines()
    assert "0.800 [0.490, 0.943]" in lines[2] and "0.900  " in lines[4] and "one seed is too few" in lines[-1]
