"""``status.json`` of a run: how far it is, what that took, since when its seeds succeed."""

import sys
from typing import Any

from t2tl_jax.errors import UserError
from t2tl_jax.runs import faults
from t2tl_jax.runs.callbacks import Callback, TrainingProgress
from t2tl_jax.runs.folder import RunFolder, read_json, write_json, writing

TIMES = {"*": 0.0}
"""Seconds and rates by name, of any names."""

FORM: dict[str, Any] = {
    "state": "",
    "iteration": 0.0,
    "iterations": 0.0,
    "frames_per_seed": 0.0,
    "seeds": [0.0],
    "last_session": TIMES,
    "all_sessions": TIMES,
    "group": {"runs": 0.0, "lanes": 0.0},
    "pretraining": {
        **{"task": "", "frames_per_seed": 0.0, "compile_wait_seconds": 0.0, "compile_seconds": 0.0},
        **{"training_seconds": 0.0, "seeds": [0.0]},
        **{"success_rate": [None], "discounted_return": [None], "length": [None]},
    },
    "success_since_frames": [None],
    "solved_after_frames": [None],
    faults.NAME: {"*": {"iteration": 0.0, "frames": 0.0, "fault": "", "cause": ""}},
}
"""What may stand there, by an example: numbers, texts, lists, objects of any names (``*``) or of these. None is a
number or null. More is left unread."""


def read(folder: RunFolder) -> dict[str, Any]:
    """What ``status.json`` holds; nothing if it does not exist.

    Raises:
        UserError: if it is not of the form that a training writes.
    """
    content = read_json(folder.status)
    if wrong := _unlike(content, FORM, ""):
        raise UserError(
            f"{folder.status}: {wrong}. It was changed or damaged; without the file a run can be used all the same, "
            "but for the times of its training"
        )
    return content


NEEDED = {
    "pretraining": ("folder", "task", "frames_per_seed", "training_seconds", "discounted_return", "length"),
    "last_session": ("frames_per_second_all_seeds",),
}
"""What is read of these wherever they are."""

UNKNOWN_YET = ("success_since_frames", "solved_after_frames")
"""What is null until an iteration of the training itself is over."""


def _unlike(content: Any, form: Any, where: str) -> str:
    """The first part of another form than the example, in words; '' for none."""
    if content is None and where in UNKNOWN_YET:
        return ""
    kind = next((words for words, own in KINDS if isinstance(form, own)), NUMBER_OR_NULL)
    fits = {
        "an object": isinstance(content, dict),
        "a list": isinstance(content, list),
        "a text": isinstance(content, str),
        "a number": _is_number(content),
        NUMBER_OR_NULL: content is None or _is_number(content),
    }[kind]
    if not fits:
        return f"{where or 'it'} should be {kind}, got {repr(content)[:40]}"
    if missing := [name for name in NEEDED.get(where, ()) if name not in content]:
        return f"{where} lacks {missing[0]}"
    if isinstance(form, dict):
        parts = [(name, value, form.get(name, form.get("*"))) for name, value in content.items()]
        parts = [(f"{where}.{name}".lstrip("."), value, of) for name, value, of in parts if name in form or "*" in form]
    else:
        parts = [(f"{where}[{k}]", value, form[0]) for k, value in enumerate(content)] if kind == "a list" else []
    return next((wrong for at, value, of in parts if (wrong := _unlike(value, of, at))), "")


NUMBER_OR_NULL = "a number or null"
KINDS = (("an object", dict), ("a list", list), ("a text", str), ("a number", float))


def _is_number(content: Any) -> bool:
    if isinstance(content, bool) or not isinstance(content, int | float):
        return False
    return abs(content) <= sys.float_info.max  # which no number that is too large for a float is, nor NaN


class StatusFile(Callback):
    """Writes the file with every checkpoint, and at the end."""

    def __init__(self, folder: RunFolder, progress: TrainingProgress) -> None:
        """Take up what the session before this one left: its times, and what is known of a pre-training."""
        self._folder = folder
        self._earlier = read(folder)
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
