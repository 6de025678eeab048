"""Fixtures of runs of the fake learner, for every folder of tests."""

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import tests.fake_learner  # noqa: F401
from experiments import evaluate, run
from t2tl_jax.runs import group_split
from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress


@contextmanager
def full_disk() -> Iterator[None]:
    """The disk is full when the second run of a group is to be written."""
    write = group_split._write_metrics

    def full(group: Any, run: Any, done: Any, part: Any, seeds: Any) -> None:
        if part.start:
            raise OSError("the disk is full")
        write(group, run, done, part, seeds)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(group_split, "_write_metrics", full)
        yield


class StopAfter(Callback):
    """Ends a training behind an iteration, as somebody would who has seen enough."""

    def __init__(self, iteration: int) -> None:
        self.iteration = iteration

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        if progress.done == self.iteration:
            progress.stop = "enough"


@pytest.fixture
def train(tmp_path: Path) -> Callable[..., Path]:
    """Trains the fake learner with further flags and returns the new folder."""
    known: set[Path] = set()

    def command(*flags: str) -> Path:
        assert run.main(["--config", "fake", "--run.folder", str(tmp_path / "runs"), *flags]) == 0
        (new,) = set((tmp_path / "runs" / "fake").iterdir()) - known
        known.add(new)
        return new

    return command


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two iterations, not to be changed."""
    base = tmp_path_factory.mktemp("finished")
    flags = ["--config", "fake", "--run.folder", str(base), "--frames", "200", "--run.evaluation-episodes", "0"]
    assert run.main(flags) == 0
    (folder,) = (base / "fake").iterdir()
    return folder


@pytest.fixture
def finished(finished_run: Path, tmp_path: Path) -> Path:
    """A copy of that run."""
    return Path(shutil.copytree(finished_run, tmp_path / "copy"))


@pytest.fixture
def resume() -> Callable[..., int]:
    """Resumes a run and returns the exit code."""
    return lambda folder, *flags: run.main(["--resume", str(folder), *flags])


@pytest.fixture
def evaluate_run() -> Callable[..., int]:
    """Evaluates a run and returns the exit code."""
    return lambda folder, *flags: evaluate.main([str(folder), *flags])


@pytest.fixture
def read_json() -> Callable[[Path], dict]:
    return lambda path: json.loads(path.read_text(encoding="utf-8"))
