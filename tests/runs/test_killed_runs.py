"""A run that is killed again and again, at the nastiest moments, ends as one that never was: bit for bit."""

import subprocess
import sys
from pathlib import Path

import pytest

SAME = (
    "metrics.csv",
    "checkpoints/5/info/metadata",  # with a checksum of every array
    "checkpoints/4/info/metadata",
)


@pytest.mark.slow
def test_killed_at_the_nastiest_moments(tmp_path):
    """With half of a checkpoint or of a row on disk, and between a row and its checkpoint.

    At random moments, with pre-training and evaluation: ``python -m experiments.benchmarks.kills``.
    """
    command = [sys.executable, "-m", "tests.killed_run", str(tmp_path)]
    answer = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=300)
    assert answer.returncode == 0, answer.stderr
    for name in SAME:
        assert (tmp_path / "killed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert not list((tmp_path / "killed" / "checkpoints").glob("*tmp*"))
