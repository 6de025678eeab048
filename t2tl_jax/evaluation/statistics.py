"""Estimates with 95 % intervals, for runs, evaluations and plots alike. NumPy and SciPy on the host."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # whose parts it loads when they are first asked for: stats takes half a second

CONFIDENCE = 0.95
"""Level of every interval of this project."""

SOLVED = 0.95
"""A seed has solved its task when more than this share of the evaluation episodes of its final parameters succeed."""


@dataclass(frozen=True)
class Estimate:
    """A value with its interval; each part is None where the data do not determine it."""

    value: float | None
    """The rate or mean; None without data."""
    low: float | None
    """Lower end of the 95 % interval; None with fewer than two data points or equal ones (rates need one)."""
    high: float | None
    """Upper end of the interval."""
    count: int
    """How many data points (episodes, successes or seeds) the estimate rests on."""

    def text(self, digits: int = 3) -> str:
        """For a table: ``0.912 [0.871, 0.942]``, with a dash for what is unknown.

        An interval that so few digits would show as empty gets more of them, up to `MORE_DIGITS`.
        """
        if self.value is None:
            return "-"
        if self.low is None or self.high is None:
            return _fixed(self.value, digits)
        digits = _digits_between(self.low, self.high, digits)
        return f"{_fixed(self.value, digits)} {brackets(self.low, self.high, digits)}"


MORE_DIGITS = 8
"""Digits of a narrow interval at most."""


ROUNDING = 1e-12
"""What values that are equal may differ by, of their size."""


def brackets(low: float, high: float, digits: int = 3) -> str:
    """An interval for a table: ``[0.871, 0.942]``, with more digits where so few would show it as empty."""
    digits = _digits_between(low, high, digits)
    return f"[{_fixed(low, digits)}, {_fixed(high, digits)}]"


def _digits_between(low: float, high: float, digits: int) -> int:
    """As many digits as tell both ends apart."""
    while low < high and _fixed(low, digits) == _fixed(high, digits) and digits < MORE_DIGITS:
        digits += 1
    return digits


def _fixed(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:.{digits}f}"  # no minus before a zero


def rate(hits: int, count: int) -> Estimate:
    """A proportion with Wilson's interval.

    Raises:
        ValueError: unless ``0 <= hits <= count``.
    """
    if not 0 <= hits <= count:
        raise ValueError(f"a rate needs 0 <= hits <= count, got {hits} of {count}")
    if count == 0:
        return Estimate(None, None, None, 0)
    return score_interval(hits / count, count)


def mean(
    values: Sequence[float] | np.ndarray, lowest: float = float("-inf"), highest: float = float("inf")
) -> Estimate:
    """A mean with Student's t interval, cut to the range that the quantity can take.

    Equal values say nothing about their spread, and then there is no interval. For rates see `mean_rate`.

    Args:
        values: ``float[n]``; must be finite.
        lowest: smallest possible value, for instance 0 for a length.
        highest: largest possible value.
    """
    data = np.asarray(values, np.float64)
    if data.size == 0:
        return Estimate(None, None, None, 0)
    if np.ptp(data) == 0:  # whose mean may differ from each by rounding
        return Estimate(float(data[0]), None, None, int(data.size))
    centre, half = float(data.mean()), float(_half_width(data))
    if half <= ROUNDING * abs(centre):
        return Estimate(centre, None, None, int(data.size))
    return Estimate(centre, max(centre - half, lowest), min(centre + half, highest), int(data.size))


def mean_rate(rates: Sequence[float] | np.ndarray) -> Estimate:
    """The mean of rates between 0 and 1, one for each seed, with an interval for the seeds that there could have been.

    Wilson's interval with one trial a seed: of all values in [0, 1] with the same mean, zeros and ones vary most. It is
    wide where the seeds agree, and never empty: twelve seeds without a failure do not rule out one in five.

    Args:
        rates: ``float[n]`` in [0, 1].

    Raises:
        ValueError: for values outside [0, 1].
    """
    data = np.asarray(rates, np.float64)
    if data.size == 0:
        return Estimate(None, None, None, 0)
    if not ((data >= 0) & (data <= 1)).all():
        raise ValueError(f"rates lie between 0 and 1, got {data.min():g} to {data.max():g}")
    centre = float(data.mean())
    return score_interval(centre, int(data.size)) if data.size > 1 else Estimate(centre, None, None, 1)


def score_interval(share: float, count: int, confidence: float = CONFIDENCE) -> Estimate:
    """Wilson's interval, where ``share * count`` need not be whole (scipy's takes whole numbers of successes)."""
    squared = float(scipy.stats.norm.ppf(0.5 + confidence / 2)) ** 2 / count
    centre = (share + squared / 2) / (1 + squared)
    half = np.sqrt(squared * (share * (1 - share) + squared / 4)) / (1 + squared)
    # Rounding must not leave the share outside.
    low, high = min(max(centre - half, 0.0), share), max(min(centre + half, 1.0), share)
    return Estimate(share, float(low), float(high), count)


def exact_rate(hits: int, count: int, intervals: int = 1) -> Estimate:
    """A proportion with the exact binomial interval of Clopper and Pearson (1934), which never covers too rarely.

    Args:
        hits: how many of `count` independent trials.
        count: at least 1.
        intervals: how many are claimed together; each gets its share of the 5 % (Bonferroni), so that all of them hold
            at once with 95 %.

    Raises:
        ValueError: unless ``0 <= hits <= count``, with both of `count` and `intervals` at least 1.
    """
    if not 0 <= hits <= count or count < 1 or intervals < 1:
        raise ValueError(f"an exact rate needs 0 <= hits <= count, got {hits} of {count} in {intervals} intervals")
    level = 1 - (1 - CONFIDENCE) / intervals
    found = scipy.stats.binomtest(hits, count).proportion_ci(level, method="exact")
    return Estimate(hits / count, float(found.low), float(found.high), count)


def two_way_mean(values: np.ndarray, lowest: float = float("-inf"), highest: float = float("inf")) -> Estimate:
    """The mean over seeds and formulas, both of them samples: for other seeds and for other formulas of the kind.

    The variance is that of clustering by seeds plus that of clustering by formulas (Cameron, Gelbach and Miller, 2011,
    *Robust inference with multiway clustering*, J. Business & Economic Statistics 29). Their third term, which is
    subtracted, is left out: the sum stays positive and errs on the wide side. Student's t with one less degree of
    freedom than there are of the rarer of both.

    Args:
        values: ``float[seeds, formulas]``; NaN where there is none.
        lowest: smallest possible value.
        highest: largest possible value.

    Returns:
        Without an interval where there are fewer than two seeds or two formulas, or where the means of seeds are all
        equal and those of formulas too.
    """
    values = np.asarray(values, np.float64)
    known = np.isfinite(values)
    count = int(known.sum())
    if count == 0:
        return Estimate(None, None, None, 0)
    centre = float(values[known].mean())
    levels = [int(known.any(axis=1 - axis).sum()) for axis in (0, 1)]
    if min(levels) < 2:
        return Estimate(centre, None, None, count)
    rest = np.where(known, values - centre, 0.0)
    clusters = (rest.sum(axis=1 - axis) for axis in (0, 1))
    variance = sum(n / (n - 1) * float((sums**2).sum()) / count**2 for n, sums in zip(levels, clusters, strict=True))
    half = float(scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, min(levels) - 1) * np.sqrt(variance))
    if half <= ROUNDING * abs(centre):
        return Estimate(centre, None, None, count)
    return Estimate(centre, max(centre - half, lowest), min(centre + half, highest), count)


def interquartile_mean(values: Sequence[float] | np.ndarray, seed: int = 0) -> Estimate:
    """The mean of the middle half of the seeds, with a bootstrap interval (bias-corrected and accelerated, BCa).

    It is what rliable reports; scipy computes it too, and rliable would bring arch, pandas and seaborn. With a dozen
    seeds the interval covers somewhat less than it says; tests and orderings rest on means instead. There is none for
    fewer than four seeds, or where the middle half is equal.

    Args:
        values: ``float[n]``, one for each seed; must be finite.
        seed: of the resampling.
    """
    data = np.asarray(values, np.float64)
    if data.size == 0:
        return Estimate(None, None, None, 0)

    def middle(x: np.ndarray, axis: int = -1) -> np.ndarray:
        return scipy.stats.trim_mean(x, 0.25, axis=axis)

    centre, ordered = float(middle(data)), np.sort(data)
    cut = data.size // 4
    if data.size < 4 or np.ptp(ordered[cut : data.size - cut]) == 0:
        return Estimate(centre, None, None, int(data.size))
    drawn = scipy.stats.bootstrap((data,), middle, confidence_level=CONFIDENCE, rng=np.random.default_rng(seed))
    interval = drawn.confidence_interval
    return Estimate(centre, float(interval.low), float(interval.high), int(data.size))


def band(values: np.ndarray, shares: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean over seeds and its t interval, or of shares that of `mean_rate`, at every point of a curve.

    Points that a seed lacks (NaN) are left out; a point that no seed has is NaN in all three results.

    Args:
        values: ``float[seeds, points]``.
        shares: whether they are shares between 0 and 1; a rounding beyond that is taken back.

    Returns:
        ``(mean, low, high)``, each ``float[points]``. Where there is a single seed, all three are its value.

    Raises:
        ValueError: for shares outside [0, 1].
    """
    values = np.asarray(values, np.float64)
    centre, low, high = np.full((3, values.shape[1]), np.nan)
    for point, column in enumerate(values.T):
        known = column[np.isfinite(column)]
        if not known.size:
            continue
        found = mean_rate(known.round(6)) if shares else mean(known)
        centre[point] = known.mean()
        low[point] = centre[point] if found.low is None else found.low
        high[point] = centre[point] if found.high is None else found.high
    return centre, low, high


def _half_width(data: np.ndarray) -> float:
    """Of Student's t interval of the mean of two values or more."""
    return float(scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, data.size - 1) * scipy.stats.sem(data))
