"""When training has converged: the return no longer improves. Decided on the host, from the recorded metrics alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from t2tl_jax import checks


@dataclass(frozen=True)
class ConvergenceConfig:
    """Stop early when the mean discounted return of the last iterations no longer exceeds that of those before.

    A run with several seeds stops when each of them has been at that point, now or earlier.
    """

    window: int = 0
    """Iterations in each of the two means; 0 never stops early."""
    delta: float = 0.002
    """Improvements up to this much count as none. A return of 0 or less is never the end."""

    def __post_init__(self) -> None:
        checks.counts(self, "window", least=0)
        checks.not_negative(self, "delta")


class Convergence:
    """The test of `ConvergenceConfig`, iteration by iteration."""

    def __init__(self, config: ConvergenceConfig, seeds: int, returns: np.ndarray | None = None) -> None:
        """Begin, or take up again after the iterations whose `returns` are given: float[seeds, iterations] or None."""
        self._config = config
        self._returns: list[np.ndarray] = []
        self._done = np.zeros(seeds, bool)
        for column in () if returns is None else returns.T:
            self._add(column)

    def add(self, rows: Sequence[Mapping[str, float | int | None]]) -> None:
        """Take in one iteration: a row of ``metrics.csv`` for every seed."""
        values = [row["discounted_return"] for row in rows]
        self._add(np.array([np.nan if value is None else value for value in values], np.float64))

    @property
    def reached(self) -> bool:
        """Whether training may stop."""
        return bool(self._done.all())

    def _add(self, returns: np.ndarray) -> None:
        window = self._config.window
        self._returns = [*self._returns, returns][-2 * window :] if window else []
        if window and len(self._returns) == 2 * window:
            before, after = (_mean(np.array(part)) for part in (self._returns[:window], self._returns[window:]))
            self._done |= (after > 0) & (after - before <= self._config.delta)  # NaN compares as False


def _mean(values: np.ndarray) -> np.ndarray:
    """Mean over the first axis of what is not NaN; NaN where there is nothing."""
    known = np.isfinite(values)
    return np.where(known, values, 0.0).sum(0) / np.where(known.any(0), known.sum(0), np.nan)
