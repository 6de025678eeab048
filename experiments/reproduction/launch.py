"""Several processes that share the runs of a reproduction: so many for every GPU, which otherwise one run leaves idle.

Each is the command itself without ``--workers``, sees a single GPU, and takes runs that no other one has taken
(`locks.py`). Small runs are many short operations that wait for one another; under NVIDIA's multi-process service (MPS)
those of several processes overlap.
"""

import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from experiments.reproduction.locks import gpu_uuids
from experiments.reproduction.work import LOST
from t2tl_jax.runs.interrupts import Stoppable
from t2tl_jax.training.compiler_options import MPS

APART = 1.0
"""Seconds between the starts of two workers, so that they take their first runs in this order."""

POLL = 1.0
"""Seconds between two looks at the workers."""

AGAIN = 2
"""So many times a worker is started once more that crashed or lost its device. Under MPS an error of one client can end
the others of its GPU."""

GPU = "CUDA_VISIBLE_DEVICES"
"""The variable that names a worker's GPU."""

PATIENCE = 120.0
"""Seconds that workers have to write checkpoints when the user asks to stop, and to see that their GPU is lost."""


def visible_gpus(environment: Mapping[str, str] = os.environ) -> list[str]:
    """The GPUs that this process may use, as ``CUDA_VISIBLE_DEVICES`` names them; none without an NVIDIA driver."""
    present = list(gpu_uuids())
    if GPU not in environment:
        return present
    return [name.strip() for name in environment[GPU].split(",") if name.strip()] if present else []


