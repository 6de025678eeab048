"""What watches a training: the interface of metrics files, of a progress bar, or of anything that a user brings.

Callbacks run on the host between iterations, in the order in which they are given; what one of them raises ends the
training, and the others are told of the end. `loggers.py` and `progress_bar.py` hold those of this project.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from t2tl_jax.runs.config import Config
from t2tl_jax.runs.rows import Row

__all__ = ["Callback", "Row", "TrainingProgress"]


@dataclass
class TrainingProgress:
    """How far a training is; callbacks may read it, and end the training by setting `stop`."""

    config: Config
    """What is trained."""
    seeds: tuple[int, ...]
    """Numbers of the seeds."""
    iterations: int
    """Iterations in all, unless it ends before."""
    frames_per_iteration: int
    """Environment steps of each seed in one iteration."""
    has_pools: bool = False
    """Whether training takes one pool of random tasks after another."""
    folder: Path | None = None
    """Of the run; None for one that is not kept on disk."""
    devices: int = 1
    """Devices that train."""
    done: int = 0
    """Iterations behind us."""
    last_row: int = 0
    """The iteration of the last row that stands for what was done: of very long runs, one stands for several."""
    started_from: int = 0
    """Iterations that earlier sessions of a resumed run had done."""
    pretraining_seconds: float = 0.0
    """Wall clock that this session spent on its pre-training, compiling included; compiling for the training itself
    goes on meanwhile."""
    compile_wait_seconds: float = 0.0
    """Wall clock that this session waited for compiling and did nothing else. With `pretraining_seconds` and
    `train_seconds` nothing is counted twice."""
    compile_seconds: float = 0.0
    """What compiling took in this session, from its beginning to its end, beside whatever went on meanwhile."""
    train_seconds: float = 0.0
    """Wall clock that training took in this session, so far."""
    checkpoint_seconds: float = 0.0
    """What of that went by while training stood still for checkpoints, which are written beside it."""
    success_since: tuple[int, ...] = ()
    """By seed, the iteration from which on its success rate stayed above 95 %, counted from 1; 0 while it does not."""
    stop: str = ""
    """Why the training is to end before its last iteration, in a few words; '' to go on."""
    notes: dict[str, Any] = field(default_factory=dict)
    """What else there is to know of the run, by name, such as what its pre-training cost."""


class Callback:
    """Does nothing; derive from it and override what you need."""

    def on_plan(self, progress: TrainingProgress) -> None:
        """Everything has been checked; compiling comes next."""

    def on_start(self, progress: TrainingProgress) -> None:
        """Compiled; the first iteration comes next."""

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """An iteration is over: one row for each seed, in the order of the seeds."""

    def on_checkpoint(self, progress: TrainingProgress) -> None:
        """A checkpoint is about to be written, which counts on everything recorded so far."""

    def on_end(self, progress: TrainingProgress) -> None:
        """The training is over, also if it was interrupted or failed.

        Every callback that was told of the plan hears of the end, whatever another one raises, and even if `on_start`
        never came.
        """
