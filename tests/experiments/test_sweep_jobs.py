"""Sweeps by several processes: which job has which points, what is refused, and what a dead one leaves."""

import os
import re
import signal
import stat
import sys
import threading
import time
from pathlib import Path

import pytest

import tests.fake_learner  # noqa: F401, the configuration `fake`
from experiments import sweep
from experiments.reproduction import launch
from experiments.sweeps import work
from experiments.sweeps.cluster import Cluster
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.interrupts import NeverStop

GRID = ("--grid", "learner.rate=1e-2,2e-2,3e-2")


@pytest.fixture(autouse=True)
def submitit(as_many_devices):
    return pytest.importorskip("submitit", reason="needs the extra cluster: pip install -e '.[cluster]'")


def command(folder, *flags):
    common = ("--import", "tests.fake_learner", "--config", "fake", "--folder", str(folder), "--seeds", "2")
    return sweep.main([*common, *flags])


def metrics(folder):
    return {path.name: RunFolder(path).metrics.read_text() for path in folder.glob("*=*")}


# ----- who does what -----


def test_programs_are_taken_apart_for_idle_workers():
    one, other = {Path("a"): 1, Path("b"): 2, Path("c"): 3}, {Path("d"): 4}
    assert work.parts([one, other], 2) == [one, other]
    assert work.parts([one, other], 3) == [{Path("a"): 1, Path("c"): 3}, {Path("b"): 2}, other]
    assert work.parts([one], 8) == [{Path("a"): 1}, {Path("b"): 2}, {Path("c"): 3}]


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--workers", "0"), "--workers takes a whole number from 1 on, got 0"),
        (("--workers", "2", "--cluster", "moon"), "invalid choice: 'moon'"),
        (("--cluster", "slurm"), "belong to --workers NUMBER"),
        (("--workers", "2", "--cluster", "slurm"), "a SLURM job has a time limit"),
        (("--workers", "2", "--cluster-option", "timeout-min"), "--cluster-option takes NAME=VALUE"),
        (("--workers", "2", "--cluster-option", "colour=red"), "submitit does not take this sweep to local: .*colour"),
        (("--workers", "2", "--cluster-option", "gpus-per-node=two"), "gpus-per-node takes a whole number.* 'two'"),
        (("--workers", "2", "--cluster-option", "gpus-per-node=²"), "gpus-per-node takes a whole number.* '²'"),
        (("--workers", "2", "--cluster-option", f"gpus-per-node={'9' * 5000}"), "gpus-per-node takes a whole number"),
        (("--workers", "2", "--only", "1"), "leave --workers out"),
        (("--only", "²"), "--only takes numbers of points from 0 to 2, such as 0,2, got '²'"),
        (("--only", "9" * 5000), "--only takes numbers of points from 0 to 2, such as 0,2, got '999"),
        (("--only", "1,3"), "--only takes numbers of points from 0 to 2, such as 0,2, got '1,3'"),
    ],
)
def test_what_cannot_be_handed_over_is_refused(flags, said, tmp_path, capsys):
    assert command(tmp_path, *GRID, *flags) == 2
    told = capsys.readouterr().err
    assert re.search(said, told), told
    assert not list(tmp_path.iterdir())


