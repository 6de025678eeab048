from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from somebody.configs import LIGHTS

from experiments import run
from t2tl_jax import Config

FEW = 3
"""Iterations of the runs here: enough to tell one from another, too few to learn much."""

SHORT = replace(LIGHTS, frames=FEW * LIGHTS.learner.frames_per_iteration, seeds="2")

QUIET = ("--run.compilation-cache", "", "--run.progress", "False", "--run.evaluation-episodes", "4")


@pytest.fixture(scope="session")
def config() -> Config:
    """Somebody's configuration, of few iterations and two seeds."""
    return SHORT


@pytest.fixture(scope="session")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same, trained and evaluated by the command line. Not to be changed."""
    return _command(tmp_path_factory.mktemp("runs"))


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., Path]:
    """Runs the command with further flags and returns the run's folder."""
    return lambda *flags: _command(tmp_path / "runs", *flags)


def _command(base: Path, *flags: str) -> Path:
    known = ["--import", "somebody", "--config", "lights", "--frames", str(SHORT.frames), "--seeds", "2"]
    assert run.main([*known, *QUIET, "--run.folder", str(base), *flags]) == 0
    (folder,) = (base / "lights").iterdir()
    return folder
