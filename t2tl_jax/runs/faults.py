"""Seeds in which something was not finite: told once, frozen, and kept in the run's status and checkpoints."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from t2tl_jax.errors import Note
from t2tl_jax.runs.callbacks import TrainingProgress
from t2tl_jax.training.guard import CAUSES, Fault

NAME = "faults"
"""Among the notes of a run, and so in ``status.json`` and in checkpoints: {seed: {"iteration", "frames", "cause"}}."""


def note(progress: TrainingProgress, faults: np.ndarray) -> None:
    """Take in the faults int[seeds] of the iteration at hand; of a seed's first one the user is told."""
    for index in np.flatnonzero(faults):
        seed, known = progress.seeds[index], progress.notes.setdefault(NAME, {})
        if str(seed) in known:
            continue
        cause, frames = CAUSES[Fault(int(faults[index]))], progress.frames_per_iteration
        first, last = (progress.done - 1) * frames, progress.done * frames
        known[str(seed)] = {"iteration": progress.done, "frames": last, "cause": cause}
        warnings.warn(
            f"seed {seed}, iteration {progress.done:,} (frames {first:,} to {last:,}): {cause}. The seed is frozen: it "
            "keeps what it had learned before that iteration; the other seeds go on. status.json tells it, and the "
            "last checkpoint from before stays",
            Note,
            stacklevel=2,
        )


def restore(progress: TrainingProgress, known: Mapping[str, Any]) -> None:
    """Go on with what a checkpoint knows; the status may be of later, or of a version that froze no seed."""
    progress.notes.pop(NAME, None)
    if known:
        progress.notes[NAME] = {seed: dict(entry) for seed, entry in known.items()}


def first(progress: TrainingProgress) -> int | None:
    """The iteration in which the first seed broke; None if none did."""
    return min((entry["iteration"] for entry in progress.notes.get(NAME, {}).values()), default=None)


def codes(progress: TrainingProgress) -> np.ndarray:
    """The fault of every seed so far, int32[seeds], as the program takes them."""
    of_cause = {cause: fault for fault, cause in CAUSES.items()}
    causes = {seed: entry["cause"] for seed, entry in progress.notes.get(NAME, {}).items()}
    return np.array([of_cause.get(causes.get(str(seed), ""), Fault.NONE) for seed in progress.seeds], np.int32)


def of_lanes(known: Mapping[str, Any], lanes: Sequence[int], seeds: Sequence[int]) -> dict[str, Any]:
    """What is known of some lanes of a group, by the seeds that they are in a run of their own."""
    return {str(seed): known[str(lane)] for lane, seed in zip(lanes, seeds, strict=True) if str(lane) in known}
