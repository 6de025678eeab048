"""Where our curves are below the published ones, and whether the published value lies in our interval there."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import Curve, return_by_frames, returns_at
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
    found: dict[str, list[int]] = {WITHIN: [], OUTSIDE: []}
    for index, (of_seeds, other) in enumerate(zip(values.T, published, strict=True)):
        own = estimate(of_seeds[np.isfinite(of_seeds)])
        if own.value is not None and own.value < other:
            found[OUTSIDE if own.high is not None and own.high < other else WITHIN].append(index)
    return {kind: _in_words(at, indices) for kind, indices in found.items()}


def _in_words(at: Sequence[float], indices: Sequence[int]) -> list[str]:
    """Marks by their numbers; three or more that follow one another as ``first to last``."""
    parts: list[list[int]] = []
    for index in indices:
        if parts and index == parts[-1][-1] + 1:
            parts[-1].append(index)
        else:
            parts.append([index])
    return [
        text
        for part in parts
        for text in ([f"{at[part[0]]:,} to {at[part[-1]]:,}"] if len(part) > 2 else [f"{at[i]:,}" for i in part])
    ]


def listed(found: Mapping[str, Marks], where: str) -> str:
    """What was found of several runs, by name, a line for each kind; `where` says what a list of marks is."""
    lines = []
    for kind in (WITHIN, OUTSIDE):
        points = [f"{name} {where.format(', '.join(of[kind]))}" for name, of in found.items() if of[kind]]
        lines += [f"{kind}: {'; '.join(points)}."] if points else []
    return "\n".join(lines)


def by_frames(runs: Mapping[str, Stored], published: Mapping[str, Curve], frames: Sequence[float]) -> str:
    """Where curves by frames are below the published ones, by run, at these numbers of frames."""
    found = {
        name: marks(
            return_by_frames(run, frames),
            [mark / 1e6 for mark in frames],
            np.interp(frames, *published[name]).tolist(),
        )
        for name, run in runs.items()
        if name in published
    }
    return listed(found, "at {} million frames")


def by_episode(runs: Mapping[str, Stored], published: Mapping[str, Sequence[float]], episodes: Sequence[int]) -> str:
    """Where curves by episode are below the published ones, by run, at the first of their episodes or all of them."""
    found = {
        name: marks(returns_at(run, episodes), episodes, published[name][: len(episodes)])
        for name, run in runs.items()
        if name in published
    }
    return listed(found, "at episodes {}")
