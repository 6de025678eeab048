"""The out-projection weights of a Transformer's attention layers, before and after training, and how far they moved.

They say how much of what each head has gathered goes on to the next layer: a head whose weights stand still has learned
nothing of its own.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Projections:
    """The weights of all layers at the start and at the end of training."""

    start: np.ndarray
    """``float[layers, heads, size, width]``: from the numbers of every head to the layer's output."""
    end: np.ndarray
    """The same after training."""

    @property
    def relative_change(self) -> np.ndarray:
        """By layer and head, the Frobenius norm of the change over that of the start: ``float[layers, heads]``."""
        change, before = (np.linalg.norm(x, axis=(-2, -1)) for x in (self.end - self.start, self.start))
        return change / np.maximum(before, np.finfo(np.float32).tiny)


def out_projections(params: Any) -> np.ndarray:
    """The weights of every layer, ``float[layers, heads, size, width]``.

    Args:
        params: of a `TransformerTaskEncoder`, ``agent_params["params"]["task_encoder"]``.
    """
    layers = params["transformer"]["encoder"]
    count = sum(name.startswith("layer_") for name in layers)
    return np.stack([np.asarray(layers[f"layer_{i}"]["attention"]["out"]["kernel"]) for i in range(count)])


def plot_projections(target: Path, title: str, names: tuple[str, str], projections: Projections) -> None:
    """Draw the weights at the start and at the end, their change, and its size by head; one row of panels a layer.

    Args:
        target: the PNG to write.
        title: above the panels.
        names: what to call the start and the end.
        projections: the weights.
    """
    layers, heads, size, width = projections.start.shape
    # Without pyplot: no global state, no display, usable from any thread.
    figure = Figure(figsize=(14, 1.2 + 2.9 * layers), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    panels = figure.subplots(layers, 4, squeeze=False, width_ratios=(3, 3, 3, 2))
    change = projections.end - projections.start
    largest = max(np.abs(projections.start).max(), np.abs(projections.end).max(), 1e-12)
    columns = (
        (names[0], projections.start, largest),
        (names[1], projections.end, largest),
        ("change: end less start", change, max(np.abs(change).max(), 1e-12)),
    )
    for column, (name, weights, limit) in enumerate(columns):
        for layer in range(layers):
            axes = panels[layer, column]
            flat = weights[layer].reshape(heads * size, width)
            image = axes.imshow(flat, cmap="RdBu_r", vmin=-limit, vmax=limit, aspect="auto", interpolation="nearest")
            axes.set_yticks(size * np.arange(heads) + (size - 1) / 2, [str(head + 1) for head in range(heads)])
            axes.set_ylabel(f"layer {layer}, head" if column == 0 else "")
            for edge in range(1, heads):
                axes.axhline(size * edge - 0.5, color="0.6", linewidth=0.4)
        panels[0, column].set_title(name, fontsize="medium")
        panels[-1, column].set_xlabel("output")
        if column > 0:  # start and end share one scale
            figure.colorbar(image, ax=panels[:, column], fraction=0.04)
    relative = projections.relative_change
    for layer, axes in enumerate(panels[:, 3]):
        axes.barh(np.arange(heads), relative[layer], color="0.45")
        axes.set_xlim(0, 1.05 * max(relative.max(), 1e-6))
        axes.set_yticks(np.arange(heads), [str(head + 1) for head in range(heads)])
        axes.invert_yaxis()
        axes.grid(axis="x", alpha=0.3)
    panels[0, 3].set_title("size of the change\nover that of the start", fontsize="medium")
    figure.suptitle(title, fontsize="medium")
    canvas.print_png(str(target))
