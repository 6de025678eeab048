"""``status.json`` of a run: how far it is, what that took, since when its seeds succeed."""

from typing import Any

from t2tl_jax.runs import status_form
from t2tl_jax.runs.callbacks import Callback, TrainingProgress
from t2tl_jax.runs.folder import RunFolder, write_json, writing


class StatusFile(Callback):
    """Writes the file with every checkpoint, and at the end."""

    def __init__(self, folder: RunFolder, progress: TrainingProgress) -> None:
        """Take up what the session before this one left: its times, and what is known of a pre-training."""
        self._folder = folder
        self._earlier = status_form.read(folder)
        if "pretraining" in self._earlier:
            progress.notes["pretraining"] = self._earlier["pretraining"]

    def on_checkpoint(self, progress: TrainingProgress) -> None:
        """The training goes on."""
        self._write(progress, "training")

    def on_end(self, progress: TrainingProgress) -> None:
        """It does not."""
        self._write(
            progress, "interrupted" if progress.stop in ("interrupted", "failed") or not progress.done else "finished"
        )

    def _write(self, progress: TrainingProgress, state: str) -> None:
        frames, trained = progress.frames_per_iteration, progress.done - progress.started_from
        status: dict[str, Any] = {
            "state": state,
            "ended": progress.stop,
            "iteration": progress.done,
            "iterations": progress.iterations,
            "frames_per_seed": progress.done * frames,
            "seeds": list(progress.seeds),
        }
        if progress.train_seconds > 0 and trained > 0:
            speed = trained * frames * len(progress.seeds) / progress.train_seconds
            status["last_session"] = {
                **{name: round(spent, 2) for name, spent in _seconds(progress).items()},
                "frames_per_second_all_seeds": round(speed, 1),
            }
        elif "last_session" in self._earlier:
            status["last_session"] = self._earlier["last_session"]
        before = self._earlier.get("all_sessions", {})
        status["all_sessions"] = {
            name: round(before.get(name, 0.0) + spent, 2) for name, spent in _seconds(progress).items()
        }
        since = [since * frames or None for since in progress.success_since]
        status["success_since_frames"] = since or self._earlier.get(
            "success_since_frames", self._earlier.get("solved_after_frames")
        )
        with writing(self._folder.status):
            write_json(self._folder.status, status | progress.notes)


def _seconds(progress: TrainingProgress) -> dict[str, float]:
    """The times of a session. Compiling overlaps with the others but for the wait for it, checkpoints with training."""
    return {
        "pretraining_seconds": progress.pretraining_seconds,
        "compile_wait_seconds": progress.compile_wait_seconds,
        "training_seconds": progress.train_seconds,
        "compile_seconds": progress.compile_seconds,
        "checkpoint_seconds": progress.checkpoint_seconds,
    }
