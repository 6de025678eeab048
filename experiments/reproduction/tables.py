"""Tables that several items share: methods with their final figures, curves beside the published ones, orderings."""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.reproduction.page import table
from experiments.reproduction.stored import Stored
from experiments.worlds import worlds
from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.comparisons import Pairs, compare, outcome
from t2tl_jax.evaluation.scores import return_by_episode

Values = Mapping[str, Mapping[int, float]]
Curve = tuple[Sequence[float], Sequence[float]]


def text(values: Mapping[int, float] | Sequence[float], digits: int = 3) -> str:
    """Mean and interval over seeds, for a cell; a dash where there is nothing."""
    data = list(values.values()) if isinstance(values, Mapping) else list(values)
    return statistics.mean([value for value in data if np.isfinite(value)]).text(digits)


def share(rates: Mapping[int, float]) -> str:
    """Mean of rates over seeds, with an interval that stays within 0 and 1 and is never of zero width."""
    return statistics.mean_rate([value for value in rates.values() if np.isfinite(value)]).text()


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
                f"{_share(run)}",
                text(run.end("discounted_return")),
                text(run.by_seed("discounted_return")),
                text(run.by_seed("discounted_return", which="best")),
                f"{published[name]:.2f}" if name in published else "-",
                f"{run.frames:,}",
                f"{run.train_seconds:.0f} s",
                f"{run.compile_seconds:.0f} s",
            )
        )
    heading = (
        "method",
        "solved",
        "return, training",
        "return, final",
        "return, best",
        "published",
        "frames",
        "training, all seeds",
        "compile",
    )
    return table(heading, rows)


def _share(run: Stored) -> str:
    solved = run.solved()
    return "-" if solved.value is None else f"{round(solved.value * solved.count)}/{solved.count}"


def curves_by_frames(
    runs: Mapping[str, Stored], labels: Mapping[str, str], marks: Sequence[float], published: Mapping[str, Curve]
) -> str:
    """Return in training over the quarter million frames that ends at each mark, and the published value there."""
    shown = {name: run for name, run in runs.items() if name in labels}
    heading = ["frames", *(labels[name] for name in shown), *(f"{labels[name]}, published" for name in published)]
    rows = []
    for mark in marks:
        row = [f"{mark / 1e6:g} M"]
        for run in shown.values():
            frames, returns = run.metrics["frames"][0], run.metrics["discounted_return"]
            part = (frames <= mark) & (frames > mark - 250_000)
            row.append(text(np.nanmean(returns[:, part], axis=1).tolist()) if part.any() else "-")
        for curve in published.values():
            row.append(f"{np.interp(mark, *curve):.2f}")
        rows.append(row)
    return table(heading, rows)


def curves_by_episode(
    runs: Mapping[str, Stored],
    labels: Mapping[str, str],
    marks: Sequence[int],
    published: Mapping[str, Sequence[float]],
) -> str:
    """Return without discount of the last 500 episodes at each mark, and the published value there."""
    shown = {name: run for name, run in runs.items() if name in labels}
    values = {
        name: np.stack([return_by_episode(run.columns, seed, marks) for seed in run.seeds])
        for name, run in shown.items()
    }
    heading = ["episode", *(labels[name] for name in shown), *(f"{name}, published" for name in published)]
    rows = [
        [
            f"{mark:,}",
            *(text(of[:, k].tolist()) for of in values.values()),
            *(f"{c[k]:.2f}" for c in published.values()),
        ]
        for k, mark in enumerate(marks)
    ]
    return table(heading, rows)


def differences(runs: Mapping[str, Stored], pairs: Pairs, values: Values, unit: str, claimed: bool = False) -> str:
    """The first run of each pair against the second, corrected for so many pairs, be all of them measured or not.

    Args:
        runs: those that are there.
        pairs: names of runs; where `claimed`, the paper says that the first one is better.
        values: by run and seed, what is compared.
        unit: what that is, in words.
        claimed: whether to say what becomes of the claims.
    """
    found = compare(values, {name: worlds(run.config, tuple(run.seeds)) for name, run in runs.items()}, pairs)
    rows = [
        (
            f"{first} {'>' if claimed else '-'} {second}",
            each.gap.text(),
            f"{each.pvalue:.3g}",
            each.improvement.text(2),
            "paired" if each.paired else "",
            *([outcome(each.gap)] if claimed else []),
        )
        for (first, second), each in found.items()
    ]
    heading = ["claim" if claimed else "runs", f"difference, {unit}", "p (Holm)", "probability of improvement", ""]
    return table([*heading, *(["outcome"] if claimed else [])], rows)
