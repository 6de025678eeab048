"""Learning curves as a picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, MaxNLocator

from t2tl_jax.evaluation.statistics import band

PANELS = (
    ("success_rate", "success rate"),
    ("discounted_return", "discounted return"),
    ("length", "episode length (steps)"),
)

Curve = tuple[Sequence[float], Sequence[float]]


def plot_learning_curves(
    metrics: Mapping[str, np.ndarray],
    seeds: Sequence[int],
    target: Path,
    title: str = "",
    published: Mapping[str, Curve] | None = None,
) -> None:
    """Draw the curves of a run: a thin line per seed, their mean, and its 95 % interval over seeds.

    The interval is Student's t, of shares Wilson's.

    Args:
        metrics: by name, ``float[seeds, iterations]``, such as `Result.metrics`; NaN where absent.
        seeds: their numbers.
        target: the PNG to write.
        title: above the panels.
        published: curves ``(frames, discounted return)`` to compare with, by name.
    """
    frames = _frames(metrics)
    # Without pyplot: no global state, no display, usable from any thread.
    figure = Figure(figsize=(4.4 * len(PANELS), 3.6), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    for axes, (name, label) in zip(figure.subplots(1, len(PANELS)), PANELS, strict=True):
        values = metrics[name]
        centre, low, high = band(values, shares=name == "success_rate")
        if len(values) > 1:
            for line in values:
                axes.plot(frames, line, color="C0", linewidth=0.6, alpha=0.4)
            axes.fill_between(frames, low, high, color="C0", alpha=0.2, linewidth=0)
        marker = "o" if np.isfinite(centre).sum() == 1 else None
        count = f"{len(values)} seeds" if len(values) > 1 else f"seed {seeds[0]}"
        axes.plot(frames, centre, color="C0", linewidth=1.8, marker=marker, label=count)
        if name == "discounted_return":
            for index, (curve, (x, y)) in enumerate((published or {}).items(), start=1):
                axes.plot(x, y, color=f"C{index}", linestyle="--", linewidth=1.2, label=curve)
        if name == "success_rate":
            axes.set_ylim(-0.03, 1.03)
        axes.set_xlabel("frames per seed")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(frameon=False, fontsize="small")
    figure.suptitle(title, fontsize="medium")
    canvas.print_png(str(target))


@dataclass(frozen=True)
class Line:
    """One curve of a picture."""

    label: str
    x: Sequence[float] | np.ndarray
    """``float[points]``"""
    values: np.ndarray
    """``float[seeds, points]``, NaN where absent; a single row is drawn without a band."""
    colour: int
    """Which of matplotlib's colours, from 0 on."""
    dashed: bool = False
    shares: bool = False
    """Whether the values are shares, whose interval is another one."""


def plot_runs(
    runs: Mapping[str, Mapping[str, np.ndarray]], target: Path, published: Mapping[str, Curve] | None = None
) -> None:
    """Draw the discounted return of several runs, each with its 95 % t interval over seeds.

    Args:
        runs: the metrics of each run, as for `plot_learning_curves`, by name.
        target: the PNG to write.
        published: curves ``(frames, discounted return)``, drawn dashed in the same order of colours.
    """
    lines = [
        Line(f"{name} ({len(of['discounted_return'])} seeds)", _frames(of), of["discounted_return"], colour)
        for colour, (name, of) in enumerate(runs.items())
    ]
    lines += [
        Line(name, x, np.array([y], float), colour, dashed=True)
        for colour, (name, (x, y)) in enumerate((published or {}).items())
    ]
    plot_lines(lines, target, "frames per seed", "discounted return")


def plot_lines(
    lines: Sequence[Line], target: Path, xlabel: str, ylabel: str, metadata: Mapping[str, str] | None = None
) -> None:
    """Draw curves into one panel, each with its 95 % interval over seeds: Student's t, of shares Wilson's.

    Args:
        lines: what is drawn, in this order.
        target: the PNG to write.
        xlabel: below the panel.
        ylabel: beside it.
        metadata: texts to keep in the PNG, by keyword.
    """
    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.subplots()
    for line in lines:
        colour, centre = f"C{line.colour}", line.values[0]
        if len(line.values) > 1:
            centre, low, high = band(line.values, line.shares)
            axes.fill_between(line.x, low, high, color=colour, alpha=0.15, linewidth=0)
        style, width = ("--", 1.1) if line.dashed else ("-", 1.6)
        axes.plot(line.x, centre, color=colour, linestyle=style, linewidth=width, label=line.label)
    axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 2.5, 5, 10]))  # nothing between layers
    axes.xaxis.set_major_formatter(EngFormatter())  # 2 M
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    axes.grid(alpha=0.3)
    figure.legend(frameon=False, fontsize="small", loc="outside right upper")
    canvas.print_png(str(target), metadata=dict(metadata or {}))


def _frames(metrics: Mapping[str, np.ndarray]) -> np.ndarray:
    """Environment steps of each seed by iteration: float[iterations]. No row is missing in every seed."""
    return np.nanmax(metrics["frames"], axis=0)
