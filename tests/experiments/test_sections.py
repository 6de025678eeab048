"""The sections of the results, from runs that nobody trained: figures by hand, outcomes, and what is missing.

Of two sections see `test_reward_machine_benchmark.py` and `test_attention_section.py`; of what is said of settings
below several of them `test_settings_said.py`.
"""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from experiments.paper import published_widths, step_tables
from experiments.reproduction import cells, chance, measures, representations
from experiments.reproduction.items import ITEMS
from experiments.reproduction.runs import ZONE_FRAMES
from experiments.reproduction.sections import (
    ablation,
    figures,
    safe,
    safe_again,
    steps,
    timing_doubts,
    unit_time,
    widths,
)
from experiments.reproduction.stored import Stored
from experiments.reproduction.work import READING
from tests.made_up_runs import NEAR, outcome, played, pretrained, reading, rows, write

SEEDS = (0, 1, 2, 3)

pytestmark = pytest.mark.usefixtures("unpaired")


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
        for name, rate in (("water-rm-6", 0.5 + NEAR), ("water-dfa", 0.2 + NEAR), ("water-t1tl", 1 - NEAR))
    }
    runs |= {f"{name}-alone": make(f"{name}-alone", seeds=(0,)) for name in list(runs)}
    assert unit_time.reward_sum(runs["water-rm-6"])[0] == pytest.approx(50.0)  # 10 iterations of 10 episodes
    text = unit_time.unit_time(runs)
    assert "water-t1tl" not in rows(text)  # without the time of its pre-training
    assert rows(text)["water-rm-6"][1:4] == ["10,000", "60 s", "30 s"]
    assert outcome(text, "water-rm-6 > water-dfa") == "reproduced"
    assert "Corrected for 10 comparisons, 1 of which can be made so far." in text
    before = "water-pretraining-transformer"
    runs[before] = make(before, frames=1500)  # half as many again as the one seed alone needed
    assert unit_time.unit_time(runs) == text
    alone = f"{before}-alone"
    runs[alone] = make(alone, seeds=(0,), status={"all_sessions": {"training_seconds": 360.0, "compile_seconds": 0}})
    text = unit_time.unit_time(runs)
    assert rows(text)["water-t1tl"][1:3] == ["25,000", "600 s"]  # 60 and one and a half times 360
    assert outcome(text, "water-t1tl > water-rm-6") == "not reproduced"
    runs["water-dfa_cont"] = make("water-dfa_cont")
    runs["water-dfa_cont-alone"] = make("water-dfa_cont-alone", seeds=(0,), frames=500)
    assert "water-dfa_cont" not in rows(unit_time.unit_time(runs))  # half a training tells nothing of a whole one
    assert unit_time.unit_time({}) == ""


def test_the_time_of_another_training_is_not_taken(make):
    runs = {"water-rm-6": make("water-rm-6", success_rate=0.5 + NEAR)}
    runs["water-rm-6-alone"] = make("water-rm-alone", seeds=(0,))  # whose code has another width
    assert unit_time.unit_time(runs) == ""


def test_orders_that_hang_on_a_tenth_of_a_time_are_named(make):
    wanted = {"water-rm-6": 0.55 + NEAR, "water-dfa": 0.5 + NEAR, "water-t1tl": 0.95 + NEAR}
    runs = {name: make(name, success_rate=rate) for name, rate in wanted.items()}
    rates = {name: unit_time.per_minute(unit_time.reward_sum(run), 60.0) for name, run in runs.items()}
    pairs = [("water-rm-6", "water-dfa"), ("water-t1tl", "water-dfa"), ("water-t1tl", "water-gnn")]
    (said,) = timing_doubts.doubts(runs, {"water": pairs}, rates)
    assert "these outcomes would be others: water-rm-6 > water-dfa." in " ".join(said.split())
    assert timing_doubts.doubts(runs, {"water": pairs[1:]}, rates) == []


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


