"""``--workers``: the programs of a sweep as jobs of submitit, on this machine or on those of a SLURM cluster.

Each job is this command itself with ``--only``: it trains some of the points and leaves their runs in the folder of the
sweep. submitit hands a job over as a pickle. What is pickled here is the name of `work`, a list of words and the names
of GPUs, in a folder that is made for these jobs and that others cannot write to; no result is ever unpickled: whether a
job did its work is told by the runs that it leaves.
"""

import os
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from t2tl_jax.errors import UserError
from t2tl_jax.runs.interrupts import Stoppable

ENGINES = ("local", "slurm")
"""Where jobs can run: as processes of this machine, or on a SLURM cluster."""

POLL = 0.5
"""Seconds between two looks at the jobs."""

A_YEAR = 365 * 24 * 60
"""Minutes that jobs of this machine may take: submitit wants a number."""


@dataclass(frozen=True)
class Cluster:
    """Where the programs of a sweep run."""

    workers: int
    """How many jobs there are at a time."""
    engine: str = "local"
    """One of `ENGINES`."""
    options: Mapping[str, int | str] = field(default_factory=dict)
    """Parameters of submitit, such as ``timeout_min``."""

    def run(
        self, jobs: Sequence[Sequence[str]], base: Path, stop: Stoppable, is_done: Callable[[int], bool]
    ) -> list[int]:
        """Do all jobs, so many at a time, and return the numbers of those that did not do their work.

        Args:
            jobs: words of the command for each.
            base: the folder of the sweep, which all machines see.
            stop: who may ask to stop; jobs are asked to, save, and end.
            is_done: whether a job has done its work.

        Raises:
            UserError: if submitit is not there, or refuses the options, or there are too few GPUs.
        """
        gpus = self._gpus
        folder = Path(tempfile.mkdtemp(prefix="jobs-", dir=base))
        waiting, running, failed = list(range(len(jobs))), dict[int, tuple[int, Any]](), []
        told = False
        try:
            while running or (waiting and not told):
                while waiting and len(running) < self.workers and not told:
                    slot = min(set(range(self.workers)) - {slot for slot, _ in running.values()})
                    number = waiting.pop(0)
                    running[number] = slot, self._submit(folder, gpus[slot], jobs[number])
                time.sleep(POLL)
                for number, (_, job) in list(running.items()):
                    if job.done():
                        del running[number]
                        if is_done(number):
                            continue
                        failed.append(number)
                        if not told:
                            print(f"job {number + 1} of {len(jobs)} ended without its runs: {_log(job)}", flush=True)
                if stop.requested and not told:
                    told = True
                    self._end(job for _, job in running.values())
        except BaseException:
            self._end(job for _, job in running.values())
            raise
        finally:
            for pickled in folder.glob("*.pkl"):
                pickled.unlink()
            if not failed:
                shutil.rmtree(folder, ignore_errors=True)
        return failed + waiting

    @cached_property
    def _gpus(self) -> list[str]:
        """What ``CUDA_VISIBLE_DEVICES`` is for each of the jobs at a time; empty where that is not said here."""
        if self.engine != "local":
            return [""] * self.workers
        from experiments.reproduction.launch import visible_gpus  # which loads JAX

        each = int(self.options.get("gpus_per_node", 0))
        gpus = visible_gpus()
        if gpus and not each:
            print(
                f"note: the jobs use no GPU, and there are {len(gpus)}; "
                "--cluster-option gpus-per-node=1 gives each job one of its own",
                flush=True,
            )
        if self.workers * each > len(gpus):
            there = f"{len(gpus)}: {', '.join(gpus)}" if gpus else "none"
            raise UserError(
                f"--workers {self.workers} with gpus-per-node={each} takes {self.workers * each} GPUs, of which this "
                f"process may use {there}" + (f"; take --workers {most}" if (most := len(gpus) // each) else "")
            )
        return [",".join(gpus[slot * each : (slot + 1) * each]) for slot in range(self.workers)]

    def _submit(self, folder: Path, gpus: str, words: Sequence[str]) -> Any:
        try:
            import submitit
        except ModuleNotFoundError as error:
            raise UserError("--workers needs submitit: pip install 't2tl_jax[cluster]'") from error
        options: dict[str, Any] = {"name": "sweep", "timeout_min": A_YEAR} | dict(self.options)
        # A Ctrl-C at the terminal is for this process, which then tells the jobs.
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            executor = submitit.AutoExecutor(folder, cluster=self.engine)
            executor.update_parameters(**options)
            return executor.submit(work, list(words), gpus)
        except (ValueError, NameError, TypeError, RuntimeError, AssertionError, OSError) as error:
            raise UserError(f"submitit does not take this sweep to {self.engine}: {error}") from error
        finally:
            signal.signal(signal.SIGINT, before)

    def _end(self, jobs: Any) -> None:
        """Ask jobs to save and end; they are waited for."""
        for job in jobs:
            if self.engine == "local":
                os.kill(int(job.job_id), signal.SIGTERM)  # submitit's own way gives them a second
            else:
                job.cancel(check=False)


def work(words: Sequence[str], gpus: str = "") -> int:
    """What a job does: some points of a sweep, on these GPUs if any are named."""
    if gpus:  # submitit knows numbers only, and GPUs may be named by UUID
        os.environ["CUDA_VISIBLE_DEVICES"] = gpus
    from experiments import sweep

    with suppress(OSError):  # it leads a session already
        os.setsid()
    # The signal before a time limit or a pre-emption: save and end, instead of an exception in the middle of something.
    signal.signal(signal.SIGUSR2, lambda number, frame: os.kill(os.getpid(), signal.SIGTERM))
    return sweep.main(words)


def _log(job: Any) -> str:
    """Where a job says why, and its last words."""
    path = Path(job.paths.stderr)
    try:
        lines = [line for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    except OSError:
        return f"see {path.parent}"
    return f"see {path}" + (f"\n  {lines[-1][:300]}" if lines else "")
