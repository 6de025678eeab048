"""One iteration of all seeds: as a row for each seed, and as a column for each metric, which a thousand seeds need."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, overload

import numpy as np

from t2tl_jax.training.types import EpisodeTotals, Metrics

Row = Mapping[str, float | int | None]
"""One iteration of one seed by name, as in ``metrics.csv``; None for an average over no episodes."""


class Rows(Sequence[Row]):
    """The rows of an iteration, in the order of the seeds. An average over no episodes is None."""

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        """Of columns by name, each int64 or float64[seeds]; where one is masked, the row has None."""
        self.columns = columns

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @overload
    def __getitem__(self, index: int) -> Row: ...

    @overload
    def __getitem__(self, index: slice) -> list[Row]: ...

    def __getitem__(self, index: int | slice) -> Row | list[Row]:
        return self._rows[index]

    @cached_property
    def cells(self) -> dict[str, list[float | int | None]]:
        """The columns as lists."""
        return {name: values.tolist() for name, values in self.columns.items()}

    @cached_property
    def _rows(self) -> list[Row]:
        return [dict(zip(self.cells, row, strict=True)) for row in zip(*self.cells.values(), strict=True)]


def column(rows: Sequence[Row], name: str) -> np.ndarray:
    """One metric of all seeds, float64[seeds]: NaN where a row has None, 0 where it has no such metric."""
    if isinstance(rows, Rows):
        values = rows.columns.get(name)
        return np.zeros(len(rows)) if values is None else np.ma.filled(values.astype(np.float64), np.nan)
    return np.array([np.nan if row.get(name, 0.0) is None else row.get(name, 0.0) for row in rows], np.float64)


def make_rows(
    metrics: Metrics,
    iteration: int,
    frames: int,
    seeds: Sequence[int],
    more: Mapping[str, np.ndarray] | None = None,
) -> Rows:
    """Averages over the episodes that finished in this iteration, then the learner's scalars.

    Args:
        metrics: on the host, every array with a leading axis [seeds].
        iteration: counted from 1.
        frames: environment steps so far, of each seed.
        seeds: their numbers.
        more: other columns, float[seeds].
    """
    count = len(seeds)
    return Rows(
        {
            "iteration": np.full(count, iteration),
            "frames": np.full(count, frames),
            "seed": np.array(seeds, np.int64),
            **_averages(metrics.episodes),
            **{name: np.asarray(values, np.float64) for name, values in sorted(metrics.scalars.items())},
            **{name: np.asarray(values, np.float64) for name, values in (more or {}).items()},
        }
    )


def _averages(totals: EpisodeTotals) -> dict[str, Any]:
    episodes, successes = (np.asarray(of, np.int64) for of in (totals.episodes, totals.successes))

    def over(count: np.ndarray, total: Any) -> np.ma.MaskedArray:
        none = count == 0
        return np.ma.masked_array(np.asarray(total, np.float64) / np.where(none, 1, count), none)

    return {
        "episodes": episodes,
        "success_rate": over(episodes, totals.successes),
        "violation_rate": over(episodes, totals.violations),
        "timeout_rate": over(episodes, totals.timeouts),
        "env_termination_rate": over(episodes, totals.env_terminations),
        "discounted_return": over(episodes, totals.discounted_return),
        "total_reward": over(episodes, totals.total_reward),
        "length": over(episodes, totals.length),
        "success_length": over(successes, totals.success_length),
    }
