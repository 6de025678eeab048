"""Seeds in which something was not finite: told once, frozen, and kept in the run's status and checkpoints."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from t2tl_jax.errors import Note
from t2tl_jax.runs.callbacks import TrainingProgress
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.guard import CAUSES, Fault
from t2tl_jax.training.types import Metrics

NAME = "faults"
"""Among the notes of a run, and so in ``status.json`` and in checkpoints: {seed: {"iteration", "frames", "fault",
"cause"}}, where `fault` is the name that a program knows and `cause` says it in words."""

ALL_FROZEN = "every seed is frozen"
"""Why a run ends in which nothing is left to train."""


def note(progress: TrainingProgress, faults: np.ndarray) -> None:
    """Take in the faults int[seeds] of the iteration at hand; of a seed's first one the user is told."""
    for index in np.flatnonzero(faults):
        seed, known = progress.seeds[index], progress.notes.setdefault(NAME, {})
        if str(seed) in known:
            continue
        fault, frames = Fault(int(faults[index])), progress.frames_per_iteration
        cause = CAUSES[fault]
        first, last = (progress.done - 1) * frames, progress.done * frames
        known[str(seed)] = {"iteration": progress.done, "frames": last, "fault": fault.name, "cause": cause}
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
    known = progress.notes.get(NAME, {})
    return np.array([_code(known[str(seed)]) if str(seed) in known else 0 for seed in progress.seeds], np.int32)


def _code(entry: Mapping[str, Any]) -> Fault:
    """Of what is known of a seed; where that says nothing of its fault, some: whatever it was, the seed is frozen."""
    return Fault.__members__.get(str(entry.get("fault")), Fault.ENVIRONMENT)


def given_back(iterate: Callable[[Any, TaskParams], tuple[Any, Metrics]], fault: Any) -> Callable[..., Any]:
    """The program of an iteration, which from now on is given the faults that it found itself: they need not come by
    the host.

    Args:
        iterate: (state, env_params) -> (state, metrics), of all seeds.
        fault: int32[seeds], on the devices, those that are known at the start.
    """

    def with_faults(state: Any, env_params: TaskParams) -> tuple[Any, Metrics]:
        nonlocal fault
        state, metrics = iterate(state, replace(env_params, fault=fault))
        fault = metrics.fault
        return state, metrics

    return with_faults


def all_frozen(progress: TrainingProgress) -> bool:
    """Whether no seed is left to train."""
    return len(progress.notes.get(NAME, {})) == len(progress.seeds)


def of_lanes(known: Mapping[str, Any], lanes: Sequence[int], seeds: Sequence[int]) -> dict[str, Any]:
    """What is known of some lanes of a group, by the seeds that they are in a run of their own."""
    return {str(seed): known[str(lane)] for lane, seed in zip(lanes, seeds, strict=True) if str(lane) in known}
