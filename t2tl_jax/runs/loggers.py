"""The metrics of a training as a CSV file; `tensorboard.py` writes them as events."""

from collections.abc import Sequence
from pathlib import Path

from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.folder import writing
from t2tl_jax.runs.metrics_file import MetricsFile


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
            self._file = MetricsFile(self._path, progress.last_row)

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
