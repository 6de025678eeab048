"""Tables that several items share: methods with their final figures, and curves beside the published ones."""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.reproduction.cells import COST, cost, solved, text
from experiments.reproduction.page import table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.scores import return_by_episode
from t2tl_jax.evaluation.statistics import interquartile_mean

Curve = tuple[Sequence[float], Sequence[float]]

MEAN_AT_EPISODES = "mean undiscounted return at these episodes"
"""What curves by episode are compared by."""

WINDOW = 500
"""Episodes over which a curve by episode is averaged."""

BY_EPISODE = f"Return without discount (success 1, violation -1, neither 0) of the last {WINDOW} training episodes:"

SPAN = 250_000
"""Frames over which a curve is averaged for a mark."""


def methods(runs: Mapping[str, Stored], labels: Mapping[str, str], published: Mapping[str, float] | None = None) -> str:
    """Final figures of every method: of training and, of the final and the best parameters, of their evaluation."""
    published = published or {}
    rows = []
    for name, run in runs.items():
        if name not in labels:
            continue
        rows.append(
            (
                labels[name],
                solved(run),
                solved(run, "deterministic"),
                text(run.end("discounted_return")),
                text(run.by_seed("discounted_return")),
                _middle(run),
                text(run.by_seed("discounted_return", which="best")),
                f"{published[name]:.2f}" if name in published else "-",
                *cost(run),
            )
        )
    heading = (
        *("method", "solved", "deterministic: its episodes succeed"),
        *("return, training", "return, final", "its interquartile mean", "return, best", "published", *COST),
    )
    return table(heading, rows)


def _middle(run: Stored) -> str:
    returns = list(run.by_seed("discounted_return").values())
    return interquartile_mean(returns).text() if returns else "-"


def curves_by_frames(
    runs: Mapping[str, Stored], labels: Mapping[str, str], marks: Sequence[float], published: Mapping[str, Curve]
) -> str:
    """Return in training over the quarter million frames that ends at each mark, and the published value there."""
    shown = {name: run for name, run in runs.items() if name in labels}
    values = {name: return_by_frames(run, marks) for name, run in shown.items()}
    heading = ["frames", *(labels[name] for name in shown), *(f"{labels[name]}, published" for name in published)]
    rows = [
        [
            f"{mark / 1e6:g} M",
            *(text(of[:, k].tolist()) for of in values.values()),
            *(f"{np.interp(mark, *curve):.2f}" for curve in published.values()),
        ]
        for k, mark in enumerate(marks)
    ]
    return table(heading, rows)


def return_by_frames(run: Stored, marks: Sequence[float]) -> np.ndarray:
    """Mean discounted return of each seed over the `SPAN` frames that end at each mark, ``float[seeds, marks]``."""
    frames, returns = run.metrics["frames"][0], run.metrics["discounted_return"]
    values = np.full((len(returns), len(marks)), np.nan)
    for k, mark in enumerate(marks):
        part = returns[:, (frames <= mark) & (frames > mark - SPAN)]
        known = np.isfinite(part).any(axis=1)
        values[known, k] = np.nanmean(part[known], axis=1)
    return values


def curves_by_episode(
    runs: Mapping[str, Stored],
    labels: Mapping[str, str],
    marks: Sequence[int],
    published: Mapping[str, Sequence[float]],
) -> str:
    """Return without discount of the last 500 episodes at each mark, which is said, and the published value there."""
    shown = {name: run for name, run in runs.items() if name in labels}
    values = {name: returns_at(run, marks) for name, run in shown.items()}
    heading = ["episode", *(labels[name] for name in shown), *(f"{name}, published" for name in published)]
    rows = [
        [
            f"{mark:,}",
            *(text(of[:, k].tolist()) for of in values.values()),
            *(f"{c[k]:.2f}" for c in published.values()),
        ]
        for k, mark in enumerate(marks)
    ]
    return f"{BY_EPISODE}\n\n{table(heading, rows)}"


def returns_at(run: Stored, marks: Sequence[int], window: int = WINDOW) -> np.ndarray:
    """What `return_by_episode` says of every seed, ``float[seeds, marks]``."""
    return np.stack([return_by_episode(run.columns, seed, marks, window) for seed in run.seeds])


def mean_return_at(run: Stored, marks: Sequence[int]) -> dict[int, float]:
    """Mean of the same over the marks, by seed."""
    return dict(zip(run.seeds, returns_at(run, marks).mean(axis=1).tolist(), strict=True))
