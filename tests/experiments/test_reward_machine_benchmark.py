"""The section of the benchmark of reward machines: scores by map, paid episodes, and how the runs were set."""

import numpy as np
import pytest

from experiments.paper import published_water
from experiments.reproduction import below, beside
from experiments.reproduction.sections import benchmark, published_ql, ten_tasks
from experiments.reproduction.stored import Stored
from tests.made_up_runs import NEAR, outcome, rows

pytestmark = pytest.mark.usefixtures("unpaired")


def test_whose_values_run_off_is_said(make):
    returns = np.tile(np.array([0.9, 0.45, 0.0, 0.9])[:, None], (1, 10))
    values = np.tile(np.array([0.5, 1.5, 0.5, 2.5])[:, None], (1, 10))
    seen = {"length": 2.0, "discounted_return": returns, "q": values, "seeds": (1, 2, 3, 4)}
    runs = {name: make(name, **seen) for name in ("rm-single-crm", "rm-single-crm_shaped")}
    text = benchmark.overvalued(runs)
    assert "rm-single-crm on map 2 (1.5; return 0.450 at the end" in text and "rm-single-crm on map 4" in text
    assert "shaped on map 4" in text and "shaped on map 2" not in text and "map 1" not in text
    said = benchmark.settings(runs | {"rm-single-ql": make("rm-single-ql")})
    assert "rm-single-crm, rm-single-crm_shaped: learning rate 0.0001, falling to 0" in said
    assert "rm-single-ql: learning rate 3e-05, falling to 0" in said and "the time limit is an end" in said
    assert said.endswith(benchmark.PUBLISHED_SETTINGS) and benchmark.overvalued({}) == ""


def test_the_run_in_the_published_form_says_what_it_has_and_what_still_differs(make):
    form, usual = "rm-single-crm-published", "rm-single-crm"
    runs = {name: make(name, seeds=(1, 2), frames=200_000, episodes=100.0) for name in (usual, form)}
    said = benchmark.settings(runs)
    ours, theirs = "layers 512, 512, 512, head bilinear", "layers 1024, 1024, 1024, head concat"
    assert f"{usual}: learning rate 0.0001, falling to 0; {ours}; gradients clipped as a whole." in said
    assert f"{form}: learning rate 1e-05, constant; {theirs}, a layer of 256 in each of two heads; gradients" in said
    assert "clipped array by array." in said
    text = benchmark.benchmark(runs)
    assert f"{form} - {usual}" in rows(text) and f"{form} after 200,000 to 2,000,000 steps" in text
    assert f"for the slow run and {form}, which have the published one" in " ".join(text.split())
    assert "still differs from the published program" in " ".join(text.split())
    without = " ".join(benchmark.single_note({usual: runs[usual]}).split())
    assert "but for the slow run, which has the published one" in without and form not in without


def test_of_a_run_that_was_cut_nothing_is_said_of_its_end(make):
    form, usual = "rm-single-crm-published", "rm-single-crm"
    cut, whole = make(form, episodes=100.0, frames=100_000), make(usual, episodes=100.0, frames=200_000)
    text = benchmark.rewarded({form: cut, usual: whole})
    assert rows(text)[form][-1] == "-" != rows(text)[usual][-1]
    assert f"\n{usual}: " in text and f"\n{form}: " not in text


def test_the_run_that_was_cut_says_where_beside_the_whole_one(request):
    """Shares of paid episodes at 1 million steps by hand from the metrics: the last iterations with 100 episodes."""
    results = request.config.rootpath / "results"
    said = " ".join(beside.published_form(results).split())
    assert "lost with its machine after 1,382,000 of 2,000,000 steps" in said and "nothing of it was evaluated" in said
    for folder in ("water_h200/rm_single_crm_published_cut", "paper/rm-single-crm-published"):
        columns = Stored(results / folder).columns
        shares = []
        for seed in range(1, 11):
            there = (columns["seed"] == seed) & (columns["frames"] <= 1_000_000)
            episodes, paid = columns["episodes"][there][::-1], columns["total_reward"][there][::-1]
            few = int(np.searchsorted(np.cumsum(episodes), 100)) + 1
            shares.append(np.average(paid[:few], weights=episodes[:few]))
        assert f"{np.mean(shares):.3f}" in said


def test_return_of_recent_episodes(make):
    returns = np.tile([0.0] * 5 + [0.5] * 5, (4, 1))
    run = make("rm-single-crm", discounted_return=returns, episodes=50.0)
    found = benchmark.recent(run, (500, 5000, 6000, 10_000, 10_001), "discounted_return")
    np.testing.assert_allclose(found[0], [np.nan, 0.0, 0.25, 0.5, np.nan])  # 100 episodes are two iterations


def test_paid_episodes_are_compared_with_the_published_share(make):
    """Those of a run that is older than the metric are not known, and not taken for none."""
    reward = np.tile([0.0] * 2 + [0.5] * 8, (4, 1)) + np.array([[-0.1], [0.0], [0.0], [0.1]]) * ([0] * 2 + [1] * 8)
    new = make("rm-single-crm-slow", total_reward=reward, episodes=100.0, frames=200_000)
    old = make("rm-single-ql", episodes=100.0, frames=200_000)
    del old.metrics["total_reward"]
    text = benchmark.rewarded({"rm-single-crm-slow": new, "rm-single-ql": old})
    own = rows(text)["rm-single-crm-slow"]
    assert own[2].startswith("0.000") and own[3].startswith("0.500") and "rm-single-ql" not in rows(text)
    assert f"{below.OUTSIDE}: rm-single-crm-slow after 200,000 to 2,000,000 steps." in text
    assert "rm-single-crm-slow: 0.40, 0.50, 0.50, 0.60." in text
    assert text.endswith(benchmark.UNKNOWN.format("rm-single-ql"))


