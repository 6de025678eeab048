"""A process that trains the fake learner in forked children, which kill themselves at chosen moments.

``python -m tests.killed_run FOLDER`` makes two runs, ``whole`` and ``killed``. Modules are loaded once, before any
child is made, and JAX computes in the children only.
"""

import os
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import tensorboardX  # noqa: F401, which every run loads, as the next two
from orbax.checkpoint import StandardCheckpointHandler as StandardHandler

import t2tl_jax
import t2tl_jax.evaluation.report
import t2tl_jax.runs.train
import tests.fake_learner  # noqa: F401
from t2tl_jax.registry import named_config
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.metrics_file import MetricsFile

LIMIT = 120
"""Seconds until a child that hangs is ended: else it would hold the pipes that whoever started all this reads."""


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def at_call(owner: object, name: str, number: int, action: Callable[..., None]) -> Callable[[], None]:
    """Patches a function: `action` gets the arguments of this call of it, counted from 1, and then all is over."""

    def patch() -> None:
        original, calls = getattr(owner, name), 0

        def patched(*arguments, **options):
            nonlocal calls
            calls += 1
            if calls == number:
                action(*arguments, **options)
                die()
            return original(*arguments, **options)

        setattr(owner, name, patched)

    return patch


def half_a_row(file: MetricsFile, rows) -> None:
    file._file.write("3,300,0,1,0.5")
    file._file.flush()


def nothing(*_, **__) -> None:
    pass


def finish_writing(checkpoints: Checkpoints, *_, **__) -> None:
    checkpoints.wait()


MOMENTS = {
    "a checkpoint has some of its items": at_call(StandardHandler, "async_save", 5, nothing),
    "in the middle of a row, the checkpoint complete": at_call(MetricsFile, "append", 2, half_a_row),
    "between a row and its checkpoint": at_call(Checkpoints, "save", 2, finish_writing),
}


def child(folder: Path, patch: Callable[[], None] = nothing) -> int:
    """Begin or go on with a run in a child; its exit status."""
    process = os.fork()
    if process == 0:
        signal.alarm(LIMIT)
        code = 1
        try:
            patch()
            config = named_config("fake")
            if (folder / "config.json").exists():
                t2tl_jax.resume(folder)
            else:
                own = replace(config.run, checkpoint_period=0)
                t2tl_jax.train(config, folder=folder, seeds=2, frames=500, run=own)
            code = 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


if __name__ == "__main__":
    base = Path(sys.argv[1])
    assert child(base / "whole") == 0
    for moment, patch in MOMENTS.items():
        assert child(base / "killed", patch) == -signal.SIGKILL, moment
    assert child(base / "killed") == 0