def worker_environments(workers: int, gpus: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """What each worker's environment adds to that of this process, by the worker's name.

    Args:
        workers: how many for each GPU, or in all where there is none.
        gpus: their UUIDs by the names that `visible_gpus` gives. Under MPS a number would count only the GPUs that the
            service has, so that number 1 of a service for GPU 1 alone is none.
    """
    if not gpus:
        return {f"cpu-{i}": {} for i in range(workers)}
    shared = {
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",  # the first one would take most of the memory
        "JAX_PLATFORMS": os.environ.get("JAX_PLATFORMS") or "cuda,cpu",  # a worker without its GPU fails at once
    }
    # The first workers of all GPUs come before the second ones, so that the longest runs spread over the GPUs.
    return {f"gpu-{name}-{i}": {GPU: uuid, **shared} for i in range(workers) for name, uuid in gpus.items()}


@contextmanager
def multi_process_service(wanted: bool, gpus: Sequence[str]) -> Iterator[dict[str, str]]:
    """NVIDIA's MPS for some GPUs for as long as the block lasts, if it is there and none runs; yields what clients need
    of it."""
    control = shutil.which("nvidia-cuda-mps-control")
    if not wanted or control is None or MPS in os.environ:
        yield {}
        return
    with tempfile.TemporaryDirectory(prefix="mps-") as folder:
        places = {MPS: f"{folder}/pipe", "CUDA_MPS_LOG_DIRECTORY": f"{folder}/log"}
        for place in places.values():
            Path(place).mkdir()
        environment = os.environ | places | {GPU: ",".join(gpus)}
        if subprocess.run([control, "-d"], env=environment).returncode:
            print("MPS does not start; the processes of a GPU take turns instead")
            yield {}
            return
        try:
            yield places
        finally:
            subprocess.run([control], input="quit\n", text=True, env=environment)


def launch(
    command: Callable[[], Sequence[str]],
    environments: Mapping[str, Mapping[str, str]],
    logs: Path,
    progress: Callable[[], str],
    stopped: Callable[[], bool],
    say: Callable[[str], None] = print,
) -> list[str]:
    """Run a command for every worker until all have ended; returns the names of those that failed.

    One that crashed or has lost its device (exit code `LOST`) is started again, up to `AGAIN` times, unless the user
    wants to stop or the time is up; the latter under MPS once the others of its GPU have ended, or after `PATIENCE`.

    Args:
        command: returns program and arguments for a start now; nothing once the time is up.
        environments: what each worker's environment adds, by name.
        logs: folder for what each worker prints, in a file of its name.
        progress: what the workers have come to, in a line; said whenever it changes.
        stopped: whether the user wants to stop, which the workers are told once, like by Ctrl-C.
        say: told of progress and of workers that fail.
    """
    logs.mkdir(parents=True, exist_ok=True)
    failed: list[str] = []
    lost: dict[str, float] = {}
    told = 0.0
    say(said := progress())
    working: dict[str, subprocess.Popen[bytes]] = {}
    again = dict.fromkeys(environments, AGAIN)

    def start(name: str) -> bool:
        if not (words := list(command())):
            return False
        with (logs / f"{name}.log").open("ab") as log:
            working[name] = subprocess.Popen(
                words,
                env={**os.environ, **environments[name]},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,  # a Ctrl-C at the terminal reaches them once, through us
            )
        return True

    def waits(name: str) -> bool:
        """Whether another client of MPS still uses its GPU: after an error it takes no new one until these are gone."""
        own = environments[name]
        client = MPS in own or MPS in os.environ
        beside = client and any(environments[other].get(GPU) == own.get(GPU) for other in working)
        return beside and time.monotonic() < lost[name] + PATIENCE

    with ExitStack() as stack:
        stack.callback(_signal_all, working, signal.SIGINT)  # if this process fails, they end as well
        for name in environments:
            if working:
                time.sleep(APART)
            start(name)
        while working or lost:
            time.sleep(POLL)
            for name, process in list(working.items()):
                if process.poll() is None:
                    continue
                del working[name]
                if process.returncode:
                    say(f"{name} ended with exit code {process.returncode}: see {logs / name}.log")
                    if again[name] and _unlucky(process.returncode):
                        crashed = process.returncode != LOST  # by itself, so that there is nothing to wait for
                        lost[name] = -math.inf if crashed else time.monotonic()
                    else:
                        failed.append(name)
            if (now := progress()) != said:
                say(said := now)
            if stopped() and not told:
                told = time.monotonic()
                _signal_all(working, signal.SIGINT)
            if told and time.monotonic() > told + PATIENCE:
                _signal_all(working, signal.SIGKILL)
            if told:
                failed += lost
                lost.clear()
            for name in [name for name in lost if not waits(name)]:
                del lost[name]
                again[name] -= 1
                if start(name):
                    say(f"{name} is started again")
                else:
                    failed.append(name)
    return failed


def _unlucky(code: int) -> bool:
    """Whether a process may do better when it is started again: its device was lost, or a signal ended it that nobody
    sends on purpose."""
    return code == LOST or (code < 0 and -code not in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))


def launch_workers(
    workers: int, arguments: Sequence[str], minutes: float, logs: Path, progress: Callable[[], str], stop: Stoppable
) -> list[str]:
    """Do a reproduction by so many processes for every GPU; returns the names of those that failed.

    Args:
        workers: how many for each GPU, or in all where there is none.
        arguments: those of ``experiments.reproduce`` for each of them, but for ``--minutes``.
        minutes: how long they may train.
        logs: folder for what they print.
        progress: as for `launch`.
        stop: whether the user wants to stop.
    """
    uuids = gpu_uuids()
    gpus = {name: uuids.get(name, name) for name in visible_gpus()}
    end = time.monotonic() + 60 * minutes

    def command() -> list[str]:
        left = (end - time.monotonic()) / 60
        return [sys.executable, "-m", "experiments.reproduce", *arguments, "--minutes", f"{left}"] if left > 0 else []

    with multi_process_service(workers > 1 and bool(gpus), list(gpus.values())) as clients:
        environments = {name: {**own, **clients} for name, own in worker_environments(workers, gpus).items()}
        print(f"{len(environments)} processes on {len(gpus) or 'no'} GPUs; what they print: {logs}")
        return launch(command, environments, logs, progress, lambda: stop.requested)


def _signal_all(processes: Mapping[str, subprocess.Popen[bytes]], number: signal.Signals) -> None:
    for process in processes.values():
        process.send_signal(number)
