"""The metrics of a training in memory, as arrays by name."""

from collections.abc import Mapping, Sequence

import numpy as np

from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.rows import Rows


class History(Callback):
    """Keeps every metric of every iteration. NaN stands for an average over no episodes."""

    def __init__(self, earlier: Mapping[str, np.ndarray] | None = None) -> None:
        """Begin, or go on behind the iterations of `earlier`: by name, float[seeds, iterations]."""
        self._earlier = dict(earlier or {})
        self._columns: list[dict[str, np.ndarray]] = []

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Keep the rows."""
        assert isinstance(rows, Rows)  # as the training gives them
        columns = rows.columns
        self._columns.append({name: np.ma.filled(column.astype(float), np.nan) for name, column in columns.items()})

    def arrays(self) -> dict[str, np.ndarray]:
        """By name, float64[seeds, iterations]; ``frames`` counts the environment steps of each seed."""
        if not self._columns:
            return self._earlier
        names = [name for name in self._columns[0] if name not in ("iteration", "seed")]
        new = {name: np.stack([columns[name] for columns in self._columns], axis=1) for name in names}
        if not self._earlier:
            return new
        missing = np.full_like(next(iter(self._earlier.values())), np.nan)
        return {name: np.concatenate([self._earlier.get(name, missing), new[name]], axis=1) for name in new}
