"""A disk that is really full, at several moments of a run: a small file system of its own, which no other one sees."""

import subprocess
import sys
from pathlib import Path

import pytest

from experiments import run

ROOT = Path(__file__).parents[2]

RUN = """
--config fake --seeds 2 --frames 800 --run.evaluation-episodes 0 --run.gif False --run.checkpoint-period 0
--run.progress False
"""
"""A checkpoint after each of eight iterations."""

NUMBERS = "50000"
"""Of each seed, so that what does not fit is a large file, which leaves room for a small one: a checkpoint takes more
than a third of 3 MB."""

SCRIPT = """
set -e
mount -t tmpfs -o size={size} tmpfs {place}
cd {root}
code=0
FAKE_SECONDS=0.02 {python} -m experiments.run --import tests.fake_learner {flags} --run.folder {place}/runs \
    > {place}.said 2>&1 || code=$?
echo $code > {place}.code
mount -o remount,size=100m {place}
cp -r {place}/runs {place}.left
"""


def can_mount() -> bool:
    """Whether this system lets a process have file systems of its own."""
    command = ["unshare", "-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    try:
        return subprocess.run(command, capture_output=True, timeout=60).returncode == 0
    except OSError:
        return False


@pytest.fixture
def run_on(resume, capsys, monkeypatch, as_many_devices):
    """Run on a disk of a size, make room, resume what was left there: (size, folder) -> exit code, both outputs,
    metrics at the end."""
    if not can_mount():
        pytest.skip("needs a file system of its own, which this system does not grant")
    monkeypatch.setenv("FAKE_NUMBERS", NUMBERS)

    def done(size: str, folder: Path) -> tuple[int, str, str, str]:
        place = folder / f"disk_{size}"
        place.mkdir()
        flags = " ".join(RUN.split())
        script = SCRIPT.format(size=size, place=place, root=ROOT, python=sys.executable, flags=flags)
        ended = subprocess.run(["unshare", "-rm", "bash", "-c", script], capture_output=True, text=True, timeout=300)
        code, said = ((folder / f"{place.name}.{what}").read_text() for what in ("code", "said"))
        assert ended.returncode == 0, f"{ended.stderr}\n{said}"
        (left,) = (folder / f"{place.name}.left").glob("*/*")
        capsys.readouterr()
        assert resume(left) == 0
        return int(code), said, capsys.readouterr().out, (left / "metrics.csv").read_text()

    return done


@pytest.mark.slow
def test_a_full_disk_is_told_and_the_run_goes_on_as_if_nothing_had_been(run_on, tmp_path):
    """At the first files, before there is a checkpoint, so that the run begins again; and beside the training at a
    checkpoint, unless a row of the metrics comes upon the full disk first. A third run never meets one."""
    found = {size: run_on(size, tmp_path) for size in ("20k", "3000k")}
    assert run.main([*RUN.split(), "--run.folder", str(tmp_path / "whole")]) == 0
    (metrics,) = (tmp_path / "whole").glob("*/*/metrics.csv")
    for code, said, _, ended in found.values():
        assert code == 2 and "cannot write" in said and "No space left" in said, said[-2000:]
        assert "resume the run" in said and "Traceback" not in said and "Event loop" not in said
        assert ended == metrics.read_text()
    assert "resuming after" not in found["20k"][2] and "resuming after iteration" in found["3000k"][2]