def test_a_main_run_that_was_made_once_more_is_named_where_all_are_of_one_commit_and_of_the_plan(make, tmp_path):
    section = ITEMS["pretraining-zone"].section
    runs = {name: make(name) for name in ("zone-t2tl-pre-own", "zone-t2tl-pre-none")}
    said = " ".join(section(runs).split())
    assert "some trainings were made once more: `zone-t2tl-pre-own` that of `zone-t2tl`." in said
    config = runs["zone-t2tl-pre-none"].config
    short = write(tmp_path / "short", replace(config, frames=config.frames // 10))
    assert "once more" not in section(runs | {"zone-t2tl-pre-none": short})
    (runs["zone-t2tl-pre-none"].path / "versions.json").write_text(json.dumps({"started": {"git_revision": 40 * "a"}}))
    assert "once more" not in section({name: Stored(run.path) for name, run in runs.items()})


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
    assert "difference" not in safe.safe({"safe-dfa": runs["safe-dfa"]}) and "Not compared" not in text


def test_a_shorter_training_is_not_compared(make, tmp_path):
    methods = ("t1tl", "dfa", "gnn")
    runs = {name: make(name, evaluated={1000: played(1.0, 9.0)}) for name in (f"safe-{one}" for one in methods)}
    short = replace(runs["safe-dfa"].config, frames=ZONE_FRAMES // 10)
    runs["safe-dfa"] = write(tmp_path / "short", short, evaluated={1000: played(1.0, 9.0)})
    text = safe.safe(runs)
    assert "safe-t1tl - safe-gnn" in text and "safe-t1tl - safe-dfa" not in text
    assert "Corrected for 5 comparisons, 1 of which can be made so far." in text
    assert "Not compared, since one had more frames than the other: safe-t1tl and safe-dfa." in text
    alone = safe.safe({name: runs[name] for name in ("safe-t1tl", "safe-dfa")})
    assert "p (Holm)" not in alone and "Not compared" in alone


def test_trainings_that_were_made_twice_stand_beside_each_other(configs, tmp_path):
    """Two seeds of four solve the task the first time, and two others of them, one the same, the second time."""
    assert safe_again.said(tmp_path, ["safe-t2tl"]) == ""
    for folder, rates in ((safe_again.FOLDER, [1.0, 1.0, 0.0, 0.0]), ("paper", [0.0, 1.0, 1.0, 0.0])):
        for name in ("safe-t2tl", "safe-gnn"):
            evaluated = {1000: played(rates, 9.0)}
            write(tmp_path / folder / name, configs[name], evaluated=evaluated)
    shutil.rmtree(tmp_path / safe_again.FOLDER / "safe-gnn")
    assert rows(safe_again.safe_again(tmp_path))["safe-t2tl"][:3] == ["2/4", "2/4", "2"]
    said = safe_again.said(tmp_path, ["safe-t2tl", "safe-gnn"])
    assert f"(#{safe_again.ANCHOR})" in said and said.endswith(": safe-t2tl.")


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


@pytest.mark.slow
def test_every_section_works_with_any_single_run(make):
    """As they come in one after the other; most say nothing of a claim yet."""
    score = {f"{what}_{k + 1}": 0.5 for k in range(10) for what in ("episodes", "score", "best_score")}
    star = {"start": {"3: and": 2}, "end": {"4: Black": 2}}
    made = {}
    for item in ITEMS.values():
        own = [one for one in item.runs if one not in (representations.NAME, chance.NAME)]
        for one in own:
            if one not in made:
                columns = score if one.startswith("rm-") else {}
                made[one] = make(one, seeds=(1, 2), frames=200_000, iterations=3, **columns)
                (made[one].path / READING).write_text(json.dumps(reading(star, 0.5, 0.5, 2)))
            assert isinstance(item.section({one: made[one]}), str)
        assert not own or item.section({one: made[one] for one in own})
