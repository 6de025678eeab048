"""A logger: one line of JSON for each iteration and seed."""

import json
from collections.abc import Sequence
from pathlib import Path

from t2tl_jax import Callback, Row, TrainingProgress


class JSONLines(Callback):
    """Writes every row of the metrics to a file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        with open(self._path, "a", encoding="utf-8") as file:
            file.writelines(json.dumps(dict(row)) + "\n" for row in rows)
