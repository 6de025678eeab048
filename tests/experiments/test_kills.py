"""The command that kills a run at random moments, with the fake learner's run."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.benchmarks import kills
from experiments.reproduction import survival
from tests.runs.test_killed_runs import SAME

RUN = "--import tests.fake_learner --config fake --frames 1000 --run.checkpoint-period 0 --run.evaluation-episodes 0"


@pytest.mark.slow
def test_two_kills_leave_no_trace(tmp_path):
    """In some ten seconds of processor time. The command makes children, so it has a process of its own."""
    options = ["--kills", "2", "--json", str(tmp_path / survival.FILE)]
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


def test_a_run_that_differs_is_shown(tmp_path):
    assert survival.kills(tmp_path) == "Not measured yet."
    stored = {"where": {}, "flags": ["--config", "x"], "seconds": 3.0, "killed_after": [0.5, 2.0], "ends": 2}
    (tmp_path / survival.FILE).write_text(json.dumps(stored | {"differing": 1}))
    assert "2 runs came to their end, 1 of them **differ**" in " ".join(survival.kills(tmp_path).split())


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
