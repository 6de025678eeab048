"""A run under way: all that its parts need to know of it, and the file that tells others how far it is."""

import dataclasses
from collections.abc import Callable
from typing import Any

from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.build import Experiment
from experiments.configs import Config
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.convergence import Convergence
from t2tl_jax.runs.interrupts import StopRequest
from t2tl_jax.training.program import Program

Build = Callable[[Config], Experiment]


@dataclasses.dataclass
class Run:
    """A run under way."""

    folder: RunFolder
    config: Config
    experiment: Experiment
    program: Program
    seeds: tuple[int, ...]
    stop: StopRequest
    build: Build
    command: list[str]
    convergence: Convergence = dataclasses.field(init=False)
    compile_seconds: float = 0.0
    train_seconds: float = 0.0
    started_from: int = 0
    earlier: dict[str, Any] = dataclasses.field(init=False)
    """``status.json`` as the session before this one left it."""
    pretraining: dict[str, Any] | None = dataclasses.field(init=False)
    """What the pre-training cost, and how it ended."""

    def __post_init__(self) -> None:
        self.convergence = Convergence(self.config.convergence, len(self.seeds))
        self.earlier = run_folder.read_json(self.folder.status)
        self.pretraining = self.earlier.get("pretraining")


def write_status(run: Run, iteration: int, state: str) -> None:
    """Write ``status.json``: `state` is training, finished or interrupted, after `iteration`."""
    trained = iteration - run.started_from
    frames = trained * run.experiment.agent.frames_per_iteration * len(run.seeds)
    status = {
        "state": state,
        "iteration": iteration,
        "iterations": run.experiment.iterations,
        "frames_per_seed": iteration * run.experiment.agent.frames_per_iteration,
        "seeds": list(run.seeds),
    }
    if run.train_seconds > 0 and trained > 0:
        status["last_session"] = {
            "compile_seconds": round(run.compile_seconds, 2),
            "training_seconds": round(run.train_seconds, 2),
            "frames_per_second_all_seeds": round(frames / run.train_seconds, 1),
        }
    elif "last_session" in run.earlier:
        status["last_session"] = run.earlier["last_session"]
    before = run.earlier.get("all_sessions", {})
    status["all_sessions"] = {
        "compile_seconds": round(before.get("compile_seconds", 0.0) + run.compile_seconds, 2),
        "training_seconds": round(before.get("training_seconds", 0.0) + run.train_seconds, 2),
    }
    if run.pretraining is not None:
        status["pretraining"] = run.pretraining
    run_folder.write_json(run.folder.status, status)
