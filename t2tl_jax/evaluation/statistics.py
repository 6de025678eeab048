"""Estimates with 95 % intervals, for runs, evaluations and plots alike. NumPy and SciPy on the host."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

CONFIDENCE = 0.95
"""Level of every interval of this project."""

SOLVED = 0.95
"""A seed solves its task when its success rate is above this."""

RESAMPLES = 2000
"""Bootstrap resamples; the end points then move by about 1 % of the width between random streams."""


@dataclass(frozen=True)
class Estimate:
    """A value with its interval; each part is None where the data do not determine it."""

    value: float | None
    """The rate or mean; None without data."""
    low: float | None
    """Lower end of the 95 % interval; None with fewer than two data points (rates need one)."""
    high: float | None
    """Upper end of the interval."""
    count: int
    """How many data points (episodes, successes or seeds) the estimate rests on."""

    def text(self, digits: int = 3) -> str:
        """For a table: ``0.912 [0.871, 0.942]``, with a dash for what is unknown."""
        if self.value is None:
            return "-"
        if self.low is None or self.high is None:
            return f"{self.value:.{digits}f}"
        return f"{self.value:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


def rate(hits: int, count: int) -> Estimate:
    """A proportion with Wilson's interval.

    Raises:
        ValueError: unless ``0 <= hits <= count``.
    """
    if not 0 <= hits <= count:
        raise ValueError(f"a rate needs 0 <= hits <= count, got {hits} of {count}")
    if count == 0:
        return Estimate(None, None, None, 0)
    interval = stats.binomtest(hits, count).proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(hits / count, float(interval.low), float(interval.high), count)


def mean(
    values: Sequence[float] | np.ndarray, lowest: float = float("-inf"), highest: float = float("inf")
) -> Estimate:
    """A mean with Student's t interval, cut to the range that the quantity can take.

    Args:
        values: ``float[n]``; must be finite.
        lowest: smallest possible value, for instance 0 for a rate.
        highest: largest possible value.
    """
    data = np.asarray(values, np.float64)
    if data.size == 0:
        return Estimate(None, None, None, 0)
    centre = float(data.mean())
    if data.size == 1:
        return Estimate(centre, None, None, 1)
    half = float(stats.t.ppf(0.5 + CONFIDENCE / 2, data.size - 1) * stats.sem(data))
    return Estimate(centre, max(centre - half, lowest), min(centre + half, highest), int(data.size))


def difference(
    first: Sequence[float] | np.ndarray, second: Sequence[float] | np.ndarray, seed: int = 0
) -> tuple[Estimate, float]:
    """How much larger the mean of `first` is, with a bootstrap interval, and the p-value of a permutation test.

    The samples are independent; nothing is assumed of their distributions, since a seed that fails lies far from those
    that do not.

    Args:
        first: ``float[n]`` with two values or more, one for each seed.
        second: ``float[m]``, likewise.
        seed: of the resampling.

    Raises:
        ValueError: for fewer than two values.
    """
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if min(a.size, b.size) < 2:
        raise ValueError(f"a test needs two seeds of each run or more, got {a.size} and {b.size}")

    def gap(x: np.ndarray, y: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.mean(x, axis=axis) - np.mean(y, axis=axis)

    rng = np.random.default_rng(seed)
    drawn_a, drawn_b = (x[rng.integers(0, x.size, (5 * RESAMPLES, x.size))] for x in (a, b))
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(gap(drawn_a, drawn_b), (tail, 1 - tail))
    test = stats.permutation_test((a, b), gap, vectorized=True, n_resamples=5 * RESAMPLES - 1, rng=rng)
    return Estimate(float(gap(a, b)), float(low), float(high), a.size + b.size), float(test.pvalue)


def bootstrap_band(values: np.ndarray, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean over seeds and its percentile bootstrap interval, at every point of a curve.

    Whole seeds are drawn with replacement, so that the dependence along a curve is kept. Points that a seed lacks (NaN)
    are left out of the means; a point that no seed has is NaN in all three results.

    Args:
        values: ``float[seeds, points]``.
        seed: of the resampling; fixed, so that a plot can be drawn again.

    Returns:
        ``(mean, low, high)``, each ``float[points]``. The interval of a single seed is its own curve.
    """
    values = np.asarray(values, np.float64)
    present = np.isfinite(values)
    filled = np.where(present, values, 0.0)
    # How often each seed is drawn in each resample: two small matrix products give all resampled means.
    seeds = len(values)
    draws = np.random.default_rng(seed).multinomial(seeds, np.full(seeds, 1 / seeds), size=RESAMPLES).astype(np.float64)
    resampled = _divide(draws @ filled, draws @ present)
    centre = _divide(filled.sum(0), present.sum(0))
    tail = (1 - CONFIDENCE) / 2
    low, high = np.full_like(centre, np.nan), np.full_like(centre, np.nan)
    known = present.any(0)
    if known.any():
        low[known], high[known] = np.nanquantile(resampled[:, known], (tail, 1 - tail), axis=0)
    return centre, low, high


def _divide(total: np.ndarray, count: np.ndarray) -> np.ndarray:
    """``total / count``, NaN where nothing was counted."""
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
