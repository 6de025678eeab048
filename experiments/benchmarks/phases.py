"""What a run is doing, from what it has written: for the command that kills runs."""

import json
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

START, PRETRAINING, TRAINING, CHECKPOINT, EVALUATION = PHASES = (
    "starting or compiling",
    "pre-training",
    "training",
    "writing a checkpoint",
    "evaluating",
)
"""In the order of a run. A checkpoint may be one of either training; evaluating lasts to the end."""

UNFINISHED = "*.orbax-checkpoint-tmp"
"""A checkpoint has this name until it is complete."""

EVALUATES = "evaluating the final"
"""How the line begins that `experiments.run` prints before it evaluates."""


def phase(run: Path | None, said: str, since: float) -> str:
    """What a process does that began at the time `since`, has written `said`, and whose run lies in the folder `run`.

    Files from before `since` are those of an earlier process and say nothing. A process that was killed leaves its
    files as they were, so the same function says what a kill hit.
    """
    if run is None:
        return START
    first = run / "pretraining"
    if any(_written(path) > since for folder in (run, first) for path in folder.glob(f"checkpoints/{UNFINISHED}")):
        return CHECKPOINT
    if EVALUATES in said:
        return EVALUATION
    if _written(run / "metrics.csv") > since:
        return TRAINING
    if _written(first / "metrics.csv") > since and not _finished(first / "status.json"):
        return PRETRAINING
    return START


def _finished(status: Path) -> bool:
    return status.exists() and json.loads(status.read_text(encoding="utf-8"))["state"] == "finished"


def _written(path: Path) -> float:
    """When a file was last written; 0 for none (a checkpoint loses this name when it is complete)."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


@dataclass
class Watch:
    """How long a run has been in each phase, and how often it has come into it."""

    begin: float = field(default_factory=time.monotonic)
    now: str = START
    entered: float = 0.0
    """When the present phase began, in seconds since the start."""
    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    times: Counter[str] = field(default_factory=lambda: Counter({START: 1}))

    def see(self, now: str) -> float:
        """Take note of what it is doing; seconds since its start."""
        after = time.monotonic() - self.begin
        if now != self.now:
            self.seconds[self.now] += after - self.entered
            self.now, self.entered = now, after
            self.times[now] += 1
        return after

    def lengths(self) -> dict[str, float]:
        """Seconds of each phase that was seen, once all is over; of starts and checkpoints, those of one of them."""
        self.see("")
        often = {name: self.times[name] if name in (START, CHECKPOINT) else 1 for name in PHASES}
        return {name: self.seconds[name] / often[name] for name in PHASES if name in self.seconds}