def test_jobs_take_the_gpus_that_this_process_may_use(monkeypatch, capsys):
    monkeypatch.setattr(launch, "visible_gpus", lambda: ["2", "GPU-b", "5"])
    assert Cluster(3, options={"gpus_per_node": 1})._gpus == ["2", "GPU-b", "5"]
    assert Cluster(1, options={"gpus_per_node": 2})._gpus == ["2,GPU-b"]
    assert Cluster(8, "slurm", {"gpus_per_node": 4})._gpus == [""] * 8
    assert capsys.readouterr().out == ""
    assert Cluster(4)._gpus == [""] * 4
    assert "note: the jobs use no GPU, and there are 3;" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("visible", "said"),
    [
        (
            ["2", "3"],
            "takes 3 GPUs, of which this process may use 2: 2, 3; take --workers 2$",
        ),
        ([], "may use none$"),
    ],
)
def test_more_gpus_than_there_are_are_refused(visible, said, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(launch, "visible_gpus", lambda: visible)
    assert command(tmp_path, *GRID, "--workers", "3", "--cluster-option", "gpus-per-node=1") == 2
    told = capsys.readouterr().err
    assert re.search(said, told), told
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_job_sees_the_gpus_of_its_slot(tmp_path, monkeypatch):
    (tmp_path / "spy.py").write_text(
        "import os, pathlib\n(pathlib.Path(__file__).parent / os.environ['CUDA_VISIBLE_DEVICES']).touch()\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    monkeypatch.setattr(launch, "visible_gpus", lambda: ["GPU-b"])
    words = ("--import", "spy", "--config", "zone_ppo", "--grid", "learner.epochs=1,2", "--list")  # trains nothing
    jobs = Cluster(1, options={"gpus_per_node": 1})
    assert jobs.run([words], tmp_path, NeverStop(), lambda number: True) == []
    assert {path.name for path in tmp_path.glob("GPU-*")} == {"GPU-b"}


def test_damaged_groups_name_no_points(tmp_path):
    for content in ("", "[]", "{}", '[{"name": 1}, 2]', "[" * 100_000):
        (tmp_path / "group.json").write_text(content)
        assert work.names(tmp_path) == []


# ----- jobs -----


def jobs_of(folder):
    """The processes of submitit that do the jobs of a sweep."""
    for process in Path("/proc").iterdir():
        try:
            words = (process / "cmdline").read_bytes().split(b"\0") if process.name.isdigit() else []
        except OSError:
            continue
        if b"submitit.core._submit" in words and any(str(folder).encode() in word for word in words):
            yield int(process.name)


def kill_one(folder, killed):
    """Kill a job of a sweep once all have a checkpoint."""
    for _ in range(1200):
        time.sleep(0.05)
        begun = {path.parts[-4] for path in folder.glob("group-*/checkpoints/*/info") if path.parts[-2].isdigit()}
        if len(begun) == 2 and (jobs := sorted(jobs_of(folder))):
            os.kill(jobs[0], signal.SIGKILL)
            killed.append(jobs[0])
            return


@pytest.mark.slow
def test_the_work_of_a_killed_job_is_done_by_the_next_command(tmp_path, monkeypatch, capsys):
    slow = ("--frames", "1000", "--run.checkpoint-period", "0")
    assert command(tmp_path / "one", *GRID, *slow) == 0
    monkeypatch.setenv("FAKE_SECONDS", "0.3")
    killed = []
    killer = threading.Thread(target=kill_one, args=(tmp_path / "two", killed))
    killer.start()
    assert command(tmp_path / "two", *GRID, *slow, "--workers", "2") == 2
    killer.join()
    said = capsys.readouterr()
    assert len(killed) == 1 and "1 of 2 jobs did not finish; give the same command again to continue" in said.err
    assert "ended without its runs: see " in said.out
    (left,) = (tmp_path / "two").glob("group-*")

    monkeypatch.delenv("FAKE_SECONDS")
    assert command(tmp_path / "two", *GRID, *slow) == 0  # in one process, which finds the group that was begun
    said = capsys.readouterr().out
    assert f"group  {left}" in said and "resuming after iteration" in said and "note:" not in said
    assert not left.exists()
    one, two = metrics(tmp_path / "one"), metrics(tmp_path / "two")
    assert len(one) == 3 and one == two


STAND_INS = {
    # As SLURM does, it reads the script before it answers: submitit then moves that file, and there is none meanwhile.
    "sbatch": """cp "$1" "$SCRIPTS/$$"
SLURM_JOB_ID=$$ SLURM_NTASKS=1 SLURM_JOB_NUM_NODES=1 SLURM_NODEID=0 SLURM_PROCID=0 SLURM_LOCALID=0 \\
    nohup bash "$SCRIPTS/$$" >/dev/null 2>&1 &
echo $! > "$SCRIPTS.$$"
echo "Submitted batch job $$"
""",
    "srun": f"""until [ "$1" = "{sys.executable}" ]; do shift; done
exec "$@"
""",
    "sacct": """echo 'JobID|State|NodeList'
for script in "$SCRIPTS"/*; do
    job=${script##*/}
    kill -0 "$(cat "$SCRIPTS.$job")" 2>/dev/null || echo "$job|FAILED|here"
done
""",
    "scancel": "exit 0\n",
}
"""For SLURM's commands: each job runs at once on this machine. Of one that is over `sacct` says that it failed, which
counts where it left no result: such a job is not waited for."""


@pytest.mark.slow
def test_a_search_by_slurm_jobs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("optuna", reason="needs the extra search")
    for name, text in STAND_INS.items():
        path = tmp_path / "bin" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("#!/bin/bash\n" + text)
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    (tmp_path / "scripts").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    monkeypatch.setenv("SCRIPTS", str(tmp_path / "scripts"))
    searched = ("--search", "2", "--batch", "2", "--space", "learner.rate=log:1e-3..1e-1")
    options = ("timeout-min=30", "gpus-per-node=1", "slurm-partition=fast")
    slurm = ("--cluster", "slurm", *(word for option in options for word in ("--cluster-option", option)))
    assert command(tmp_path / "jobs", *searched, "--workers", "2", *slurm) == 0
    assert "best: trial" in capsys.readouterr().out
    scripts = [path.read_text() for path in (tmp_path / "scripts").iterdir()]
    assert len(scripts) == 2 and all("--partition=fast" in text and "--gpus-per-node=1" in text for text in scripts)

    assert command(tmp_path / "here", *searched) == 0
    trials = [
        [RunFolder(path).metrics.read_text() for path in sorted((tmp_path / name).glob("trial-*"))]
        for name in ("jobs", "here")
    ]
    assert len(trials[0]) == 2 and trials[0] == trials[1]
    assert not list((tmp_path / "jobs").glob("jobs-*"))
