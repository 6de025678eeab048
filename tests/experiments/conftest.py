import json
import shutil
from collections.abc import Callable
from pathlib import Path

import fake_learner
import pytest

from experiments import evaluate, run

QUIET = ("--run.compilation-cache", "", "--run.progress", "False", "--episode-length", "5", "--pretrained", "")


@pytest.fixture
def train(tmp_path: Path) -> Callable[..., Path]:
    """Trains the fake learner with further flags and returns the new folder."""
    known: set[Path] = set()

    def command(*flags: str) -> Path:
        arguments = ["--config", "zone_ppo", "--run.folder", str(tmp_path / "runs"), *QUIET, *flags]
        assert run.main(arguments, build=fake_learner.build) == 0
        (new,) = set((tmp_path / "runs" / "zone_ppo").iterdir()) - known
        known.add(new)
        return new

    return command


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two iterations, not to be changed."""
    base = tmp_path_factory.mktemp("finished")
    flags = ["--config", "zone_ppo", "--run.folder", str(base), *QUIET, "--frames", "200"]
    assert run.main([*flags, "--run.evaluation-episodes", "0"], build=fake_learner.build) == 0
    (folder,) = (base / "zone_ppo").iterdir()
    return folder


@pytest.fixture
def finished(finished_run: Path, tmp_path: Path) -> Path:
    """A copy of that run."""
    return Path(shutil.copytree(finished_run, tmp_path / "copy"))


@pytest.fixture
def resume() -> Callable[..., int]:
    """Resumes a run of the fake learner and returns the exit code."""
    return lambda folder, *flags: run.main(["--resume", str(folder), *flags], build=fake_learner.build)


@pytest.fixture
def evaluate_run() -> Callable[..., int]:
    """Evaluates a run of the fake learner and returns the exit code."""
    return lambda folder, *flags: evaluate.main([str(folder), *flags], build=fake_learner.build)


@pytest.fixture
def read_json() -> Callable[[Path], dict]:
    return lambda path: json.loads(path.read_text(encoding="utf-8"))
