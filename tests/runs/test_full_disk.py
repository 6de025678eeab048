"""A disk that is really full, at several moments of a run: a small file system of its own, which no other one sees."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

RUN = """
--config zone_ppo_closed_form --method dfa --seeds 2 --frames 8192 --learner.num-envs 16 --learner.unroll-length 64
--learner.minibatch-size 256 --episode-length 50 --run.evaluation-episodes 0 --run.gif False --run.checkpoint-period 0
--run.progress False
"""
"""A checkpoint after each of eight iterations."""

SCRIPT = """
set -e
mount -t tmpfs -o size={size} tmpfs {place}
cd {root}
code=0
{python} -m experiments.run {flags} --run.folder {place}/runs > {place}.first 2>&1 || code=$?
echo $code > {place}.code
mount -o remount,size=100m {place}
[ $code = 0 ] || {python} -m experiments.run --resume {place}/runs/*/* > {place}.second 2>&1
cp {place}/runs/*/*/metrics.csv {place}.csv
"""


def can_mount() -> bool:
    """Whether this system lets a process have file systems of its own."""
    command = ["unshare", "-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    try:
        return subprocess.run(command, capture_output=True, timeout=60).returncode == 0
    except OSError:
        return False


@pytest.fixture(scope="module")
def run_on():
    """Run on a disk of a size, make room, resume: (size, folder) -> exit code, first output, metrics at the end."""
    if not can_mount():
        pytest.skip("needs a file system of its own, which this system does not grant")

    def done(size: str, folder: Path) -> tuple[int, str, str]:
        place = folder / "disk"
        place.mkdir()
        flags = " ".join(RUN.split())
        script = SCRIPT.format(size=size, place=place, root=ROOT, python=sys.executable, flags=flags)
        ended = subprocess.run(["unshare", "-rm", "bash", "-c", script], capture_output=True, text=True, timeout=300)
        files = (folder / "disk.first", folder / "disk.second")
        first, second = (file.read_text() if file.exists() else "" for file in files)
        assert ended.returncode == 0, f"{ended.stderr}\n{first}\n{second}"
        return int((folder / "disk.code").read_text()), first, (folder / "disk.csv").read_text()

    return done


@pytest.fixture(scope="module")
def whole(run_on, tmp_path_factory):
    """Where there is room for all of it."""
    code, said, metrics = run_on("100m", tmp_path_factory.mktemp("whole"))
    assert code == 0, said
    return metrics


@pytest.mark.slow
@pytest.mark.parametrize("size", ["20k", "1500k"])
def test_a_full_disk_is_told_and_the_run_goes_on_as_if_nothing_had_been(run_on, whole, tmp_path, size):
    """At the first files or, beside the training, at a checkpoint, unless a row of the metrics comes upon it first."""
    code, said, metrics = run_on(size, tmp_path)
    assert code == 2 and "cannot write" in said and "No space left" in said and "resume the run" in said, said[-2000:]
    assert "Traceback" not in said and "Event loop" not in said
    assert metrics == whole
