"""The picture of the paper's last figure: what each token receives by head, and beside it what taking it away does."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from t2tl_jax.evaluation.attention import Attention, Removal


def plot_attention(
    target: Path,
    title: str,
    tokens: Sequence[str],
    stages: Sequence[tuple[str, Attention]],
    removal: Removal,
    unit: str,
) -> None:
    """Draw attention by stage of training, and the effects of removal at the end.

    Args:
        target: the PNG to write.
        title: above the panels.
        tokens: of the formula.
        stages: what to call each, and its attention; none for an encoder without.
        removal: of the trained network.
        unit: of the change of the policy.
    """
    position = np.arange(len(tokens))
    # Without pyplot: no global state, no display, usable from any thread.
    widths = (*[3] * len(stages), 2, 2)
    figure = Figure(figsize=(1.5 * sum(widths), 2.2 + 0.26 * len(tokens)), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(widths), sharey=True, width_ratios=widths)
    widest = max([attention.total.max() for _, attention in stages], default=0.0)
    for axes, (name, attention) in zip(panels, stages, strict=False):
        _stacked(axes, attention)
        axes.set_title(f"attention received\n{name}", fontsize="medium")
        axes.set_xlabel(f"sum over {len(attention.weights)} heads")
        axes.set_xlim(0, 1.08 * widest)
    handles, labels = panels[0].get_legend_handles_labels()
    if stages:
        figure.legend(
            handles, labels, title="head", loc="outside lower left", ncols=12, frameon=False, fontsize="small"
        )
    where = "met in this row" if removal.met else "at the start of episodes; this row was never met"
    for axes, values, name, label in (
        (panels[-2], removal.policy, "policy", unit),
        (panels[-1], removal.value, "value", "mean absolute change"),
    ):
        axes.barh(position, values, color="0.45")
        axes.set_xlim(0, 1.05 * max(values.max(), 1e-6))
        axes.set_title(f"change of the {name}\nwithout the token", fontsize="medium")
        axes.set_xlabel(label)
    panels[0].set_yticks(position, tokens)
    panels[0].invert_yaxis()  # the formula reads from top to bottom
    for axes in panels:
        axes.grid(axis="x", alpha=0.3)
        axes.locator_params(axis="x", nbins=5)
    figure.suptitle(f"{title}\nremoval: mean over {removal.observations} observations {where}", fontsize="medium")
    canvas.print_png(str(target))


def _stacked(axes: Axes, attention: Attention) -> None:
    """Bars of all heads end to end, and a star at token*."""
    colours = colormaps["tab10" if len(attention.weights) <= 10 else "tab20"]
    left = np.zeros(len(attention.tokens))
    for head, weights in enumerate(attention.weights):
        colour = colours(head % colours.N)
        axes.barh(np.arange(len(left)), weights, left=left, color=colour, label=str(head + 1))
        left = left + weights
    best = attention.strongest
    axes.annotate("*", (left[best], best), xytext=(3, -5), textcoords="offset points", fontsize="large")
