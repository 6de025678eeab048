"""The tables of speed show every stored run, and what was printed is what the runs say of themselves."""

import json
import re
from pathlib import Path

import pytest

from experiments.benchmarks import measured
from experiments.reproduction import speed
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
    assert aim == f"{kind.aim} s: {sum(one <= kind.aim for one in seconds)} of {len(paths)}"


def test_the_readme_shows_seeds_that_nothing_was_tuned_on():
    seconds = [one.seconds for one in speed.runs_of(speed.KINDS[0], RESULTS) if one.run.seeds[0] < FIRST_TUNING_SEED]
    said = f"| 2 CPU cores | {min(seconds)} to {max(seconds)} s ({len(seconds)} runs) |"
    assert said in speed.short_table(RESULTS) and said in (ROOT / "README.md").read_text(encoding="utf-8")


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
    assert speed.largest(speed.benchmarks(tmp_path)) == [
        ("ZoneEnv, 64 environments, mjx / closed_form", "H100", "1,230,000 / 4,000,000 steps/s")
    ]


def test_trainings_are_shown_as_they_were_measured(tmp_path):
    assert "Not measured" in speed.everything(tmp_path)
    where = {"devices": ["NVIDIA H200"], "git_revision": "b" * 40, "packages": {"jax": "0.11.2"}}
    rows = [
        measured.Row(part, "zone_ppo_long:t2tl", "12 seeds", "frames/s", 1_512_345.0, 1.5e6, 1.52e6)
        for part in ("training", "environments")
    ]
    measured.write(tmp_path / "benchmark_x.json", where, {}, rows)
    shown = speed.everything(tmp_path)
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
    for line in speed.trainings(RESULTS):
        assert f"| {' | '.join(line)} |" in (ROOT / "README.md").read_text(encoding="utf-8")
