"""The sections of the results, from runs that nobody trained: figures by hand, outcomes, and what is missing."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.paper import published_attention, published_water, published_widths, step_tables
from experiments.reproduction import below, cells, chance, claims, measures, representations
from experiments.reproduction.items import ITEMS
from experiments.reproduction.sections import (
    ablation,
    attention,
    benchmark,
    figures,
    safe,
    settings,
    steps,
    unit_time,
    widths,
)
from experiments.reproduction.stored import Stored
from experiments.reproduction.work import READING
from t2tl_jax.registry import named_config
from tests.made_up_runs import played, pretrained, reading, rows

SEEDS = (0, 1, 2, 3)
NEAR = np.array([0.0, 0.001, 0.002, 0.003])


@pytest.fixture(autouse=True)
def unpaired(monkeypatch):
    """Environments need not be built to see whether seeds share maps: `test_claims.py` does that."""
    monkeypatch.setattr(claims, "worlds", lambda config, seeds: None)


def outcome(text, claim):
    return rows(text)[claim][-1]


def test_steps_of_who_fails_count_as_the_limit(make):
    """gnn is faster where it succeeds, and hardly ever succeeds."""
    runs = {
        "steps-4-1-t1tl": make("steps-4-1-t1tl", evaluated={1000: played(1.0, [200.0, 201.0, 202.0, 203.0])}),
        "steps-4-1-gnn": make(
            "steps-4-1-gnn", evaluated={1000: played([0.1, 0.1, 0.1, 0.0], [100.0, 110.0, 120.0, None])}
        ),
    }
    assert steps.completion(runs["steps-4-1-gnn"], 1000) == {0: 910.0, 1: 911.0, 2: 912.0, 3: 1000.0}
    text = steps.steps(runs)
    assert outcome(text, "steps-4-1-t1tl < steps-4-1-gnn") == "reproduced"
    assert "Corrected for 9 comparisons, 1 of which can be made so far." in text
    assert "Obstacles" not in text and "10,000 frames a seed" in text
    cells = rows(text)["4 goals, 1 obstacles, 1x"]
    assert cells[0] == "gnn" and cells[1:4] == ["-"] * 3  # not evaluated within 600
    assert cells[5].startswith("110.0 [") and cells[-1] == "191.7 ± 3.2"
    assert steps.steps({}) == ""


def test_every_world_of_a_table_of_steps_has_the_published_order():
    planned = steps.claims(step_tables.BY_SIZE, True)
    assert len(planned) == 9 and ("steps-5-2-size-2.5-gnn", "steps-5-2-size-2.5-rm") in planned
    for cell in (*step_tables.BY_GOALS, *step_tables.BY_OBSTACLES, *step_tables.BY_SIZE):
        for fewer, more in steps.ORDER:
            assert cell.published[fewer] < cell.published[more]


def test_the_beginning_stands_beside_what_learns_sooner(make):
    rates = {"water-rm": 0.2 + NEAR, "water-rm-per-16": 0.5 + NEAR}
    runs = {name: make(name, success_rate=rate, episodes=1000.0) for name, rate in rates.items()}
    text = figures.water_beginning(runs)
    assert rows(text)["water-rm-per-16 - water-rm"][0].startswith("0.")
    assert "Corrected for 4 comparisons, 1 of which can be made so far." in text
    assert "500" in rows(text) and "3,000" in rows(text) and "3,500" not in rows(text)
    assert figures.water_beginning({}) == ""


def test_reward_per_minute_counts_pretraining_and_needs_it(make):
    runs = {
        name: make(name, success_rate=rate)
        for name, rate in (("water-rm", 0.5 + NEAR), ("water-dfa", 0.2 + NEAR), ("water-t1tl", 1 - NEAR))
    }
    runs |= {f"{name}-alone": make(f"{name}-alone", seeds=(0,), frames=500) for name in list(runs)}  # half of each
    assert unit_time.reward_sum(runs["water-rm"])[0] == pytest.approx(50.0)  # 10 iterations of 10 episodes
    text = unit_time.unit_time(runs)
    assert "water-t1tl" not in rows(text)  # without the time of its pre-training
    assert rows(text)["water-rm"][1:5] == ["10,000", "5,000", "120 s", "30 s"]
    assert outcome(text, "water-rm > water-dfa") == "reproduced"
    assert "Corrected for 10 comparisons, 1 of which can be made so far." in text
    before = "water-pretraining-transformer-alone"
    runs[before] = make(before, seeds=(0,), status={"all_sessions": {"training_seconds": 540.0, "compile_seconds": 0}})
    text = unit_time.unit_time(runs)
    assert rows(text)["water-t1tl"][1:4] == ["20,000", "15,000", "660 s"]
    assert outcome(text, "water-t1tl > water-rm") == "not reproduced"
    assert unit_time.unit_time({}) == ""


def test_printed_rewards_per_unit_time_stand_in_their_order():
    for world, values in unit_time.PUBLISHED.items():
        means = [mean for mean, _ in values.values()]
        assert means == sorted(means, reverse=True) and len(unit_time.claims(world)) == 10


def test_widths_are_two_comparisons_beside_the_published_values(make):
    episodes = {"iterations": 100, "episodes": 100.0}
    runs = {
        "water-t1tl": make("water-t1tl", success_rate=0.9 + NEAR, **episodes),
        "water-rm-32": make("water-rm-32", success_rate=0.5 + NEAR, **episodes),
        "zone-t1tl-fresh-16": make("zone-t1tl-fresh-16", discounted_return=0.5 + NEAR),
        "zone-dfa": make("zone-dfa", discounted_return=0.6 + NEAR),
    }
    text = widths.dimensions(runs)
    assert outcome(text, "water-t1tl > water-rm-32") == "reproduced"
    assert outcome(text, "zone-t1tl-fresh-16 > zone-dfa") == "not reproduced"
    assert rows(text)["T1TL_pre 32"][2] == "-0.14"  # the mean of the eight published values
    assert text.count("Corrected for 5 comparisons, 1 of which") == 2
    only = widths.dimensions({"zone-dfa": runs["zone-dfa"]})
    assert "WaterWorld: " not in only and "DFA 16, published" in only and "claim |" not in only
    assert widths.dimensions({}) == ""


def test_claims_of_widths_are_orders_of_the_published_curves():
    for claimed, curves, values in (
        (widths.WATER_CLAIMS, widths.WATER, lambda curve: np.mean(published_widths.WATER[curve])),
        (widths.ZONE_CLAIMS, widths.ZONE, lambda curve: published_widths.ZONE[curve][-1]),
    ):
        for better, worse in claimed:
            assert values(curves[better]) > values(curves[worse]), (better, worse)


def test_claims_of_the_figures_are_orders_of_the_published_curves():
    for better, worse in figures.ZONE_CLAIMS:
        first, second = (figures.ZONE_PUBLISHED[name][1] for name in (better, worse))
        assert first[-1] > second[-1] and np.mean(first) > np.mean(second)
    for better, worse in figures.WATER_CLAIMS:
        first, second = (figures.WATER_PUBLISHED[name] for name in (better, worse))
        assert np.mean(first) > np.mean(second), (better, worse)


def test_the_zone_figure_is_judged_at_the_end_and_over_training(make):
    late = np.concatenate([np.zeros((4, 9)), 0.8 + NEAR[:, None]], axis=1)
    runs = {
        "zone-t2tl": make("zone-t2tl", discounted_return=late, status=pretrained(2000)),
        "zone-gnn": make("zone-gnn", discounted_return=0.5 + NEAR),
    }
    text = figures.zone_figure(runs)
    verdicts = [line.split(" | ")[-1] for line in text.splitlines() if line.startswith("| zone-t2tl > zone-gnn")]
    assert verdicts == ["reproduced |", "not reproduced |"]
    assert text.count("Corrected for 9 comparisons, 1 of which") == 2


def test_simultaneous_learning_is_claimed_and_its_pieces_are_not(make):
    runs = {
        "water-rm": make("water-rm", success_rate=0.9 + NEAR),
        "water-dfa": make("water-dfa", success_rate=0.5 + NEAR),
        "water-rm-every-step": make("water-rm-every-step", success_rate=0.5 + NEAR),
    }
    text = ITEMS["simultaneous-one-hot"].section(runs)
    assert outcome(text, "water-rm > water-dfa") == "reproduced"
    assert outcome(text, "water-rm - water-rm-every-step") == "not claimed"
    assert "Corrected for 6 comparisons, 2 of which can be made so far." in text


def test_labels_as_printed_stand_beside_both_trainings_of_the_default(make):
    item = ITEMS["printed-water"]
    runs = {name: make(name, success_rate=rate + NEAR) for name, rate in zip(item.runs, (0.5, 0.6, 0.2), strict=True)}
    assert "commit" not in item.section(runs)  # all are of the same unknown one
    for name, revision in zip(runs, "abc", strict=True):
        (runs[name].path / "versions.json").write_text(json.dumps({"started": {"git_revision": 40 * revision}}))
    text = item.section({name: Stored(run.path) for name, run in runs.items()})
    shown = rows(text)
    assert shown["water-t1tl - water-t1tl-labels-state"][0].startswith("0.300")
    assert shown["water-t1tl-again - water-t1tl-labels-state"][0].startswith("0.400")
    assert "Corrected for 2 comparisons." in text
    assert "water-t1tl of aaaaaaa, water-t1tl-again of bbbbbbb, water-t1tl-labels-state of ccccccc." in text
    assert item.names("smoke") == ("water-t1tl",)


def test_frames_of_pretraining_go_before_those_of_training(make):
    curve = np.tile([0.0] * 9 + [1.0] * 11, (4, 1))
    each = {"success_rate": curve, "iterations": 20, "frames": 50_000}
    runs = {
        "water-t1tl-pre-own": make("water-t1tl-pre-own", **each, status=pretrained(250_000)),
        "water-t1tl-pre-none": make("water-t1tl-pre-none", **each),
    }
    own, none = runs.values()
    assert measures.frames_to(own) == dict.fromkeys(SEEDS, 500_000)
    assert measures.delayed(own, "success_rate") == dict.fromkeys(SEEDS, 0.3)  # five iterations less of 11 in 20
    assert measures.delayed(none, "success_rate") == dict.fromkeys(SEEDS, 0.55)
    long = make("water-gnn-pre-own", **each, status=pretrained(5_000_000))
    assert measures.delayed(long, "success_rate") == dict.fromkeys(SEEDS, 0.0)
    unknown = make("water-gnn-pre-random", **each)
    assert measures.delayed(unknown, "success_rate") == {}
    seconds = f"{own.train_seconds:.0f}"
    assert [cells.cost(run)[1] for run in (own, none, unknown)] == [
        f"{seconds} + 5 s",
        f"{seconds} s",
        f"{seconds} + ? s",
    ]
    text = ITEMS["pretraining-water"].section(runs)
    shown = rows(text)["water-t1tl-pre-own"]
    assert shown[5] == "0.50 M" and shown[6] == "0.75 M" and "1,000,000 + 250,000" in shown
    compared = [line for line in text.splitlines() if line.startswith("| water-t1tl-pre-own > water-t1tl-pre-none")]
    assert ["| 0.000 |" in compared[0], "| -0.250 |" in compared[1]] == [True, True]


def test_why_an_encoder_stays_behind_is_shown(make):
    moving = {"code_change_relative": 0.2 + NEAR, "target_lag": 0.1 + NEAR}
    runs = {
        "water-t1tl": make("water-t1tl", target_lag=0.1 + NEAR),
        "water-paper-t1tl": make("water-paper-t1tl", **moving),
        "water-paper-t1tl-slow": make("water-paper-t1tl-slow", **moving),
        "water-rm": make("water-rm"),
    }
    rates = {name: ablation.encoder_rate(run) for name, run in runs.items()}
    assert rates == {
        "water-t1tl": "frozen",
        "water-paper-t1tl": "0.0004, as the rest",
        "water-paper-t1tl-slow": "4e-05, the rest 0.0004",
        "water-rm": "nothing to learn",
    }
    del runs["water-rm"]
    shown = rows(ITEMS["water-form"].section(runs))
    assert shown["water-t1tl"][6:9] == ["frozen", "-", "-"] and shown["water-t1tl"][9].startswith("0.10")
    assert [cell[:5] for cell in shown["water-paper-t1tl-slow"][7:10]] == ["0.202", "0.202", "0.102"]
    assert "water-paper-t1tl-slow - water-paper-t1tl" in shown


def test_violations_are_counted_by_episode(make):
    episodes = np.tile([30.0, 10.0], (4, 1))
    rates = np.tile([0.4, 0.0], (4, 1))
    runs = {
        "safe-t1tl": make(
            "safe-t1tl", iterations=2, episodes=episodes, violation_rate=rates, evaluated={1000: played(1.0, 9.0)}
        ),
        "safe-dfa": make("safe-dfa", evaluated={1000: played([0.1, 0.2, 0.3, 0.4], 9.0)}),
    }
    assert safe.violations(runs["safe-t1tl"]) == pytest.approx(dict.fromkeys(SEEDS, 0.3))
    text = safe.safe(runs)
    assert "safe-t1tl - safe-dfa" in text and "Corrected for 5 comparisons, 1 of which" in text
    assert "outcome" not in text and safe.safe({}) == ""
    assert "difference" not in safe.safe({"safe-dfa": runs["safe-dfa"]})


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


def test_small_batches_are_judged_by_their_values_and_the_step_size_is_said(make):
    falling = np.tile([0.0] * 5 + [0.8] + [0.0] * 3 + [0.4], (4, 1))  # eighths of ten iterations
    runs = {
        "water-rm-per-16": make("water-rm-per-16", q=0.25, success_rate=0.5),
        "water-rm-every-step": make("water-rm-every-step", q=falling, success_rate=falling / 2),
    }
    text = ablation.small_batches(runs)
    assert "`water-rm-every-step`" in text and "at the same step size" in text
    assert "average 0.80 over all open rows, and it succeeds in 0.40" in text and "(the other: 0.25 and 0.50)" in text
    assert text.endswith("falls to 0, 0.40 and 0.20.")  # by no means better once steps are small
    better = falling.copy()
    better[:, 9] = 1.8
    others = {
        "water-t1tl-per-16": make("water-t1tl-per-16", q=0.25, success_rate=0.5),
        "water-t1tl-every-step": make("water-t1tl-every-step", q=falling, success_rate=better / 2),
    }
    assert ablation.small_batches(others).endswith(f"0.90.{ablation.TOO_HIGH}")
    assert ablation.small_batches({"water-rm-every-step": runs["water-rm-every-step"]}) == ""


def test_for_which_form_settings_were_chosen_is_said_beside_the_others(make):
    names = ("water-t1tl", "water-paper-t1tl", "water-rm", "water-dfa", "water-rm-per-16")
    runs = {name: make(name) for name in names}
    text = settings.chosen({name: runs[name] for name in names[:2]})
    assert text.startswith("Settings were chosen for `waterworld_dqn` on seeds 100-111 (with rm; codes: t1tl), where")
    assert "a frozen encoder and the bilinear head. They were not chosen again for an encoder that is trained" in text
    assert (
        "trained on (water-paper-t1tl); nor for a code that is concatenated with the state (water-paper-t1tl)" in text
    )
    own_row = settings.chosen({name: runs[name] for name in ("water-rm", "water-dfa")})
    assert "again for learning from the own row alone (water-dfa). " in own_row and "trained on" not in own_row
    assert settings.chosen({name: runs[name] for name in ("water-t1tl", "water-rm")}) == ""
    assert settings.chosen({"water-rm-per-16": runs["water-rm-per-16"]}) == " ".join(settings.EARLIER.split())
    zone = {name: make(name) for name in ("zone-t1tl-pre-none", "zone-published-t1tl")}
    assert settings.chosen(zone) == ""  # in what form those of ZoneEnv were chosen is not recorded


@pytest.mark.parametrize("item", ["water-form", "simultaneous", "simultaneous-one-hot", "pretraining-water"])
def test_sections_of_waterworld_say_for_which_form_settings_were_chosen(make, item):
    text = ITEMS[item].section({name: make(name) for name in ITEMS[item].runs})
    assert "They were not chosen again for " in text and settings.LEADS in text


def test_encoders_that_begin_otherwise_have_no_settings_of_their_own(make):
    names = [f"water-gnn-pre-{kind}" for kind in ("none", "own")]
    said = settings.chosen({name: make(name) for name in names})
    assert "an encoder that is trained on (all runs here); nor for no pre-training (water-gnn-pre-none)." in said


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
    scores = benchmark.scores(runs)["rm-crm"]
    assert list(scores) == [1, 2, 3, 4] and scores[1] == pytest.approx([0.8] * len(published_water.STEPS))
    text = benchmark.benchmark(runs)
    assert outcome(text, "rm-crm > rm-ql") == "reproduced"
    assert "ql-rs, published" in text and "Corrected for 4 comparisons, 1 of which" in text
    some = {seed: np.full(len(published_water.STEPS), 0.3 + off) for seed, off in enumerate((-0.05, 0.05, -0.05, 0.05))}
    within, outside = benchmark.behind({"rm-ql": some, "rm-other": some}).splitlines()
    assert within == f"{below.WITHIN}: rm-ql after 400,000 steps."  # 0.3 [0.21, 0.39] beside 0.33
    assert outside.startswith(f"{below.OUTSIDE}: rm-ql after 600,000 to ") and "other" not in outside
    [said] = [
        line for line in benchmark.how_far_behind({"rm-ql": some, "rm-crm": some}).splitlines() if "below" in line
    ]
    assert said.startswith("These means are below by: rm-ql 0.030 to 0.355. Width, head")
    assert benchmark.how_far_behind({"rm-ql": {1: np.ones(len(published_water.STEPS))}}) == ""
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


def test_attention_claims_are_asked_of_every_seed(make):
    run = make("prime-own", seeds=tuple(range(12)), status=pretrained(7000))
    star = {"start": {"3: and": 6, "8: White": 6}, "end": {"4: Black": 12}}
    (run.path / READING).write_text(json.dumps(reading(star, agreement=0.0, black=1.0, seeds=12)))
    text = attention.attention({"prime-own": run})
    assert outcome(text, "prime-own: token* is the conjunction at the start") == "undecided"
    assert outcome(text, "prime-own: token* is Black at the end") == "reproduced"
    assert outcome(text, "prime-own: token* is the needed token at the end") == "not reproduced"
    assert outcome(text, "prime-own: Black is entered first at the end") == "reproduced"
    assert "Corrected for 8 comparisons, 4 of which can be made so far." in text
    assert rows(text)["4: Black"][-2:] == ["0.96", "1.67"]
    assert rows(text)["published, end"][0] == "Black (1.67)"
    assert "| layer 0 | layer 1 |" in text and "Pre-training, apart: 7,000 frames a seed" in text
    assert attention.attention({}) == ""


def test_attention_without_weights_is_removal_alone(make):
    """A graph network attends to nothing; runs that were read before projections were stored have none."""
    run = make("prime-fresh")
    found = reading({"start": {}, "end": {}}, agreement=0.0, black=0.5, seeds=4)
    for stage in found["over_seeds"].values():
        stage["attention_received"], stage["agreement"] = None, dict.fromkeys(("value", "low", "high")) | {"count": 0}
    del found["out_projection_change"]
    (run.path / READING).write_text(json.dumps(found))
    text = attention.attention({"prime-fresh": run})
    assert outcome(text, "prime-fresh: Black is entered first at the end") == "undecided"
    assert "token* is" not in text.split("Token* is")[0] and "layer 0" not in text


def test_agents_that_do_not_do_the_task_are_counted_beside_their_attention(make):
    runs, limit = {}, named_config("zone_ppo").episode_length
    for name, rates in (("prime-fresh", [1.0, 1.0, 0.96, 0.04]), ("prime-own", None)):
        runs[name] = make(name, evaluated={limit: played(rates, 9.0)} if rates else None)
        (runs[name].path / READING).write_text(json.dumps(reading({"start": {}, "end": {}}, 0.5, 0.5, 4)))
    text = attention.attention(runs)
    assert rows(text)["prime-fresh, start"][-2:] == ["-", "-"] == rows(text)["prime-own, end"][-2:]
    assert rows(text)["prime-fresh, end"][-2] == "3/4" and rows(text)["prime-fresh, end"][-1].startswith("0.750 [")
    assert "carry it out is 0.75 (prime-fresh)." in " ".join(text.split())
    assert attention.of_all({("prime-own", "end"): {}}, runs) == ""


def test_published_attention_sums_to_the_heads():
    for values in (published_attention.START, published_attention.END):
        assert len(values) == len(published_attention.TOKENS) and sum(values) == pytest.approx(8, abs=0.05)


def test_every_section_works_with_any_single_run(make):
    """As they come in one after the other; most say nothing of a claim yet."""
    score = {f"{what}_{k + 1}": 0.5 for k in range(10) for what in ("episodes", "score", "best_score")}
    star = {"start": {"3: and": 2}, "end": {"4: Black": 2}}
    made = {}
    for name, item in ITEMS.items():
        own = [one for one in item.runs if one not in (representations.NAME, chance.NAME)]
        for one in own:
            if one not in made:
                columns = score if name == "benchmark" else {}
                made[one] = make(one, seeds=(1, 2), frames=200_000, iterations=3, **columns)
                (made[one].path / READING).write_text(json.dumps(reading(star, 0.5, 0.5, 2)))
            assert isinstance(item.section({one: made[one]}), str)
        assert not own or item.section({one: made[one] for one in own})


def test_marks_that_follow_one_another_are_told_as_a_range():
    values = np.tile([0.0, 0.0, 0.0, 9.0, 0.0, 0.0], (4, 1)) + np.array([[0.1], [-0.1], [0.2], [-0.2]])
    found = below.marks(values, [1, 2, 3, 4, 5, 6000], [1.0] * 6)
    assert found == {below.WITHIN: [], below.OUTSIDE: ["1 to 3", "5", "6,000"]}


def test_compared_runs_that_differ_in_several_settings_say_which():
    shared = named_config("zone_ppo")
    slower = dataclasses.replace(shared.learner, epochs=9, discount=0.5)
    configs = {
        "base": shared,
        "one": dataclasses.replace(shared, random_starts=0.5),
        "two": dataclasses.replace(shared, learner=slower, seeds="3"),
        "fresh": dataclasses.replace(shared, pretrained="", learner=slower),
    }
    runs = {name: SimpleNamespace(config=config) for name, config in configs.items()}
    pairs = [("base", "one"), ("base", "two"), ("two", "fresh"), ("base", "fresh"), ("base", "missing")]
    text = settings.settings(runs, pairs)
    epochs, discount = shared.learner.epochs, shared.learner.discount
    first = f"- base, two: `learner.discount` {discount}, 0.5; `learner.epochs` {epochs}, 9."
    assert text.splitlines()[:3] == [settings.MANY, "", first]
    assert text.splitlines()[3].startswith("- base, fresh: ") and "`pretrained` auto:own, no" in text
    assert len(text.splitlines()) == 4 and settings.settings(runs, [("base", "one")]) == ""
