"""The reproduction: what it plans, which of its runs are done and kept, and the page that is written from them."""

import dataclasses
import time
from types import SimpleNamespace

import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from experiments import reproduce, tuning
from experiments.fairness import sizes
from experiments.reproduction import claims, items, measures, representations, stored, work
from experiments.reproduction import runs as planned_runs
from experiments.reproduction.page import SMOKE, named, page
from experiments.reproduction.plan import Item, Run, Scale
from experiments.reproduction.published_runs import KEPT, MORE, VALUES
from experiments.reproduction.runs import AGENTS, MADE_AGAIN, MAPS, again_name, all_runs
from experiments.reproduction.sections import unit_time
from t2tl_jax.errors import UserError
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.success import window
from t2tl_jax.training.seeds import FIRST_TUNING_SEED, parse_seeds


@pytest.fixture(scope="module")
def runs():
    return all_runs()


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
            assert config.frames <= (100_000_000 if name.startswith("any-") else 10_000_000)
            assert scale == "full" or config.frames <= 3 * config.learner.frames_per_iteration, name
            assert (run.before is not None) == bool(config.pretrained), name


def test_runs_that_are_compared_differ_in_what_they_say(runs):
    """One configuration under two names would be one run shown as two, unless seeds differ or it is made once more."""
    seen: dict = {}
    for name, run in runs.items():
        if run.config is not None:
            key = (repr(run.config), run.before, run.seeds, run.first_seed)
            first = seen.get(key)
            assert first is None or name == again_name(first) or MADE_AGAIN.get(name) == first, (name, first)
            seen.setdefault(key, name)


def test_what_is_made_once_more_is_the_same_run(runs):
    for name, first in MADE_AGAIN.items():
        assert runs[name] == runs[first], (name, first)


def test_needed_runs_come_before_what_starts_from_them():
    runs = {"a": Run(None), "b": Run(None, before="a"), "c": Run(None, before="b")}
    assert work.needed(runs, ["c", "b"]) == ["a", "b", "c"]


def test_timed_runs_are_those_of_one_seed_and_start_from_such(runs):
    timed = {name for name, run in runs.items() if run.alone}
    assert timed == {name for name in runs if name.endswith("-alone")}
    for name in timed:
        assert len(parse_seeds(Scale("full", "12").apply(runs[name]).seeds)) == 1
        assert runs[name].before is None or runs[name].before in timed
        whole = runs[name.removesuffix("-alone")].config
        assert runs[name].config.frames == whole.frames
    assert all(run.before not in timed for name, run in runs.items() if name not in timed)


@pytest.mark.slow
def test_recurrent_policies_that_are_compared_have_as_many_parameters(runs):
    carried, windows = (sizes(runs[f"any-memory-{name}"].config) for name in ("carried", "gru"))
    assert carried.others == windows.others


def test_the_status_of_a_timed_run_says_that_it_was_alone():
    progress = SimpleNamespace(notes={})
    work.Alone().on_plan(progress)
    assert progress.notes == {"alone": True}


def test_no_run_is_on_seeds_that_settings_were_chosen_on(runs):
    """Those in ZoneEnv and of agents for any task on none that any search had; those in WaterWorld, whose seeds are its
    maps, on none of its own. The benchmark has maps 1 to 10 and no others, and `experiments.tuning` names those that a
    search had. Runs of a search are on seeds for tuning alone."""
    searched = {seed for search in tuning.TUNED.values() for seed in search.seeds}
    for name, run in runs.items():
        if run.config is not None and run.seeds != MAPS and not run.search:
            seeds, in_zones = set(parse_seeds(Scale("full", "12").apply(run).seeds)), run.first_seed > 0
            assert in_zones == name.startswith(("zone-", "safe-", "prime-", "any-")), name
            assert not seeds & (searched if in_zones else set(tuning.TUNED["waterworld_dqn"].seeds)), name
            more, moved = name.startswith("zone-published") and MORE in name, name in (*VALUES, KEPT)
            assert seeds <= set(range(run.first_seed, run.first_seed + (24 if more or moved else 12))), name
            later = {"any-flat": 40, "any-zones": 60, "any-water": 60} | dict.fromkeys((*VALUES, KEPT), 60)
            last = "-solved-" in name or name.endswith("-strict")
            first = 76 if "-broad-" in name else 88 if last else 36 if more else later.get(name, 24 if in_zones else 0)
            assert run.first_seed == first, name
    for name, run in runs.items():
        tuned = run.config is not None and max(parse_seeds(Scale("full", "12").apply(run).seeds)) >= FIRST_TUNING_SEED
        assert run.search == tuned == name.startswith("search-"), name
    for name in ("zone-t2tl", "safe-dfa", "water-t1tl", "water-pretraining-gnn"):
        config = Scale("full", "12").apply(runs[name])
        assert not tuning.tuning_seeds(config, parse_seeds(config.seeds)), name


def test_a_run_starts_from_one_of_the_same_seeds(runs):
    for seeds in ("3", "5,", "100,7"):
        scale = Scale("full", seeds)
        for name, run in runs.items():
            if run.before is not None:
                assert scale.apply(run).seeds == scale.apply(runs[run.before]).seeds, name
    assert Scale("full", "3").apply(runs["zone-dfa"]).seeds == "24,25,26,"
    assert Scale("full", "3").apply(runs["water-rm"]).seeds == "3"
    assert Scale("full", "100,7").apply(runs["zone-dfa"]).seeds == "100,7"


