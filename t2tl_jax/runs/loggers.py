"""Metrics on disk: a CSV file, and TensorBoard events."""

from collections.abc import Sequence
from pathlib import Path

import tensorboardX

from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.folder import writing
from t2tl_jax.runs.metrics_file import EPISODE_COLUMNS, MetricsFile


class CSVLogger(Callback):
    """Writes ``metrics.csv``: one row for each iteration and seed, named by their columns.

    A resumed run goes on behind the rows of its checkpoint, and drops later ones.
    """

    def __init__(self, file: Path) -> None:
        """Write to this file, which a new training replaces."""
        self._path = file
        self._file: MetricsFile | None = None

    def on_start(self, progress: TrainingProgress) -> None:
        """Open the file; MetricsFileError if it does not reach the checkpoint."""
        with writing(self._path):
            self._file = MetricsFile(self._path, progress.done)

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Append the rows."""
        assert self._file is not None
        with writing(self._path):
            self._file.append(rows)

    def on_checkpoint(self, progress: TrainingProgress) -> None:
        """Force the rows to the disk."""
        assert self._file is not None
        with writing(self._path):
            self._file.sync()

    def on_end(self, progress: TrainingProgress) -> None:
        """Close the file."""
        if self._file is not None:
            with writing(self._path):
                self._file.close()


class TensorBoardLogger(Callback):
    """Writes TensorBoard events, one folder for each seed: its metrics by iteration."""

    def __init__(self, folder: Path) -> None:
        """Write to ``folder/seed_N``."""
        self._folder = folder
        self._writers: list[tensorboardX.SummaryWriter] = []

    def on_start(self, progress: TrainingProgress) -> None:
        """Open the files; events after the checkpoint of a resumed run count as dropped."""
        purge = progress.done + 1 if progress.done else None
        self._writers = [
            tensorboardX.SummaryWriter(str(self._folder / f"seed_{seed}"), purge_step=purge) for seed in progress.seeds
        ]

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Write what is known."""
        for writer, row in zip(self._writers, rows, strict=True):
            for name, value in row.items():
                if value is not None and name not in ("iteration", "seed"):
                    group = "episodes" if name in EPISODE_COLUMNS else "training"
                    writer.add_scalar(f"{group}/{name}", value, progress.done)

    def on_checkpoint(self, progress: TrainingProgress) -> None:
        """Bring the events to the disk."""
        for writer in self._writers:
            writer.flush()

    def on_end(self, progress: TrainingProgress) -> None:
        """Close the files."""
        for writer in self._writers:
            writer.close()
