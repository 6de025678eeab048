"""DeepLTL's 50 tasks with a map each, for ZoneEnv and for LetterWorld; see zeroshot_eval.md."""

import json
import re
from pathlib import Path

import numpy as np

LINES = [json.loads(line) for line in Path(__file__).with_name("zeroshot_eval.jsonl").read_text().splitlines()]
ZONES = [line for line in LINES if line["env"] == "zones"]
LETTERS = [line for line in LINES if line["env"] == "letters"]

PLACED = ("green", "yellow", "blue", "magenta")
"""The colours in the order in which `OPEN` has its discs."""


def capitals(task: str) -> str:
    """The task with the colours as ZoneEnv writes them."""
    return re.sub(r"[a-z]{2,}", lambda colour: colour.group().capitalize(), task)


def start(line: dict) -> np.ndarray:
    """Position and heading: ``float32[3]``."""
    return np.array([*line["robot"], line["heading"]], np.float32)


def discs(line: dict) -> np.ndarray:
    """Centres: ``float32[8, 2]``."""
    return np.concatenate([line["zones"][colour] for colour in PLACED]).astype(np.float32)
