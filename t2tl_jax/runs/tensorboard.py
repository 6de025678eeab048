"""TensorBoard events of a training, written by one hand: no thread, and no more files with more seeds."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tensorboardX.event_file_writer import EventsWriter
from tensorboardX.proto.event_pb2 import Event, SessionLog
from tensorboardX.proto.summary_pb2 import Summary

from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.folder import writing
from t2tl_jax.runs.metrics_file import EPISODE_COLUMNS
from t2tl_jax.runs.rows import Rows

APART = 20
"""Up to so many seeds have a folder each. Of more there are their mean, the lowest and the highest one of each metric;
``metrics.csv`` has every seed."""

OVER_SEEDS: dict[str, Callable[..., Any]] = {"mean": np.mean, "lowest": np.min, "highest": np.max}
"""What there is of many seeds, by the name of its folder."""


class TensorBoardLogger(Callback):
    """Writes ``folder/seed_N``, or for many seeds ``folder/mean`` and so on: metrics by iteration."""

    def __init__(self, folder: Path) -> None:
        """Write to this folder."""
        self._folder = folder
        self._writers: list[EventsWriter] = []

    def on_start(self, progress: TrainingProgress) -> None:
        """Open the files; events after the checkpoint of a resumed run count as dropped."""
        many = len(progress.seeds) > APART
        names = list(OVER_SEEDS) if many else [f"seed_{seed}" for seed in progress.seeds]
        with writing(self._folder):
            for name in names:
                (self._folder / name).mkdir(parents=True, exist_ok=True)
                # Sorted by the iteration that a session began with, whatever the clock says, and never the same twice.
                prefix = self._folder / name / f"events.{progress.done:012}"
                self._writers.append(EventsWriter(str(prefix), f".{os.getpid()}"))
            if progress.done:
                start = Event(step=progress.done + 1, session_log=SessionLog(status=SessionLog.START))
                for writer in self._writers:
                    writer.write_event(start)

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Write what is known."""
        shown: Sequence[Mapping[str, float | int | None]] = rows if len(rows) <= APART else _over_seeds(rows)
        now = time.time()
        with writing(self._folder):
            for writer, row in zip(self._writers, shown, strict=True):
                known = [
                    Summary.Value(
                        tag=f"{'episodes' if name in EPISODE_COLUMNS else 'training'}/{name}", simple_value=value
                    )
                    for name, value in row.items()
                    if value is not None and name not in ("iteration", "seed")
                ]
                writer.write_event(Event(wall_time=now, step=progress.done, summary=Summary(value=known)))

    def on_checkpoint(self, progress: TrainingProgress) -> None:
        """Bring the events to the disk."""
        with writing(self._folder):
            for writer in self._writers:
                writer.flush()

    def on_end(self, progress: TrainingProgress) -> None:
        """Close the files."""
        with writing(self._folder):
            for writer in self._writers:
                writer.close()


def _tag(name: str) -> str:
    return f"{'episodes' if name in EPISODE_COLUMNS else 'training'}/{name}"


def _over_seeds(rows: Sequence[Row]) -> list[dict[str, float]]:
    """What `OVER_SEEDS` names, in its order, of the seeds that have a value."""
    assert isinstance(rows, Rows)
    known = {name: np.ma.compressed(column) for name, column in rows.columns.items()}
    return [{name: float(of(values)) for name, values in known.items() if values.size} for of in OVER_SEEDS.values()]
