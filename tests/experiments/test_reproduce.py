"""The reproduction: what it plans, how its runs are shared and kept, and the page that is written from them."""

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from experiments import reproduce
from experiments.reproduction import claims, items, measures, representations, stored, work
from experiments.reproduction.page import SMOKE, page
from experiments.reproduction.plan import Item, Run, Scale
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import unit_time
from t2tl_jax.errors import UserError
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.interrupts import NeverStop
from t2tl_jax.runs.success import window

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def runs():
    return all_runs()


def test_the_page_is_that_of_the_stored_runs():
    """Written anew by ``python -m experiments.reproduce --report True``."""
    assert (ROOT / "docs" / "paper.md").read_text() == page(items.ITEMS, stored.load(reproduce.RESULTS), smoke=False)


def test_what_is_stored_was_made_from_clean_commits():
    for name, run in stored.load(reproduce.RESULTS).items():
        assert run.versions["git_revision"] and not run.versions["git_modified"], name


def test_every_item_names_runs_that_there_are_and_every_run_serves_an_item(runs):
    shown = {name for item in items.ITEMS.values() for name in item.runs}
    assert shown <= set(runs)
    assert set(work.needed(runs, sorted(shown))) == set(runs)
    assert all(set(item.smoke) <= set(item.runs) for item in items.ITEMS.values())


@pytest.mark.parametrize("scale", ["smoke", "full"])
def test_every_run_has_a_configuration_at_either_scale(runs, scale):
    for name, run in runs.items():
        if run.measure is None:
            config = Scale(scale, "12").apply(run)
            assert config.frames <= 10_000_000
            assert scale == "full" or config.frames <= 3 * config.learner.frames_per_iteration, name
            assert (run.before is not None) == bool(config.pretrained), name


def test_runs_that_are_compared_differ_in_what_they_say(runs):
    """One configuration under two names would be one run shown as two."""
    seen: dict = {}
    for name, run in runs.items():
        if run.config is not None:
            key = (repr(run.config), run.before, run.seeds)
            assert key not in seen, (name, seen[key])
            seen[key] = name


def test_needed_runs_come_before_what_starts_from_them():
    runs = {"a": Run(None), "b": Run(None, before="a"), "c": Run(None, before="b")}
    assert work.needed(runs, ["c", "b"]) == ["a", "b", "c"]


def fake(name, done, fails=()):
    def measure(folder):
        if name in fails:
            raise ValueError("no luck")
        folder.mkdir()
        (folder / "status.json").write_text(json.dumps({"ended": "complete", "seeds": []}))
        done.append(name)

    return measure


def test_what_is_done_is_kept_what_fails_is_told_and_the_rest_goes_on(tmp_path):
    done, said = [], []
    runs = {name: Run(None, measure=fake(name, done, ("b",)), evaluated=False) for name in "abc"}
    scale, deadline = Scale("full", "1"), work.Deadline(1.0)
    assert work.do_all(runs, list("abc"), scale, tmp_path, deadline, NeverStop(), said.append) == ["b"]
    assert done == ["a", "c"] and any("no luck" in line for line in said)
    runs["b"] = Run(None, measure=fake("b", done), evaluated=False)
    assert work.do_all(runs, list("abc"), scale, tmp_path, deadline, NeverStop(), said.append) == []
    assert done == ["a", "c", "b"]
    assert work.do_all(runs, list("abc"), scale, tmp_path, work.Deadline(-1.0), NeverStop(), said.append) == []


def test_a_wish_to_stop_is_heard_between_runs(tmp_path):
    done, stop = [], SimpleNamespace(requested=False)
    first = fake("a", done)

    def measure(folder):
        first(folder)
        stop.requested = True

    runs = {"a": Run(None, measure=measure, evaluated=False), "b": Run(None, measure=fake("b", done), evaluated=False)}
    assert work.do_all(runs, ["a", "b"], Scale("full", "1"), tmp_path, work.Deadline(1.0), stop, print) == []
    assert done == ["a"]


def test_a_run_that_another_process_has_claimed_is_left_to_it(tmp_path, monkeypatch):
    done = []
    runs = {name: Run(None, measure=fake(name, done), evaluated=False) for name in "ab"}
    monkeypatch.setattr(work, "WAIT", 0.01)
    with work._claimed(tmp_path / "a.lock") as mine:
        assert mine
        work.do_all(runs, ["a", "b"], Scale("full", "1"), tmp_path, work.Deadline(0.002), NeverStop(), print)
    assert done == ["b"]