def test_agents_that_are_kept_are_those_of_the_methods_tables(runs):
    assert set(AGENTS) <= set(runs) and all(runs[name].evaluated and not runs[name].alone for name in AGENTS)
    assert set(AGENTS) >= {"zone-t2tl", "zone-dfa_number", "water-dfa_cont-again"}


@pytest.mark.slow
def test_a_smoke_test_says_so_beside_every_item(tmp_path):
    representations.measure(tmp_path / representations.NAME)
    shown = {"x": Item("X", (representations.NAME,), representations.section), "y": Item("Y", ("z",), lambda runs: "")}
    text = page(shown, stored.load(tmp_path), smoke=True)
    assert text.count(SMOKE) == 3 and "Not measured yet: z." in text and "`phi_zone_prime` | 9 |" in text


def test_sections_are_summed_up_before_them(tmp_path):
    shown = {name: Item(name.upper(), (), lambda runs, name=name: f"of {name}") for name in "xy"}
    text = page(shown, {}, smoke=False, summary=lambda sections: f"all: {', '.join(sections.values())}")
    assert text.index("all: of x, of y") < text.index("## X") and "all: " not in page(shown, {}, smoke=False)


@pytest.fixture(scope="module")
def water():
    return stored.load(reproduce.RESULTS)


@pytest.mark.parametrize(("count", "said"), [(1, "r0"), (20, "r18, r19"), (21, "r17, r18 and 2 others")])
def test_runs_that_are_missing_are_named_but_not_all_of_many(count, said):
    assert named([f"r{k}" for k in range(count)]).endswith(said)


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


def test_a_run_without_random_maps_is_found_again_whatever_its_period_of_maps(runs, tmp_path):
    run, scale = runs["rm-crm"], Scale("smoke", "2")
    run_folder.create(tmp_path / "run", dataclasses.replace(scale.apply(run), map_period=0), {})
    assert not work.is_done(run, scale, tmp_path / "run")  # not trained, but the same


def test_a_frozen_encoder_is_found_again_whatever_its_pretraining_is_called(runs, tmp_path):
    run, scale = runs["water-t1tl"], Scale("smoke", "2")
    run_folder.create(tmp_path / "run", dataclasses.replace(scale.apply(run), pretrained=str(tmp_path)), {})
    assert not work.is_done(run, scale, tmp_path / "run")  # not trained, but the same


def test_what_is_kept_is_finished_and_nothing_is_trained(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(work, "do_all", lambda *_: pytest.fail("it trains"))
    asked = ["--only", "representations", "--keep", "True", "--folder", str(tmp_path)]
    assert reproduce.main(asked) == 2 and "there is no folder" in capsys.readouterr().err
    assert not (tmp_path / "full").exists()
    (tmp_path / "full").mkdir()
    assert reproduce.main(asked) == 0
    assert "nothing is trained" in (said := capsys.readouterr().out)
    assert "0 of 1 runs are done; without --keep the command trains the others" in said
    assert reproduce.main([*asked, "--workers", "2"]) == 2 and "leave out --workers" in capsys.readouterr().err


def test_a_lost_device_has_an_exit_code_of_its_own(tmp_path, monkeypatch, capsys):
    def lost(*_):
        raise work.LostDeviceError(["a"])

    monkeypatch.setattr(work, "do_all", lost)
    monkeypatch.setattr(work, "is_done", lambda *_: pytest.fail("it builds an environment on the lost device"))
    assert reproduce.main(["--only", "representations", "--folder", str(tmp_path)]) == work.LOST
    said = capsys.readouterr()
    assert "the device answers no more, so that this process ends; give the same command" in said.err
    assert said.out == "failed: a\n"


def test_minutes_count_from_when_the_command_began(tmp_path, monkeypatch):
    """So that it ends in time where what comes before the training takes long, such as a start with a GPU."""
    ends = []
    monkeypatch.setattr(planned_runs, "all_runs", lambda: time.sleep(2) or all_runs())
    (tmp_path / "full").mkdir()
    monkeypatch.setattr(work, "do_all", lambda *given: ends.append(given[4].at) or [])
    began = time.monotonic()
    assert reproduce.main(["--only", "representations", "--folder", str(tmp_path), "--minutes", "1"]) == 0
    assert 60 <= ends[0] - began < 61.5


@pytest.mark.slow
def test_the_command_lists_items_and_refuses_what_it_does_not_know(capsys):
    assert reproduce.main(["--list", "--only", "fig-zone,tables-steps"]) == 0
    assert "steps-5-2-size-2.5-gnn" in capsys.readouterr().out
    assert reproduce.main(["--only", "fig-zne"]) == 2
    assert "fig-zone" in capsys.readouterr().err
    assert reproduce.main(["--minutes", "0"]) == reproduce.main(["--minutes", "nan"]) == 2
    assert reproduce.main(["--seeds", "abc"]) == 2
    assert "a count such as 4" in capsys.readouterr().err
    assert reproduce.main(["--scale", "smoke", "--keep", "True"]) == 2