def test_the_benchmark_judges_counterfactual_learning_by_map(make):
    def ten(name, score):
        columns = {f"{what}_{k + 1}": 1.0 for k in range(10) for what in ("episodes", "best_score")}
        columns |= {f"score_{k + 1}": score for k in range(10)}
        return make(name, seeds=(1, 2, 3, 4), frames=200_000, **columns)

    runs = {"rm-crm": ten("rm-crm", 0.8 + NEAR), "rm-ql": ten("rm-ql", 0.5 + NEAR)}
    scores = ten_tasks.scores(runs)["rm-crm"]
    assert list(scores) == [1, 2, 3, 4] and scores[1] == pytest.approx([0.8] * len(published_water.STEPS))
    text = benchmark.benchmark(runs)
    assert outcome(text, "rm-crm > rm-ql") == "reproduced"
    assert "ql-rs, published" in text and "Corrected for 6 comparisons, 1 of which" in text
    some = {seed: np.full(len(published_water.STEPS), 0.3 + off) for seed, off in enumerate((-0.05, 0.05, -0.05, 0.05))}
    within, outside = ten_tasks.behind({"rm-ql": some, "rm-other": some}).splitlines()
    assert within == f"{below.WITHIN}: rm-ql after 400,000 steps."  # 0.3 [0.21, 0.39] beside 0.33
    assert outside.startswith(f"{below.OUTSIDE}: rm-ql after 600,000 to ") and "other" not in outside
    [said] = [
        line for line in ten_tasks.how_far_behind({"rm-ql": some, "rm-crm": some}).splitlines() if "below" in line
    ]
    assert said.startswith("These means are below by: rm-ql 0.030 to 0.355. Width, head")
    assert ten_tasks.how_far_behind({"rm-ql": {1: np.ones(len(published_water.STEPS))}}) == ""
    assert "A lead on why" not in text
    runs["rm-single-ql"] = make("rm-single-ql")
    text = benchmark.benchmark(runs)
    assert rows(text)["ql, published"] == ["0.378", "0.877", "0.975", "0.986", "0.984"] and "not claimed" not in text
    assert benchmark.benchmark({}) == ""


def test_the_authors_narrow_network_is_a_lead_for_the_single_task(make):
    columns = {f"{what}_{k + 1}": 1.0 for k in range(10) for what in ("episodes", "best_score")}
    single = {"rm-single-crm": make("rm-single-crm")}
    without = " ".join(benchmark.lead({}, single).split())
    assert "score of 0.644 where their 1,024 end at 0.736, so that width alone costs 0.092 there." in without
    assert without.endswith("no such run is published.") and benchmark.lead({}, {}) == ""
    columns |= {f"score_{k + 1}": 0.9 for k in range(10)}
    ten = {"rm-crm": make("rm-crm", seeds=(1, 2), frames=200_000, **columns)}
    assert "ours is as narrow and ends at 0.900" in " ".join(benchmark.lead(ten, single).split())
    assert benchmark.lead(ten, single) in benchmark.benchmark(ten | single)
    worse = {
        "rm-crm": make(
            "rm-single-crm_shaped", seeds=(1, 2), frames=200_000, **columns | {"score_1": 0.0, "score_2": 0.0}
        )
    }
    assert " ".join(benchmark.lead(worse, single).split()) == without


def test_marks_that_follow_one_another_are_told_as_a_range():
    values = np.tile([0.0, 0.0, 0.0, 9.0, 0.0, 0.0], (4, 1)) + np.array([[0.1], [-0.1], [0.2], [-0.2]])
    found = below.marks(values, [1, 2, 3, 4, 5, 6000], [1.0] * 6)
    assert found == {below.WITHIN: [], below.OUTSIDE: ["1 to 3", "5", "6,000"]}


def test_ql_in_the_published_form_is_shown_as_far_as_it_went(request):
    """Up to the last published step that both reached; means by hand from the curves."""
    results = request.config.rootpath / "results"
    text = published_ql.published_ql(results)
    said = " ".join(text.split())
    assert "after 1,888,000 and 1,886,000 of 2,000,000 steps. Nothing was evaluated." in said
    heading, shown = rows(text)["ten tasks: normalised score"], rows(text)["rm-ql-published"]
    assert heading[-1] == "1,800 k" and len(shown) == len(heading) == len(published_water.STEPS) - 1
    runs = {name: Stored(results / "water_h200" / folder) for name, folder in published_ql.CUT.items()}
    paper = {name: Stored(results / "paper" / name) for name in ten_tasks.TEN}
    curves = np.array(list(ten_tasks.scores(paper | runs)["rm-ql-published"].values()))
    assert np.isnan(curves[:, -1]).all() and shown[-1].startswith(f"{curves[:, -2].mean():.2f} [")
    gaps = curves.mean(axis=0)[:-1] - published_water.SCORES["ql"][0][:-1]
    assert f"rm-ql-published from {gaps.min():+.3f} to {gaps.max():+.3f}" in said
    assert "rm-ql-published - rm-ql" in rows(text) and "rm-ql_shaped-published - rm-ql_shaped" in rows(text)
    assert {run.config.learner.learning_rate for run in runs.values()} == {1e-5}
    assert not any(run.config.learner.anneal_learning_rate for run in runs.values())
    assert [run.config.learner.shaping for run in runs.values()] == [False, True]
