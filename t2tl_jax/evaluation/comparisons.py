"""Differences between runs over their seeds: intervals that cover, tests, corrections, and what they say of a claim."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from t2tl_jax.evaluation.statistics import CONFIDENCE, Estimate, score_interval

RESAMPLES = 9999
"""Permutations, where there are more than that; with fewer all of them are tried."""

Outcome = Literal["reproduced", "not reproduced", "undecided"]


@dataclass(frozen=True)
class Difference:
    """How much more one run reaches than another."""

    gap: Estimate
    """Mean of the first less that of the second, with Welch's interval, or of the pairs' differences with Student's.
    No interval where equal values leave the spread unknown."""
    pvalue: float
    """Of a two-sided permutation test, which exchanges seeds between the runs, or the runs within each pair."""
    improvement: Estimate
    """Probability that a seed of the first is above one of the second, ties as one half; never without an interval."""
    paired: bool
    """Whether seed k of one run was compared with seed k of the other."""


def difference(
    first: Sequence[float] | np.ndarray,
    second: Sequence[float] | np.ndarray,
    paired: bool = False,
    confidence: float = CONFIDENCE,
) -> Difference:
    """Compare two runs.

    Args:
        first: ``float[n]`` with two values or more, one for each seed.
        second: ``float[m]``, likewise; in pairs ``m = n``, in the same order.
        paired: whether the values belong together, as where seed k has the same map in both runs.
        confidence: level of the interval of the gap.

    Raises:
        ValueError: for fewer than two values, or pairs of different number.
    """
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if min(a.size, b.size) < 2:
        raise ValueError(f"a test needs two seeds of each run or more, got {a.size} and {b.size}")
    if paired and a.size != b.size:
        raise ValueError(f"pairs need as many seeds in both runs, got {a.size} and {b.size}")

    def gap_of(x: np.ndarray, y: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.mean(x, axis=axis) - np.mean(y, axis=axis)

    test = stats.permutation_test(
        (a, b),
        gap_of,
        permutation_type="samples" if paired else "independent",
        vectorized=True,
        n_resamples=RESAMPLES,
        rng=np.random.default_rng(0),
    )
    return Difference(_gap(a, b, paired, confidence), float(test.pvalue), _improvement(a, b, paired), paired)


def _gap(a: np.ndarray, b: np.ndarray, paired: bool, confidence: float) -> Estimate:
    value, count = float(a.mean() - b.mean()), a.size if paired else a.size + b.size
    spread = np.ptp(a - b) if paired else np.ptp(a) + np.ptp(b)
    if spread == 0:
        return Estimate(value, None, None, count)
    test = stats.ttest_rel(a, b) if paired else stats.ttest_ind(a, b, equal_var=False)
    interval = test.confidence_interval(confidence)
    return Estimate(value, float(interval.low), float(interval.high), count)


def _improvement(a: np.ndarray, b: np.ndarray, paired: bool) -> Estimate:
    """Mann and Whitney's statistic as a share, with Wilson's interval.

    The share of n x m pairs varies at most as much as that of min(n, m) independent ones (Birnbaum and Klose, 1957),
    which makes the interval wide, and never empty where one run lies wholly above the other.
    """
    if paired:
        return score_interval(float(np.mean((np.sign(a - b) + 1) / 2)), a.size)
    share = float(stats.mannwhitneyu(a, b).statistic) / (a.size * b.size)
    return score_interval(share, min(a.size, b.size))


def holm(pvalues: Sequence[float] | np.ndarray) -> np.ndarray:
    """P-values corrected for their number (Holm, 1979): ``float[n]``, in the same order, at most 1."""
    p = np.asarray(pvalues, np.float64)
    order = np.argsort(p)
    stepped = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected


def outcome(gap: Estimate, margin: float = 0.0) -> Outcome:
    """What a difference says of the claim that the first run is better.

    Reproduced: the interval lies above 0. Not reproduced: it lies below 0, or between ``-margin`` and ``margin``, so
    that the runs are as good as equal. Undecided: all else, such as too few seeds.

    Args:
        gap: with an interval that is corrected for all claims made, as `compare` gives it.
        margin: the largest difference that nobody would call one.

    Raises:
        ValueError: for a negative margin.
    """
    if not margin >= 0:
        raise ValueError(f"a margin of equivalence is 0 or more, got {margin}")
    if gap.low is None or gap.high is None:
        return "undecided"
    if gap.low > 0:
        return "reproduced"
    within = -margin < gap.low and gap.high < margin
    return "not reproduced" if gap.high < 0 or within else "undecided"


Seeds = Mapping[int, float]
"""What each seed of a run reached, by its number."""


Pairs = Sequence[tuple[str, str]]
"""Names of two runs each; of a claim, the first is said to be the better one."""


def compare(
    runs: Mapping[str, Seeds], same_worlds: Mapping[str, object], planned: Pairs | None = None
) -> dict[tuple[str, str], Difference]:
    """Runs against each other, corrected for the number of comparisons: Bonferroni's intervals and Holm's p-values.

    Where seed k stands for the same world in two runs, they are compared in pairs, on the seeds that both have.

    Args:
        runs: by name, in the order that is claimed: the first one the best.
        same_worlds: by run, the worlds that its seeds stand for (any value that can be compared); None where a seed is
            nothing but a random number.
        planned: which to compare, by default every two. All of these are corrected for, also those that cannot be
            compared yet, so that an outcome does not change when others come in.

    Returns:
        By names, in the order of `runs` or `planned`. Pairs with fewer than two seeds on a side are left out; without
        `planned` they are not counted either.
    """
    wanted = list(itertools.combinations(runs, 2)) if planned is None else list(planned)
    known = [names for names in wanted if all(len(runs.get(name, ())) > 1 for name in names)]
    count = len(known) if planned is None else len(wanted)
    level = 1 - (1 - CONFIDENCE) / max(count, 1)
    found = {}
    for first, second in known:
        a, b = runs[first], runs[second]
        world = same_worlds.get(first)
        both = [seed for seed in a if seed in b]
        paired = world is not None and world == same_worlds.get(second) and len(both) > 1
        if paired:
            a, b = ({seed: each[seed] for seed in both} for each in (a, b))
        found[first, second] = difference(list(a.values()), list(b.values()), paired, level)
    missing = [1.0] * (count - len(known))  # p = 1 of them is the strictest for those that are known
    corrected = holm([*(each.pvalue for each in found.values()), *missing])[: len(known)]
    return {names: replace(each, pvalue=float(p)) for (names, each), p in zip(found.items(), corrected, strict=True)}
