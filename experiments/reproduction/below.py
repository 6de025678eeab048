"""Where our curves are below the published ones, and whether the published value lies in our interval there."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.statistics import Estimate

WITHIN = "Below the published mean, which lies in our interval"
OUTSIDE = "Below the published mean, which lies outside of our interval"

Marks = dict[str, list[str]]
"""By one of these, where."""


def marks(
    values: np.ndarray,
    at: Sequence[float],
    published: Sequence[float],
    estimate: Callable[[np.ndarray], Estimate] = statistics.mean,
) -> Marks:
    """The marks at which the mean of some seeds is below the published one.

    Args:
        values: float[seeds, marks], NaN where nothing is known.
        at: what the marks are called, numbers.
        published: the published means.
        estimate: the mean over seeds and its interval.
    """
    found: Marks = {WITHIN: [], OUTSIDE: []}
    for mark, of_seeds, other in zip(at, values.T, published, strict=True):
        own = estimate(of_seeds[np.isfinite(of_seeds)])
        if own.value is not None and own.value < other:
            found[OUTSIDE if own.high is not None and own.high < other else WITHIN].append(f"{mark:,}")
    return found


def listed(found: Mapping[str, Marks], where: str) -> str:
    """What was found of several runs, by name, a line for each kind; `where` says what a list of marks is."""
    lines = []
    for kind in (WITHIN, OUTSIDE):
        points = [f"{name} {where.format(', '.join(of[kind]))}" for name, of in found.items() if of[kind]]
        lines += [f"{kind}: {'; '.join(points)}."] if points else []
    return "\n".join(lines)
