"""What ``status.json`` of a run may hold, and reading it: a file that was changed is refused with the place."""

import sys
from collections.abc import Callable
from typing import Any

from t2tl_jax.errors import UserError
from t2tl_jax.runs import faults
from t2tl_jax.runs.folder import RunFolder, read_json

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
    kind, fits = next((kind, fits) for example, kind, fits in KINDS if isinstance(form, example))
    if not fits(content):
        return f"{where or 'it'} should be {kind}, got {repr(content)[:40]}"
    if missing := [name for name in NEEDED.get(where, ()) if name not in content]:
        return f"{where} lacks {missing[0]}"
    if isinstance(form, dict):
        parts = [(name, value, form.get(name, form.get("*"))) for name, value in content.items()]
        parts = [(f"{where}.{name}".lstrip("."), value, of) for name, value, of in parts if name in form or "*" in form]
    elif isinstance(form, list):
        parts = [(f"{where}[{k}]", value, form[0]) for k, value in enumerate(content)]
    else:
        return ""
    return next((wrong for at, value, of in parts if (wrong := _unlike(value, of, at))), "")


def _is_number(content: Any) -> bool:
    if isinstance(content, bool) or not isinstance(content, int | float):
        return False
    return abs(content) <= sys.float_info.max  # which no number that is too large for a float is, nor NaN


KINDS: tuple[tuple[type, str, Callable[[Any], bool]], ...] = (
    (dict, "an object", lambda content: isinstance(content, dict)),
    (list, "a list", lambda content: isinstance(content, list)),
    (str, "a text", lambda content: isinstance(content, str)),
    (float, "a number", _is_number),
    (type(None), "a number or null", lambda content: content is None or _is_number(content)),
)
"""By the type of an example, what has to stand there, in words and as a test."""
