"""How many iterations a row of ``metrics.csv`` stands for: one, unless the file would grow beyond a million rows.

Where it would, it is 2, 4, 8, ...: as few as keep the file below that. Episodes of these iterations add up, their
averages are over all of them, and scalars such as losses are means. Whoever watches the training sees each iteration.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from t2tl_jax.runs.rows import Rows, make_rows
from t2tl_jax.training.types import EpisodeTotals, Metrics

MOST_ROWS = 1_000_000
"""Of a file, all seeds together: some hundred MB."""


def stride(iterations: int, seeds: int) -> int:
    """Iterations of a row, a power of two."""
    step = 1
    while -(-iterations // step) * seeds > MOST_ROWS and step < iterations:
        step *= 2
    return step


class Thinning:
    """Adds iterations up to rows. A checkpoint in the middle of a row holds its sums (`info`)."""

    def __init__(self, iterations: int, seeds: Sequence[int], stored: Mapping[str, Any] | None = None) -> None:
        """Begin, or go on with what `info` gave. A run that is made longer may go on with fewer rows, not with more."""
        stored = stored or {}
        self.stride = max(stride(iterations, len(seeds)), stored.get("stride", 1))
        self.last: int = stored.get("last", 0)
        """The iteration of the last row; 0 before the first one."""
        self._seeds = tuple(seeds)
        self._count: int = stored.get("count", 0)
        self._sums = {name: np.array(values, np.float64) for name, values in stored.get("sums", {}).items()}

    def add(
        self, rows: Rows, iteration: int, frames: int, metrics: Metrics, more: Mapping[str, np.ndarray]
    ) -> Rows | None:
        """Take in an iteration; the row that it completes, if it does.

        Args:
            rows: the iteration by itself.
            iteration, frames, metrics, more: what `make_rows` made it of.
        """
        if self.stride == 1:
            self.last = iteration
            return rows
        given = {f"episodes/{of.name}": getattr(metrics.episodes, of.name) for of in fields(metrics.episodes)}
        given |= {f"scalars/{name}": values for name, values in metrics.scalars.items()}
        given |= {f"more/{name}": values for name, values in more.items()}
        for name, values in given.items():
            self._sums[name] = self._sums.get(name, 0.0) + np.asarray(values, np.float64)
        self._count += 1
        return self.flush(iteration, frames) if iteration % self.stride == 0 else None

    def flush(self, iteration: int, frames: int) -> Rows | None:
        """A row of what has come in since the last one; None if nothing has."""
        if not self._count:
            return None
        parts: dict[str, dict[str, np.ndarray]] = {"episodes": {}, "scalars": {}, "more": {}}
        for name, total in self._sums.items():
            part, own = name.split("/", 1)
            parts[part][own] = total if part == "episodes" else total / self._count
        metrics = Metrics(EpisodeTotals(**parts["episodes"]), parts["scalars"])  # type: ignore[arg-type]
        self._count, self._sums, self.last = 0, {}, iteration
        return make_rows(metrics, iteration, frames, self._seeds, parts["more"])

    def info(self) -> dict[str, Any]:
        """For a checkpoint; JSON gives floats back exactly."""
        sums = {name: values.tolist() for name, values in self._sums.items()}
        return {"stride": self.stride, "last": self.last, "count": self._count, "sums": sums}
