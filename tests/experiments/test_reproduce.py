"""The reproduction: what it plans, how its runs are shared and kept, and the page that is written from them."""

import dataclasses
import json
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from experiments import reproduce, tuning
from experiments.fairness import sizes
from experiments.reproduction import claims, items, locks, measures, representations, stored, work
from experiments.reproduction.page import SMOKE, named, page
from experiments.reproduction.plan import Item, Run, Scale
from experiments.reproduction.published_runs import MORE, VALUES
from experiments.reproduction.runs import AGENTS, MAPS, TIMED, again_name, all_runs
from experiments.reproduction.sections import unit_time
from t2tl_jax.errors import UserError
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.checkpoints import CheckpointError
from t2tl_jax.runs.interrupts import NeverStop
from t2tl_jax.runs.success import window
from t2tl_jax.training.seeds import FIRST_TUNING_SEED, parse_seeds

ROOT = Path(__file__).parents[2]


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
            assert key not in seen or name == again_name(seen[key]), (name, seen[key])
            seen.setdefault(key, name)


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


@pytest.mark.parametrize(
    ("error", "cause", "traced"),
    [
        (UserError("no luck"), None, False),
        (UserError("no luck"), CheckpointError("no luck"), False),
        (UserError("no luck"), ValueError("shapes differ"), True),  # as training makes of a mistake in the program
        (RuntimeError("no luck"), None, True),
    ],
)
def test_what_a_message_explains_is_told_without_a_traceback(tmp_path, error, cause, traced):
    def measure(folder):
        raise error from cause

    said, runs = [], {"a": Run(None, measure=measure, evaluated=False)}
    assert work.do_all(runs, ["a"], Scale("full", "1"), tmp_path, work.Deadline(1.0), NeverStop(), said.append) == ["a"]
    assert any("failed: " in line and "no luck" in line for line in said)
    assert any("Traceback" in line for line in said) is traced


def test_a_run_that_may_lack_memory_is_done_once_more_at_the_end_and_then_alone(tmp_path, monkeypatch):
    done, said, claims, tries = [], [], [], dict.fromkeys("abd", 0)
    claimed = locks.claimed

    def noted(base, name, devices, alone):
        claims.append((name, alone))
        return claimed(base, name, devices, alone)

    monkeypatch.setattr(work, "claimed", noted)

    def short(name, times):
        def measure(folder):
            tries[name] += 1
            if tries[name] <= times:
                raise jax.errors.JaxRuntimeError("NOT_FOUND: All configs failed during profiling")
            fake(name, done)(folder)

        return Run(None, measure=measure, evaluated=False)

    runs = {"a": short("a", 1), "b": short("b", 9), "c": Run(None, measure=fake("c", done), evaluated=False)}
    scale, deadline = Scale("full", "1"), work.Deadline(1.0)
    assert work.do_all(runs, list("abc"), scale, tmp_path, deadline, NeverStop(), said.append) == ["b"]
    assert done == ["c", "a"] and tries == {"a": 2, "b": 2, "d": 0}
    assert claims == [("a", False), ("b", False), ("c", False), ("a", True), ("b", True)]
    runs = {"d": short("d", 1), "c": runs["c"]}  # another process has come to it before
    (tmp_path / f"d{work.CROWDED}").touch()
    assert work.do_all(runs, ["d"], scale, tmp_path, deadline, NeverStop(), said.append) == ["d"]
    assert tries["d"] == 1 and claims[-1] == ("d", True)


def test_a_run_that_may_lack_memory_has_failed_where_there_is_no_time_to_do_it_alone(tmp_path):
    def measure(folder):
        deadline.at = 0.0
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED")

    deadline, runs = work.Deadline(1.0), {"a": Run(None, measure=measure, evaluated=False)}
    assert work.do_all(runs, ["a"], Scale("full", "1"), tmp_path, deadline, NeverStop(), print) == ["a"]


@pytest.mark.parametrize("minutes", [1.0, -1.0])
def test_nothing_is_evaluated_once_the_time_is_up(runs, tmp_path, monkeypatch, minutes):
    run, played = runs["steps-4-1-rm"], []
    trained = SimpleNamespace(ended="complete", folder=tmp_path, config=run.config, params=None, iteration=1)
    trained.experiment = SimpleNamespace(with_config=lambda config: None)
    monkeypatch.setattr(work.train, "train", lambda *_, **__: trained)
    monkeypatch.setattr(work, "is_done", lambda *_: bool(played))
    monkeypatch.setattr(
        work.evaluations, "evaluate_policies", lambda experiment, params, episodes, limit: played.append(limit) or {}
    )
    ended = work.do(run, Scale("full", "1"), tmp_path, None, work.Deadline(minutes), NeverStop())
    assert (ended, played) == (("complete", [600, 1000]) if minutes > 0 else (work.OUT_OF_TIME, []))


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
    with locks.claimed(tmp_path, "a", (), alone=False) as mine:
        assert mine
        work.do_all(runs, ["a", "b"], Scale("full", "1"), tmp_path, work.Deadline(0.002), NeverStop(), print)
    assert done == ["b"]


