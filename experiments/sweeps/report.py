"""What the points of a sweep came to: one line each, and a picture of them."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.cli.grid import Point
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.curves import plot_runs
from t2tl_jax.runs import status_form
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.metrics_file import MetricsFileError, ending, history
from t2tl_jax.runs.success import success_since, window

LAST = 0.05
"""Share of the iterations, at the end, over which the final return is averaged."""

CURVES = "curves.png"
"""The picture."""

HEAD = f"{'over 95 %':>9}  {'since frames':>12}  {'discounted return':20}  {'seconds':>7}  {'beside':>6}  point"

LEGEND = (
    "Over 95 %: seeds whose success in training stays there; since how many frames, the median of all seeds;\n"
    f"discounted return over the last {LAST:.0%} of training, with its 95 % interval over seeds; seconds of\n"
    "training side by side with so many other points. For tests: python -m experiments.compare RUN RUN --pairs True"
)


def read_curves(paths: Iterable[Path]) -> dict[Path, dict[str, np.ndarray]]:
    """The metrics of every run; UserError if a file is damaged."""
    try:
        return {path: history(RunFolder(path).metrics) for path in paths}
    except MetricsFileError as error:
        raise UserError(str(error)) from error


def final_returns(curves: Mapping[str, Any]) -> np.ndarray:
    """Discounted return of every seed at the end of training; not a number where no episode ended."""
    return ending(curves, LAST)["discounted_return"]


def line(path: Path, point: Point, curves: Mapping[str, Any]) -> str:
    """One line of the table."""
    status = status_form.read(RunFolder(path))
    since = success_since(curves["success_rate"], window(point.config))
    frames = np.median(np.where(since > 0, since * np.nanmin(curves["frames"]), np.inf))
    final = final_returns(curves)
    gained = statistics.mean(final[np.isfinite(final)])
    seconds = status.get("all_sessions", {}).get("training_seconds")
    beside = status.get("group", {}).get("runs", 1) - 1
    return (
        f"{f'{(since > 0).sum()}/{since.size}':>9}  {f'{frames:,.0f}' if np.isfinite(frames) else '-':>12}  "
        f"{gained.text():20}  {'-' if seconds is None else f'{seconds:,.0f}':>7}  {beside:>6}  {point.label}"
    )


def draw(curves: Mapping[str, Mapping[str, Any]], base: Path) -> None:
    """The picture of some points, by their labels; a note if it cannot be written."""
    try:
        plot_runs(curves, base / CURVES)
        print(f"drawn: {base / CURVES}")
    except OSError as error:
        print(f"note: no picture: {error}")
