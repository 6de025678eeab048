"""Where metrics go while a run trains: ``metrics.csv`` and TensorBoard events, one event file per seed."""

from collections.abc import Sequence
from pathlib import Path

import tensorboardX

from t2tl_jax.training.types import Metrics
from t2tl_jax.runs import metrics_file


class Recorder:
    """Writes the metrics of each iteration to every sink of a run folder."""

    def __init__(self, folder: Path, seeds: Sequence[int], after: int = 0) -> None:
        """Open the sinks of a new run, or those of a resumed one.

        Args:
            folder: of the run.
            seeds: their numbers, in the order of the seed axis.
            after: the iteration of the checkpoint that is resumed; later records are dropped.

        Raises:
            MetricsFileError: if the metrics file does not reach the checkpoint.
        """
        self._seeds = tuple(seeds)
        self._csv = metrics_file.MetricsFile(folder / "metrics.csv", after)
        self._events = [
            tensorboardX.SummaryWriter(
                str(folder / "tensorboard" / f"seed_{seed}"), purge_step=after + 1 if after else None
            )
            for seed in self._seeds
        ]

    def record(self, metrics: Metrics, iteration: int, frames: int) -> list[dict[str, float | int | None]]:
        """Write one iteration (``metrics`` on the host, with leading axis [seeds]) and return its rows."""
        rows = metrics_file.rows(metrics, iteration, frames, self._seeds)
        self._csv.append(rows)
        for events, row in zip(self._events, rows, strict=True):
            for name, value in row.items():
                if value is not None and name not in ("iteration", "seed"):
                    group = "episodes" if name in metrics_file.EPISODE_COLUMNS else "training"
                    events.add_scalar(f"{group}/{name}", value, iteration)
        return rows

    def sync(self) -> None:
        """Bring everything recorded so far to the disk."""
        self._csv.sync()
        for events in self._events:
            events.flush()

    def close(self) -> None:
        """Close the sinks."""
        self._csv.close()
        for events in self._events:
            events.close()