@pytest.mark.parametrize(("first", "second", "together"), [(0, 0, True), (0, 1, False), (1, 0, False), (1, 1, False)])
def test_a_run_that_is_to_be_alone_shares_its_device_with_none(tmp_path, first, second, together):
    with locks.claimed(tmp_path, "a", ["gpu-0", "gpu-1"], bool(first)) as mine:
        assert mine
        with locks.claimed(tmp_path, "b", ["gpu-1", "gpu-2"], bool(second)) as other:
            assert other == together
        with locks.claimed(tmp_path, "c", ["gpu-3"], alone=True) as other:
            assert other
    with locks.claimed(tmp_path, "b", ["gpu-1", "gpu-2"], alone=True) as other:
        assert other


ELSEWHERE = """
import sys, time
from pathlib import Path
from experiments.reproduction import locks
with locks.claimed(Path(sys.argv[1]), "of another process", locks.device_names(), alone=False) as mine:
    print(mine, flush=True)
    sys.stdin.readline()
"""


@pytest.mark.slow
def test_a_run_that_is_to_be_alone_waits_for_other_processes_and_is_done_after_them(tmp_path, monkeypatch):
    """The ordinary run goes ahead beside the other process, which ends once this one has begun to wait."""
    done, when_waiting = [], []
    runs = {
        "timed": Run(None, measure=fake("timed", done), evaluated=False, alone=True),
        "ordinary": Run(None, measure=fake("ordinary", done), evaluated=False),
    }
    other = subprocess.Popen(
        [sys.executable, "-c", ELSEWHERE, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT
    )
    assert other.stdin is not None and other.stdout is not None

    def waiting(seconds):
        when_waiting.append(list(done))
        other.communicate(b"\n", timeout=60)

    # Not the module's own function: subprocess sleeps too while it waits for the other process to end.
    monkeypatch.setattr(work, "time", SimpleNamespace(sleep=waiting, monotonic=time.monotonic))
    with other:
        assert other.stdout.readline() == b"True\n"
        assert not work.do_all(runs, list(runs), Scale("full", "1"), tmp_path, work.Deadline(1.0), NeverStop(), print)
    assert when_waiting == [["ordinary"]] and done == ["ordinary", "timed"]


def test_runs_come_by_the_work_that_follows_on_them_and_those_alone_last(runs):
    order = work.in_order(runs, list(runs))
    alone = [runs[name].alone for name in order]
    assert set(order) == set(runs) and alone == sorted(alone)
    place = {name: order.index(name) for name in runs}
    assert all(place[run.before] < place[name] for name, run in runs.items() if run.before is not None)
    early = [runs[name].early for name in order]
    assert any(early) and early == sorted(early, reverse=True)
    # What takes longest and needs nothing, then a pre-training that much waits for, then what takes less than that.
    assert place["rm-crm"] < place["zone-published-pretraining-transformer"] < place["zone-pretraining-transformer"]
    assert place["zone-pretraining-transformer"] < place["water-rm"] < place["safe-pretraining-gnn"]


def test_timed_runs_are_those_of_one_seed_and_start_from_such(runs):
    timed = {name for name, run in runs.items() if run.alone}
    assert timed == {name for name in runs if name.endswith("-alone")}
    for name in timed:
        assert len(parse_seeds(Scale("full", "12").apply(runs[name]).seeds)) == 1
        assert runs[name].before is None or runs[name].before in timed
        whole = runs[name.removesuffix("-alone")].config
        assert runs[name].config.frames * (1 if "pretraining" in name else TIMED) == whole.frames
    assert all(run.before not in timed for name, run in runs.items() if name not in timed)


@pytest.mark.slow
def test_recurrent_policies_that_are_compared_have_as_many_parameters(runs):
    carried, windows = (sizes(runs[f"any-memory-{name}"].config) for name in ("carried", "gru"))
    assert carried.others == windows.others


def test_the_status_of_a_timed_run_says_that_it_was_alone():
    progress = SimpleNamespace(notes={})
    work.Alone().on_plan(progress)
    assert progress.notes == {"alone": True}


def test_device_names():
    assert locks._device_name(1, [""], {"0": "GPU-a", "1": "GPU-b"}) == "GPU-b"
    assert locks._device_name(0, ["1"], {"0": "GPU-a", "1": "GPU-b"}) == "GPU-b"
    assert locks._device_name(0, ["GPU-b"], {"0": "GPU-a", "1": "GPU-b"}) == "GPU-b"
    assert locks._device_name(0, ["3"], {}).endswith("-3") and locks._device_name(2, [""], {}).endswith("-2")
    assert len(locks.device_names()) == 1  # the processor, however many devices it is made to look like


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
            more, moved = name.startswith("zone-published") and MORE in name, name in VALUES
            assert seeds <= set(range(run.first_seed, run.first_seed + (24 if more or moved else 12))), name
            later = {"any-flat": 40, "any-zones": 60, "any-water": 60} | dict.fromkeys(VALUES, 60)
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
