"""Fixtures of runs of the fake learner, for every folder of tests."""

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

import tests.fake_learner  # noqa: F401
from experiments import evaluate, run
from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress


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
