"""Between which values the normalised score of a task lies that was stored without its scores.

An episode scores its reward over its length. Of an iteration only means are stored: of the reward, which is 0 or 1, of
the length, and of the discounted return. By Jensen's inequality these leave little room.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.statistics import Estimate, brackets

LIMIT = 600
"""Steps after which an episode ends unpaid."""


def bounds(metrics: Mapping[str, np.ndarray], fewest: Sequence[int], discount: float) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest mean normalised score of the episodes of each iteration, ``float[seeds, iterations]``.

    Args:
        metrics: by name, ``float[seeds, iterations]``. What is carried out is paid; other endings may be, too.
        fewest: by seed, the steps of the episode whose score counts as 1. For the greatest score no paid episode is
            taken to be shorter.
        discount: of the discounted return.
    """
    paid, length, carried, own, discounted = (
        np.nan_to_num(metrics[name])
        for name in ("total_reward", "length", "success_rate", "success_length", "discounted_return")
    )
    # What is paid for something else takes at most the steps that are left, if what is unpaid takes one each.
    other = np.maximum(paid - carried, 0.0)
    left = np.maximum(length - carried * own - (1.0 - paid), other)
    least = _over(carried, own) + _over(other**2, left)
    greatest = np.zeros_like(least)
    for seed, steps in enumerate(fewest):
        lengths = np.arange(LIMIT, steps - 1, -1)
        at, score = _hull(discount ** (lengths - 1.0), 1.0 / lengths)
        greatest[seed] = paid[seed] * np.interp(_over(discounted[seed], paid[seed]), at, score)
    times = np.asarray(fewest, float)[:, None]
    return least * times, np.maximum(greatest, least) * times  # equal but for rounding where all episodes are alike


def _over(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Their quotient, 0 where the second is."""
    return np.divide(first, second, out=np.zeros_like(first), where=second > 0)


def _hull(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points of the least concave function over these, whose x rise: of long episodes all, of short ones some."""
    kept: list[int] = []
    for k in range(len(x)):
        while len(kept) > 1 and _below(x, y, kept[-2], kept[-1], k):
            kept.pop()
        kept.append(k)
    return x[kept], y[kept]


def _below(x: np.ndarray, y: np.ndarray, a: int, b: int, c: int) -> bool:
    """Whether point b is on or below the line from a to c."""
    return bool((y[b] - y[a]) * (x[c] - x[a]) <= (y[c] - y[a]) * (x[b] - x[a]))


def cell(least: np.ndarray, greatest: np.ndarray) -> str:
    """Both means over seeds, and an interval that holds those of both; a dash where nothing is known."""
    of: list[Estimate] = [statistics.mean(values[np.isfinite(values)], 0.0, 1.0) for values in (least, greatest)]
    low, high = of
    if low.value is None or high.value is None:
        return "-"
    between = f"{low.value:.2f} to {high.value:.2f}"
    return between if low.low is None or high.high is None else f"{between} {brackets(low.low, high.high, 2)}"
