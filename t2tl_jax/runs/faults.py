"""Seeds in which something was not finite: told once, and kept in the run's status."""

import warnings

import numpy as np

from t2tl_jax.errors import Note
from t2tl_jax.runs.callbacks import TrainingProgress
from t2tl_jax.training.guard import CAUSES, Fault

NAME = "faults"
"""Among the notes of a run, and so in ``status.json``: {seed: {"iteration", "frames", "cause", "iterations"}}."""


def note(progress: TrainingProgress, faults: np.ndarray) -> None:
    """Take in the faults int[seeds] of the iteration at hand; of a seed's first one the user is told."""
    for index in np.flatnonzero(faults):
        seed, known = progress.seeds[index], progress.notes.setdefault(NAME, {})
        if str(seed) in known:
            known[str(seed)]["iterations"] += 1
            continue
        cause, frames = CAUSES[Fault(int(faults[index]))], progress.frames_per_iteration
        first, last = (progress.done - 1) * frames, progress.done * frames
        known[str(seed)] = {"iteration": progress.done, "frames": last, "cause": cause, "iterations": 1}
        warnings.warn(
            f"seed {seed}, iteration {progress.done:,} (frames {first:,} to {last:,}): {cause}. PPO and DQN leave out "
            "gradient steps that are not finite; the other seeds do not notice. status.json counts such iterations",
            Note,
            stacklevel=2,
        )
