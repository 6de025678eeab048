"""The command that kills a run at random moments, with the fake learner's run."""

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.benchmarks import kills
from experiments.benchmarks.phases import CHECKPOINT, EVALUATION, PHASES, PRETRAINING, START, TRAINING, Watch, phase
from experiments.reproduction import survival
from tests.runs.test_killed_runs import SAME

RUN = "--import tests.fake_learner --config fake --frames 1000 --run.checkpoint-period 0 --run.evaluation-episodes 0"


FILE = "kills.json"


@pytest.mark.slow
def test_two_kills_leave_no_trace(tmp_path):
    """In some ten seconds of processor time. The command makes children, so it has a process of its own."""
    options = ["--kills", "2", "--json", str(tmp_path / FILE)]
    command = [sys.executable, "-m", "experiments.benchmarks.kills", *options, "--", *RUN.split()]
    root = Path(__file__).parents[2]
    answer = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=200)
    assert answer.returncode == 0, answer.stderr
    *told, last, _ = answer.stdout.splitlines()
    ends = [line for line in told if line.startswith("end")]
    assert ends and all(line.endswith("equal bit for bit") for line in ends)
    assert [line[:7] for line in told if line.startswith("kill")] == ["kill  1", "kill  2"]
    assert last == f"2 kills, {len(ends)} runs that came to their end, 0 of them differ"
    said = " ".join(survival.kills(tmp_path).split())
    assert "2 kills of `--import tests.fake_learner --config fake" in said and "all equal bit for bit" in said
    assert {kill["phase"] for kill in json.loads((tmp_path / FILE).read_text())["kills"]} <= set(PHASES)


def test_the_stored_kills_hit_every_phase():
    files = [json.loads(file.read_text()) for file in (Path(__file__).parents[2] / "results").glob(survival.FILES)]
    assert any(set(stored["phases"]) == set(PHASES) for stored in files)
    for stored in files:
        assert len(stored["kills"]) >= 20 and stored["differing"] == 0
        assert {kill["phase"] for kill in stored["kills"]} == set(stored["phases"]) <= set(PHASES)
        assert all(0 <= kill["after"] <= 2 * stored["seconds"] for kill in stored["kills"])


def written(path, at):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text('{"state": "training"}')
    os.utime(path, (at, at))


def test_what_a_run_is_doing_is_read_off_its_folder(tmp_path):
    """Of two processes, which begin at 0 and at 100."""
    first, old = tmp_path / "pretraining", 50
    assert phase(None, "", 0) == phase(tmp_path, "", 0) == START
    for name in ("metrics.csv", "status.json"):
        written(first / name, old)
    assert phase(tmp_path, "", 0) == PRETRAINING and phase(tmp_path, "", 100) == START
    (first / "status.json").write_text('{"state": "finished"}')
    assert phase(tmp_path, "", 0) == START
    written(tmp_path / "metrics.csv", old)
    assert phase(tmp_path, "", 0) == TRAINING and phase(tmp_path, "", 100) == START
    assert phase(tmp_path, "evaluating the final and the best parameters", 0) == EVALUATION
    for base in (tmp_path, first):
        unfinished = base / "checkpoints" / "3.orbax-checkpoint-tmp"
        unfinished.mkdir(parents=True)
        assert phase(tmp_path, "", 0) == phase(tmp_path, "", 100) == CHECKPOINT
        unfinished.rmdir()


def test_kills_aim_at_what_was_hit_least():
    lengths, moments = {"training": 3.0, CHECKPOINT: 0.5}, random.Random(0)
    hits = [kills.Kill("training", 1.0)]
    for _ in range(20):
        aim = kills._aim(moments, lengths, [])
        assert (aim.phase, aim.number) == ("training", 1) and 0 <= aim.wait <= 3
        aim = kills._aim(moments, lengths, hits)
        assert aim.phase == CHECKPOINT and 1 <= aim.number <= 3 and 0 <= aim.wait <= 0.5


def test_a_watch_counts_seconds_and_times(monkeypatch):
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    watch = Watch(begin=0.0)
    for now, doing in ((1, TRAINING), (2, CHECKPOINT), (4, TRAINING), (5, CHECKPOINT), (9, TRAINING)):  # noqa: B007
        watch.see(doing)
    now = 10.0
    assert watch.lengths() == {START: 1, TRAINING: 3, CHECKPOINT: 3} and watch.entered == 10


def test_a_run_that_differs_is_shown(tmp_path):
    assert survival.kills(tmp_path) == "Not measured yet."
    hits = [{"phase": "training", "after": after} for after in (2.0, 0.5)]
    stored = {"where": {}, "flags": ["--config", "x"], "seconds": 3.0, "phases": {"training": 1, "evaluating": 1}}
    (tmp_path / FILE).write_text(json.dumps(stored | {"kills": hits, "ends": 2, "differing": 1}))
    said = survival.kills(tmp_path)
    assert "2 runs came to their end, 1 of them **differ**" in " ".join(said.split())
    assert said.endswith("| training | 2 | 0.5, 2.0 |\n| evaluating | 0 | - |")


def test_a_run_that_differs_is_told(tmp_path):
    """In rows, in the checksums of its newest checkpoint, or in what it lacks."""
    for name in ("one", "other"):
        for file in SAME:
            (tmp_path / name / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name / file).write_text("{}")
    one, other = tmp_path / "one", tmp_path / "other"
    assert kills._differences(one, other) == []
    (other / "checkpoints/4/info/metadata").write_text('{"checksum": 1}')  # not the newest
    assert kills._differences(one, other) == []
    (other / "checkpoints/5/info/metadata").write_text('{"checksum": 1}')
    (other / "evaluation.json").write_text("{}")
    assert kills._differences(one, other) == ["evaluation.json", "checkpoints"]


def test_without_a_run_the_command_says_what_to_give(capsys):
    assert kills.main(["--kills", "2"]) == 2
    assert "say what to run behind --" in capsys.readouterr().err