@pytest.mark.parametrize("versions", [{"git_revision": None}, {"git_revision": "abc", "git_modified": True}])
def test_results_of_a_modified_tree_are_not_kept(tmp_path, versions):
    source = tmp_path / "run"
    source.mkdir()
    (source / "versions.json").write_text(json.dumps({"started": versions}))
    with pytest.raises(UserError, match="clean commit"):
        stored.keep("run", source, tmp_path / "kept")
    clean = {"git_revision": "abc", "git_modified": False}
    (source / "versions.json").write_text(json.dumps({"started": clean, "resumed": [versions]}))
    with pytest.raises(UserError, match="clean commit"):
        stored.keep("run", source, tmp_path / "kept")
    (source / "versions.json").write_text(json.dumps({"started": clean}))
    stored.keep("run", source, tmp_path / "kept")
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["versions.json"]


def test_a_smoke_test_says_so_beside_every_item(tmp_path):
    representations.measure(tmp_path / representations.NAME)
    shown = {"x": Item("X", (representations.NAME,), representations.section), "y": Item("Y", ("z",), lambda runs: "")}
    text = page(shown, stored.load(tmp_path), smoke=True)
    assert text.count(SMOKE) == 3 and "Not measured yet: z." in text and "`phi_zone_prime` | 9 |" in text


@pytest.fixture(scope="module")
def water():
    return stored.load(reproduce.RESULTS)


def test_figures_of_a_stored_run(water):
    """By hand from its files: the share of solved seeds, the last part, the sum of rewards, the frames to 95 %."""
    run = water["water-rm"]
    report = run.played()
    rates = [seed["success_rate"]["value"] for seed in report["seeds"]]
    assert run.solved().value == np.mean(np.array(rates) > 0.95)
    columns = run.columns
    one = columns["seed"] == run.seeds[3]
    rewards = columns["episodes"][one] * np.nan_to_num(columns["success_rate"][one] - columns["violation_rate"][one])
    assert unit_time.reward_sum(run)[run.seeds[3]] == pytest.approx(rewards.sum())
    curve, since = columns["success_rate"][one], measures.frames_to(run)[run.seeds[3]]
    dips = np.flatnonzero(np.nan_to_num(curve) <= 0.95)
    last = len(curve) - 1 - dips[-1]  # iterations above 95 % up to the end
    assert np.isfinite(since) == (last >= window(run.config))


def test_runs_with_the_same_maps_are_compared_in_pairs_and_corrected_for_all_that_are_planned(water):
    values = {name: water[name].end("success_rate") for name in ("water-rm", "water-dfa")}
    pair = ("water-rm", "water-dfa")
    alone = claims.differences(water, [pair], values, "success", [pair])
    assert "paired" in alone and alone.count("\n|") == 2 and alone.endswith("Corrected for 1 comparison.")
    three = claims.differences(water, [pair, ("water-t1tl", "water-rm"), ("x", "y")], values, "success", [pair])
    assert three.count("\n|") == 2  # the others are not measured, and count all the same
    assert three.endswith("Corrected for 3 comparisons, 1 of which can be made so far.")

    def width(text):
        low, high = text.split("[")[1].split("]")[0].split(", ")
        return float(high) - float(low)

    assert width(three.splitlines()[2]) > width(alone.splitlines()[2])


def test_a_folder_with_other_seeds_is_no_run_of_these(runs, tmp_path):
    run, scale = runs["rm-crm"], Scale("smoke", "2")
    config = dataclasses.replace(scale.apply(run), seeds="3")
    run_folder.create(tmp_path / "rm-crm", config, {})
    with pytest.raises(UserError, match="other settings or seeds"):
        work.is_done(run, scale, tmp_path / "rm-crm")


def test_a_frozen_encoder_is_found_again_whatever_its_pretraining_is_called(runs, tmp_path):
    run, scale = runs["water-t1tl"], Scale("smoke", "2")
    run_folder.create(tmp_path / "run", dataclasses.replace(scale.apply(run), pretrained=str(tmp_path)), {})
    assert not work.is_done(run, scale, tmp_path / "run")  # not trained, but the same


def test_the_command_lists_items_and_refuses_what_it_does_not_know(capsys):
    assert reproduce.main(["--list", "True", "--only", "fig-zone,tables-steps"]) == 0
    assert "steps-5-2-size-2.5-gnn" in capsys.readouterr().out
    assert reproduce.main(["--only", "fig-zne"]) == 2
    assert "fig-zone" in capsys.readouterr().err
    assert reproduce.main(["--minutes", "0"]) == 2
    assert reproduce.main(["--seeds", "abc"]) == 2
    assert "a count such as 4" in capsys.readouterr().err
    assert reproduce.main(["--scale", "smoke", "--keep", "True"]) == 2
