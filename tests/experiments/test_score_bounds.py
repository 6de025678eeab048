"""Scores that were not stored lie where stored means say, and the page shows both ends beside the published ones."""

import numpy as np
import pytest

from experiments.paper import published_water
from experiments.reproduction import below, score_bounds
from experiments.reproduction.sections import benchmark
from tests.made_up_runs import played, rows

DISCOUNT = 0.9


def means(lengths, paid, carried):
    """What is stored of one iteration of episodes."""
    return {
        "total_reward": np.mean(paid),
        "length": np.mean(lengths),
        "success_rate": np.mean(carried),
        "success_length": np.mean(lengths[carried]) if carried.any() else np.nan,
        "discounted_return": np.mean(paid * DISCOUNT ** (lengths - 1.0)),
    }


@pytest.mark.parametrize("fewest", [3, 11, 30])  # of short episodes the score is convex in what is stored
@pytest.mark.parametrize("longest", [20, 60, 600])
def test_the_score_lies_between_its_bounds(fewest, longest):
    rng = np.random.default_rng(longest)
    stored, true = [], []
    for share in np.linspace(0.0, 1.0, 50):
        paid = rng.random(40) < share
        lengths = np.where(paid, rng.integers(fewest, fewest + longest, 40), rng.integers(1, 600, 40)).clip(max=600)
        stored.append(means(lengths, paid, paid & (rng.random(40) < rng.random())))
        true.append(np.mean(paid * fewest / lengths))
    metrics = {name: np.array([[one[name] for one in stored]]) for name in stored[0]}
    least, greatest = score_bounds.bounds(metrics, [fewest], DISCOUNT)
    assert (least[0] <= np.array(true) + 1e-9).all() and (greatest[0] >= np.array(true) - 1e-9).all()
    assert (least >= 0).all() and (greatest <= 1 + 1e-9).all()


@pytest.mark.parametrize("carried", [False, True])
def test_bounds_meet_where_all_episodes_are_paid_and_alike(carried):
    stored = means(np.full(5, 24), np.ones(5), np.full(5, carried))
    alike = {name: np.array([[value]]) for name, value in stored.items()}
    for bound in score_bounds.bounds(alike, [12], DISCOUNT):
        np.testing.assert_allclose(bound, 0.5, rtol=1e-6)  # rounding alone


def test_cells_hold_the_intervals_of_both_ends():
    assert score_bounds.cell(np.array([0.4, 0.6, np.nan]), np.array([0.8, 0.8, np.nan])) == "0.50 to 0.80"
    shown = score_bounds.cell(np.array([0.49, 0.51]), np.array([0.59, 0.61]))
    assert shown == "0.50 to 0.60 [0.37, 0.73]"  # t of one degree of freedom: 12.7 times 0.01
    assert score_bounds.cell(np.array([np.nan]), np.array([np.nan])) == "-"


def test_the_page_shows_scores_beside_the_published_ones(make):
    paid = {"total_reward": 1.0, "length": 72.0, "discounted_return": DISCOUNT**71, "episodes": 100.0}
    runs = {name: make(name, seeds=(1, 2), frames=200_000, **paid) for name in ("rm-single-ql", "rm-single-crm-slow")}
    text = benchmark.scored(runs)
    assert rows(text)["rm-single-ql"][:3] == ["-", "-", "0.50 to 0.50"]  # of 36 steps at best
    assert rows(text)["crm, published"][5] == "0.92 ± 0.09"
    at = "after 200,000 to 2,000,000 steps"
    assert f"rm-single-ql {at}" in text and f"rm-single-crm-slow {at}." in text
    assert below.OUTSIDE not in text and below.WITHIN in text  # equal seeds say nothing of their spread
    old = make("rm-single-crm", seeds=(1, 2))
    del old.metrics["total_reward"]
    assert "rm-single-crm" not in rows(benchmark.scored({"rm-single-crm": old}))


def test_runs_without_an_evaluation_say_so(make):
    runs = {"rm-single-ql": make("rm-single-ql", seeds=(1, 2))}
    assert benchmark.TRAINING_ALONE in benchmark.benchmark(runs)
    form = "rm-single-crm-published"
    runs[form] = make(form, seeds=(1, 2), evaluated={600: played([1.0, 0.5], 24.0)})
    text = benchmark.benchmark(runs)
    assert benchmark.TRAINING_ALONE not in text and benchmark.EVALUATED.partition("{")[0] in text
    said = " ".join(text.split())
    assert f"final parameters: {form}. Not evaluated: rm-single-ql; nor the published runs." in said
    table, _ = benchmark.evaluated(runs)
    assert rows(table)[form][0].startswith("0.500") and rows(table)[form][1].startswith("0.750")
    assert set(rows(table)) == {"evaluated", form}


def test_best_episodes_of_the_single_task_are_those_of_the_tenth_or_better():
    for number, steps in published_water.SINGLE_BEST_STEPS.items():
        assert steps <= published_water.BEST_STEPS[number][9]
    for means_of, deviations in published_water.SINGLE_SCORES.values():
        assert len(means_of) == len(deviations) == len(published_water.STEPS)
