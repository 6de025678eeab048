"""The tables of speed show every stored run, and what was printed is what the runs say of themselves."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import experiments.configs  # noqa: F401, registers configurations
from experiments.benchmarks import measured
from experiments.reproduction import aims, scaling, speed, stored, whole_paper
from experiments.reproduction.items import ITEMS
from experiments.reproduction.page import origin
from t2tl_jax.registry import named_config
from t2tl_jax.training.seeds import FIRST_TUNING_SEED

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
CPU = sorted(path for path in (RESULTS / "zone_cpu").iterdir())
TABLE = speed.until_solved(RESULTS)


def row(title):
    (line,) = (line for line in TABLE.splitlines() if line.startswith(f"| {title} |"))
    return line.strip("| ").split(" | ")


@pytest.mark.parametrize("path", CPU, ids=lambda path: path.name)
def test_frames_that_were_printed_are_those_of_the_status(path):
    """Which earlier versions call by another name."""
    status = json.loads((path / "status.json").read_text(encoding="utf-8"))
    one = speed.timed(path)
    assert (status.get("success_since_frames") or status["solved_after_frames"]) == [one.frames]
    assert one.whole is None or one.seconds < one.whole


@pytest.mark.parametrize("kind", speed.KINDS, ids=lambda kind: kind.title)
def test_every_stored_run_is_shown_the_slow_ones_too(kind):
    folder = Path(kind.folder)
    paths = [
        path
        for path in (RESULTS / folder.parent).iterdir()
        if re.fullmatch(folder.name.replace("SEED", r"\d+"), path.name)
    ]
    seconds = [int(re.findall(r"and (\d+) s since", (path / "output.txt").read_text())[-1]) for path in paths]
    _, _, shown, _, aim, *_ = row(kind.title)
    assert sorted(map(int, re.findall(r": (\d+)", shown))) == sorted(seconds) and paths
    counted = [one.seconds for one in speed.runs_of(kind, RESULTS) if one.run.seeds[0] < FIRST_TUNING_SEED]
    assert aim == f"{kind.aim} s: {sum(one <= kind.aim for one in counted)} of {len(counted)}" and counted


def test_the_readme_shows_seeds_that_nothing_was_tuned_on():
    seconds = [one.seconds for one in speed.runs_of(speed.KINDS[0], RESULTS) if one.run.seeds[0] < FIRST_TUNING_SEED]
    said = f"| 2 CPU cores | {min(seconds)} to {max(seconds)} s ({len(seconds)} runs) |"
    assert said in speed.short_table(RESULTS) and said in (ROOT / "README.md").read_text(encoding="utf-8")


def test_pauses_of_checkpoints_are_those_of_the_stored_runs():
    """By hand from the files of the runs."""
    shares, older = {}, 0
    for file in RESULTS.rglob("status.json"):
        times = json.loads(file.read_text(encoding="utf-8")).get("all_sessions", {})
        older += bool(times.get("training_seconds")) and "checkpoint_seconds" not in times
        if "checkpoint_seconds" in times and times.get("training_seconds"):
            shares[file.parent.relative_to(RESULTS).as_posix()] = (
                times["checkpoint_seconds"] / times["training_seconds"]
            )
    over = {name: share for name, share in shares.items() if share > 0.05}
    said = speed.pauses(RESULTS)
    assert len(re.findall(r"`[^`]+` (\d\.\d) %", said)) == len(over) and len(shares) > 200
    assert f"{len(shares) - len(over)} stood still for checkpoints" in " ".join(said.split())
    assert f"Of {len(shares)} stored runs with such a time ({older} older ones have none)" in " ".join(said.split())
    assert all(f"`{name}` {100 * share:.1f} %" in " ".join(said.split()) for name, share in over.items())


def test_environments_are_shown_as_they_were_measured(tmp_path):
    assert "Not measured" in speed.environments(tmp_path)
    where = {"devices": ["NVIDIA H100"], "git_revision": "a" * 40, "packages": {"jax": "0.11.2"}}
    config = {"env": "zones", "layout": "fixed", "task": "phi_zone", "repeats": 5, "steps": 100}
    results = [
        {"physics": name, "num_envs": 64, "steps_per_s": each, "slowest": 9.0, "fastest": 5e6, "compile_s": 1.25}
        for name, each in (("mjx", 1234567.0), ("closed_form", 4e6))
    ]
    (tmp_path / "env_x.json").write_text(json.dumps({"where": where, "config": config, "results": results}))
    shown = speed.environments(tmp_path)
    assert "| mjx | 64 | 1,234,567 (9, 5,000,000) | 1.2 s |" in shown and "Commits: aaaaaaa. " in shown
    slower = [of | {"steps_per_s": of["steps_per_s"] / 4} for of in results]
    random = {"where": where, "config": config | {"layout": "random"}, "results": slower}
    (tmp_path / "env_y.json").write_text(json.dumps(random))
    both = " ".join(speed.environments(tmp_path).split())
    assert "zones, mjx, 64 at once 4.00; zones, closed_form, 64 at once 4.00." in both
    of_one = {**where, "time": "2026-01-01"}
    rows = [
        measured.Row(
            "environments", what, f"{count} at once", "steps/s", 1000.0 * rate * count, 1000.0, 2e6, compile_s=1.25
        )
        for count in (8, 64)
        for rate, what in enumerate(speed.WORLDS, 1)
    ]
    measured.write(tmp_path / "benchmark_x.json", of_one, {}, rows)
    assert "| zones, mjx | 64 at once | 64,000 (1,000, 2,000,000) | 1.2 s |" in speed.environments(tmp_path)
    shared = {**of_one, "devices": ["NVIDIA H100"] * 2, "time": "2026-01-02"}  # the README's are of one GPU
    measured.write(tmp_path / "benchmark_two.json", shared, {}, [replace(row, rate=1e9, devices=2) for row in rows])
    measured.write(tmp_path / "benchmark_y.json", {**of_one, "time": "2026-01-03"}, {}, rows[-4:])  # a world is missing
    measured.write(tmp_path / "benchmark_z.json", {**of_one, "time": "2026-01-04"}, {}, rows[:5])  # a smaller batch
    [(title, hardware, figure)] = speed.largest(tmp_path)
    assert title.startswith("Random play on one map, 64 environments: ZoneEnv by MJX / in closed form / WaterWorld / ")
    assert (hardware, figure) == ("H100", "64,000 / 128,000 / 192,000 / 256,000 / 320,000 steps/s")


def test_trainings_are_shown_as_they_were_measured(tmp_path):
    assert "Not measured" in speed.everything(tmp_path)
    where = {"devices": ["NVIDIA H200"], "git_revision": "b" * 40, "packages": {"jax": "0.11.2"}}
    rows = [
        measured.Row(part, "zone_ppo_long:t2tl", "12 seeds", "frames/s", 1_512_345.0, 1.5e6, 1.52e6)
        for part in ("training", "environments")
    ]
    rows.append(measured.Row("progression", "phi_zone", "8 at once, 5 rows", "steps/s", 1e9, 1e9, 1e9))
    rows.append(measured.Row("solve", "zone_ppo:t1tl", "1 seed", "frames/s", 1.0, 1.0, 1.0, seconds=31.0, frames=9000))
    measured.write(tmp_path / "benchmark_x.json", where, {}, rows)
    shown = speed.everything(tmp_path)
    assert "| phi_zone | 8 at once, 5 rows | 1,000,000,000 steps/s" in shown
    assert "| zone_ppo:t1tl | 1 seed | 31 s | 9,000 |" in shown
    assert shown.count("| zone_ppo_long:t2tl | 12 seeds | 1,510,000 frames/s (1,500,000, 1,520,000) |") == 1
    assert "`results/benchmark_x.json`" in shown and "Commits: bbbbbbb. Hardware: NVIDIA H200." in shown


def test_the_readme_shows_trainings_that_are_stored_whole(tmp_path):
    assert speed.trainings(tmp_path) == []
    where = {"devices": ["NVIDIA H200"], "git_revision": "b" * 40, "packages": {"jax": "0.11.2"}}
    rows = [
        measured.Row("training", f"waterworld_dqn:{method}", size, "frames/s", rate, rate, rate)
        for method, rate in (("t1tl", 1_301_000.0), ("t2tl", 263_400.0))
        for size in ("1 seed", "12 seeds")
    ]
    measured.write(tmp_path / "benchmark_x.json", where, {}, rows[:3])
    assert speed.trainings(tmp_path) == []  # T2TL's 12 seeds are missing
    measured.write(tmp_path / "benchmark_y.json", where, {}, rows[3:])
    ((title, hardware, figure),) = speed.trainings(tmp_path)
    assert "waterworld_dqn" in title and (hardware, figure) == ("H200", "1,300,000 / 263,000 frames/s")

    measured.write(tmp_path / "benchmark_z.json", {**where, "devices": ["NVIDIA H100"], "time": "3"}, {}, rows)
    assert speed.trainings(tmp_path)[0][1] == "H100"
    measured.write(tmp_path / "benchmark_y.json", {**where, "time": "4"}, {}, rows[3:])
    assert speed.trainings(tmp_path)[0][1] == "H100"  # one figure of the H200 is older than all of them
    measured.write(tmp_path / "benchmark_x.json", {**where, "time": "5"}, {}, rows[:3])
    assert speed.trainings(tmp_path)[0][1] == "H200"
    faster = [replace(row, rate=2 * row.rate) for row in rows]
    ((_, _, figure),) = speed.trainings(tmp_path, [(where, faster)])  # what is not stored yet is the newest
    assert figure == "2,600,000 / 527,000 frames/s"
    assert speed.trainings(tmp_path, [({**where, "git_modified": True}, faster)]) == speed.trainings(tmp_path)
    for line in speed.trainings(RESULTS):
        assert f"| {' | '.join(line)} |" in (ROOT / "README.md").read_text(encoding="utf-8")


# ----- several GPUs -----

ONE, TWO = ["NVIDIA H200"], ["NVIDIA H200"] * 2


def store(folder, name, devices, rows, **other):
    """Rows as (what, size, rate, devices), timed within 1 % of the rate."""
    where = {"devices": devices, "git_revision": "c" * 40, "packages": {"jax": "0.11.2"}, "time": "2026-01-01"}
    made = [
        measured.Row(
            *("environments", what, size, "steps/s") if "at once" in size else ("training", what, size, "frames/s"),
            *(rate, 0.99 * rate, 1.01 * rate),
            devices=used,
        )
        for what, size, rate, used in rows
    ]
    measured.write(folder / f"benchmark_{name}.json", {**where, **other}, {}, made)


def test_several_devices_are_compared_with_one(tmp_path):
    assert scaling.scaling(tmp_path).startswith("Not measured yet")
    store(
        *(tmp_path, "two", TWO),
        [
            ("a", "24 seeds", 1.89e6, 2),
            ("b", "24 seeds", 1.9e6, 2),
            ("b", "1 seed", 1.7e6, 2),
            ("c", "1 seed", 1.69e6, 2),
            ("zones, mjx", "8 at once", 1.5e6, 2),
            ("idle", "1 seed", 1e6, 1),
            ("alone", "1 seed", 1e6, 2),
        ],
    )
    assert scaling.scaling(tmp_path).startswith("Not measured yet")
    sizes = (("a", "24 seeds"), ("b", "24 seeds"), ("b", "1 seed"), ("c", "1 seed"), ("zones, mjx", "8 at once"))
    store(tmp_path, "one", ONE, [(*names, 1e6, 1) for names in (*sizes, ("idle", "1 seed"))])
    heading, _, *lines, _, said = scaling.scaling(tmp_path).splitlines()
    assert "| one device | 2 devices |" in heading and "Hardware: 2 x NVIDIA H200." in said
    assert lines[0] == "| a | 24 seeds | 1,000,000 frames/s | 1,890,000 frames/s | 1.89 (1.85, 1.93) | 1.9 | not met |"
    ends = [" | ".join(line.strip("| ").split(" | ")[-2:]) for line in lines]
    assert ends[1:4] == ["1.9 | met", "1.7 | met", "1.7 | not met"]
    assert len(lines) == 5 and "| 1,500,000 steps/s | 1.50 (1.47, 1.53) | - |" in lines[4]


def test_work_that_grows_with_the_devices_is_compared_too(tmp_path):
    store(tmp_path, "two", TWO, [("a", "48 seeds", 4e6, 2), ("a", "25 seeds", 3e6, 2), ("b", "2 seeds", 1e6, 2)])
    assert scaling.scaling(tmp_path) == scaling.NOTHING
    store(tmp_path, "one", ONE, [("a", "24 seeds", 2e6, 1), ("a", "12 seeds", 1e6, 1), ("b", "1 seed", 1e6, 1)])
    shown = scaling.scaling(tmp_path)
    assert "| a | 24 seeds: 2,000,000 frames/s | 48 seeds: 4,000,000 frames/s on 2 | 2.00 (1.96, 2.04) |" in shown
    assert "| b | 1 seed: 1,000,000 frames/s | 2 seeds: 1,000,000 frames/s on 2 | 1.00 (0.98, 1.02) |" in shown
    assert "25 seeds" not in shown and "aim" not in shown and "So these seeds" not in shown
    store(tmp_path, "two_more", TWO, [("a", "24 seeds", 1.9e6, 2)])
    shown = scaling.scaling(tmp_path)
    assert "| a | 24 seeds | 2,000,000 frames/s | 1,900,000 frames/s | 0.95 (0.93, 0.97) | 1.9 | not met |" in shown
    assert "So these seeds" not in shown  # b's two seeds take as long as one after the other
    for name, kept in (
        ("two", [("a", "48 seeds", 4e6, 2)]),
        ("one", [("a", "24 seeds", 2e6, 1), ("a", "12 seeds", 1e6, 1)]),
    ):
        store(tmp_path, name, TWO if name == "two" else ONE, kept)
    shown = scaling.scaling(tmp_path).replace("\n", " ")
    assert "a makes 2.00 times the frames/s with 24 seeds as with 12" in shown
    later = {"git_revision": "e" * 40}
    store(tmp_path, "two_later", TWO, [("a", "48 seeds", 9e6, 2)], **later)
    store(tmp_path, "one_later", ONE, [("a", "24 seeds", 4.6e6, 1)], **later)
    shown = scaling.scaling(tmp_path)
    assert "4,600,000 frames/s | 48 seeds: 9,000,000 frames/s on 2 | 1.96" in shown and "4.60 times" not in shown


def test_what_devices_could_make_is_judged_by_their_own_commit_or_the_one_before(tmp_path):
    """24 seeds on two: what 12 make on one, of the same commit where there is such a figure, and never of a later."""

    def said():
        return scaling.scaling(tmp_path).replace("\n", " ")

    store(tmp_path, "two", TWO, [("a", "24 seeds", 1.5e6, 2)], time="2026-01-05")
    store(tmp_path, "one", ONE, [("a", "24 seeds", 1e6, 1)], time="2026-01-05")
    store(tmp_path, "later", ONE, [("a", "12 seeds", 9e5, 1)], git_revision="e" * 40, time="2026-01-09")
    assert "If devices did not wait" not in said()
    store(tmp_path, "before", ONE, [("a", "12 seeds", 7e5, 1)], git_revision="b" * 40, time="2026-01-02")
    assert f"a with 24 seeds ({'c' * 7}) 1.40 times, measured 1.50 times. So what is missing is lost" in said()
    store(tmp_path, "same", ONE, [("a", "12 seeds", 8e5, 1)], time="2026-01-06")
    assert f"a with 24 seeds ({'c' * 7}) 1.60 times, measured 1.50 times." in said()
    assert "hardly between them" not in said()  # they wait for one another


@pytest.mark.parametrize(
    ("devices", "other"),
    [
        (ONE, {"git_revision": "d" * 40}),
        (ONE, {"packages": {"jax": "0.12.0"}}),
        (["NVIDIA H100"], {}),
        (TWO, {}),
    ],
)
def test_what_differs_otherwise_is_not_compared(tmp_path, devices, other):
    store(tmp_path, "two", TWO, [("a", "24 seeds", 2e6, 2)])
    store(tmp_path, "one", devices, [("a", "24 seeds", 1e6, len(devices))], **other)
    assert scaling.scaling(tmp_path) == scaling.NOTHING


def test_four_devices_have_no_aim(tmp_path):
    store(tmp_path, "four", ["NVIDIA H200"] * 4, [("a", "24 seeds", 3.5e6, 4)])
    store(tmp_path, "one", ONE, [("a", "24 seeds", 1e6, None)])  # an older file
    assert "| one device | 4 devices |" in (shown := scaling.scaling(tmp_path)) and "| 3.50 (3.43, 3.57) | - |" in shown


@pytest.mark.parametrize("names", [("x", "y"), ("y", "x")])
def test_the_readme_shows_the_newest_of_one_device(tmp_path, names):
    old, new = names
    trainings = ("waterworld_dqn:t1tl", "waterworld_dqn:t2tl")
    for name, rate, day in ((old, 1e6, 1), (new, 2e6, 2)):
        store(tmp_path, name, ONE, [(what, "12 seeds", rate, 1) for what in trainings], time=f"2026-01-0{day}")
    store(tmp_path, "z", TWO, [(what, "12 seeds", 3e6, 2) for what in trainings], time="2026-01-03")
    ((_, hardware, figure),) = speed.trainings(tmp_path)
    assert (hardware, figure) == ("H200", "2,000,000 / 2,000,000 frames/s")


def test_the_number_of_devices_is_said():
    for devices, said in ((ONE, "NVIDIA H200"), (TWO, "2 x NVIDIA H200"), (["B", "A", "A"], "2 x A, B")):
        assert f"Hardware: {said}. JAX" in origin([{"devices": devices}])


def test_aims_are_judged_by_what_is_stored(tmp_path):
    assert "Not measured yet" in aims.aims(tmp_path)
    where = {"devices": ["NVIDIA H200"], "git_revision": "b" * 40, "packages": {"jax": "0.11.2"}}
    row = measured.Row(
        "training", aims.T1TL, "12 seeds", "frames/s", 2_499_999.0, 1.0, 1.0, trace_s=4.5, compile_s=15.4
    )
    measured.write(tmp_path / "benchmark_x.json", where, {}, [row])
    speed_line, compile_line = aims.aims(tmp_path).splitlines()[2:4]
    assert speed_line.endswith("| H200 | 2,500,000 frames/s | 2,500,000 (1, 1) frames/s | **not reached** |")
    assert compile_line.endswith("| compiled within 20 s | 15.4 s | reached |")
    on_cores = replace(row, what=aims.SHORT_T1TL, size="1 seed", rate=31_000.0)
    measured.write(tmp_path / "benchmark_cpu.json", where | {"devices": ["cpu"] * 2}, {}, [on_cores])
    last = [line for line in aims.aims(tmp_path).splitlines() if line.startswith("|")][-1]
    assert last.startswith("| `zone_ppo:t1tl` | 1 seed | 2 CPU cores | 30,000 frames/s")
    assert last.endswith("| reached by the median, not by every call |")
    (tmp_path / "benchmark_cpu.json").unlink()
    dqn = [
        replace(row, what=f"waterworld_dqn:{method}", rate=rate) for method, rate in (("t1tl", 1.28e6), ("t2tl", 2e5))
    ]
    measured.write(tmp_path / "benchmark_y.json", where | {"time": "2026-01-03"}, {}, dqn)
    said = " ".join(aims.aims(tmp_path).split())
    assert "1,280,000 frames/s of T1TL are 10,000 gradient steps/s and 200,000 frames/s of T2TL are 1,560 " in said
    assert "| `waterworld_dqn:t2tl` | 12 seeds | H200 | 300,000 frames/s | 200,000 (1, 1) frames/s | **not re" in said
    (tmp_path / "benchmark_y.json").unlink()
    for changed in ({"devices": ["NVIDIA H200"] * 2}, {"git_modified": True}):
        measured.write(tmp_path / "benchmark_x.json", where | changed, {}, [row])
        assert "Not measured yet" in aims.aims(tmp_path)


def test_the_steps_of_dqn_are_those_of_its_configuration():
    learner = named_config("waterworld_dqn").learner
    frames = learner.num_envs // learner.updates_per_step
    assert aims.Steps(frames, learner.batch_size) == aims.NOW


def test_the_time_of_all_runs_is_that_of_gpus_which_they_shared():
    def run(begins, training, processors=32):
        status = {"all_sessions": {"training_seconds": training, "compile_seconds": 60}}
        time = f"2026-01-01T10:{begins:02}:00+00:00"
        versions = {"time": time, "git_revision": "a", "cpu_count": processors}
        own = {"train_seconds": training, "compile_seconds": 60, "config": SimpleNamespace(env=None)}
        return SimpleNamespace(status=status, versions=versions, **own)

    # Three at once on two GPUs for two minutes, then one more minute of one; and two at once on a host with one.
    runs = {"a": run(0, 60), "b": run(0, 60), "c": run(0, 120), "d": run(30, 240, 16), "e": run(30, 60, 16)}
    assert whole_paper.gpu_minutes(list(runs.values())) == 2 * 2 + 1 + 5
    text = " ".join(whole_paper.whole(runs | {"codes": SimpleNamespace(status={})}).split())
    assert (
        "5 trained runs (`--only paper`; those of agents for any task come on top): 9 minutes of training and 5" in text
    )
    assert "5 of compiling" in text and "busy for 10 minutes" in text and " of the plan are not trained." in text
    assert text.endswith("in minutes: d 4, c 2, a 1, b 1, e 1.") and whole_paper.whole({}) == ""


def test_where_the_minutes_are_is_counted_without_repetitions_and_without_updates_at_every_step():
    names = {
        "rm-ql": 60, "water-rm-every-step": 30, "water-rm": 100, "water-pretraining-gnn": 8, "zone-published": 1,
        "water-rm-again": 500, "water-dfa_cont-own-rate": 501, "search-water-rm-low": 502, "zone-published-t1tl": 503,
        "zone-published-more-pretraining-transformer": 504, "zone-published-t2tl-more": 505,
    }  # fmt: skip

    def run(hour, minutes):
        time = f"2026-01-{1 + hour:02}T00:00:00+00:00"
        versions = {"time": time, "git_revision": "a", "cpu_count": 16}
        return SimpleNamespace(versions=versions, train_seconds=60 * minutes, compile_seconds=0, status={})

    runs = {name: run(day, minutes) for day, (name, minutes) in enumerate(names.items())}
    said = whole_paper.where_the_minutes_are(runs)
    assert "the 1 of that benchmark 60 minutes, with the others" in said and "(2 in all) 90; the 5 without" in said
    assert "pieces of the published program 199; of these the 3 that do not" in said
    assert said.endswith(" 109, which is 19 above the aim. So it is mainly the updates at every step that keep it from "
                         "the aim.")  # fmt: skip
    runs["water-rm"] = run(2, 50)
    assert "which is within the aim. So it is" in whole_paper.where_the_minutes_are(runs)
    runs["rm-ql"], runs["water-rm-every-step"] = run(0, 10), run(1, 10)
    assert whole_paper.where_the_minutes_are(runs).endswith("which is within the aim.")
    assert whole_paper.where_the_minutes_are({"water-rm": runs["water-rm"]}) == ""


def test_the_minutes_of_the_stored_runs_are_told_apart():
    """An update at every step is what takes long: without it the paper is near its aim."""
    said = " ".join(whole_paper.whole(stored.load(RESULTS / "paper")).split())
    assert "the 13 of that benchmark" in said and "make an update after every step (15 in all)" in said


def test_the_stored_smoke_test_is_of_all_items():
    """Measured again where items were added: ``experiments.reproduce --scale smoke``, whose time.json is stored."""
    assert json.loads((RESULTS / whole_paper.SMOKE).read_text(encoding="utf-8"))["items"] == len(ITEMS)


def test_the_time_of_the_smoke_test_is_that_of_a_stored_one(tmp_path):
    assert whole_paper.smoke(tmp_path) == "Not measured yet."
    where = {"command": ["python", "-m", "experiments.reproduce"], "devices": ["cpu"] * 2, "git_revision": "b" * 40}
    stored = {"where": where, "seconds": 600.0, "items": 27, "runs": 35}
    (tmp_path / whole_paper.SMOKE).write_text(json.dumps(stored))
    said = " ".join(whole_paper.smoke(tmp_path).split())
    assert "all 27 items (`python -m experiments.reproduce`), which trains 35 runs" in said
    assert "10.0 minutes" in said and "bbbbbbb" in said
