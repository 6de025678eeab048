"""DeepLTL's 50 tasks with a map each, for ZoneEnv and for LetterWorld; see fixed_set.md."""

import json
import re
from pathlib import Path

import numpy as np

from t2tl_jax.ltl import Formula, resolve_task

LINES = [json.loads(line) for line in Path(__file__).with_suffix(".jsonl").read_text().splitlines()]
ZONES = [line for line in LINES if line["env"] == "zones"]
LETTERS = [line for line in LINES if line["env"] == "letters"]

PLACED = ("green", "yellow", "blue", "magenta")
"""The colours in the order in which `OPEN` has its discs."""


def capitals(task: str) -> str:
    """The task with the colours as ZoneEnv writes them."""
    return re.sub(r"[a-z]{2,}", lambda colour: colour.group().capitalize(), task)


def formulas(which: str) -> list[Formula]:
    """The tasks of a list: zones or letters."""
    if which == "zones":
        return [resolve_task(capitals(line["task"])) for line in ZONES]
    return [resolve_task(line["task"]) for line in LETTERS]


def start(line: dict) -> np.ndarray:
    """Position and heading: ``float32[3]``."""
    return np.array([*line["robot"], line["heading"]], np.float32)


def discs(line: dict) -> np.ndarray:
    """Centres: ``float32[8, 2]``."""
    return np.concatenate([line["zones"][colour] for colour in PLACED]).astype(np.float32)
