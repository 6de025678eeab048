"""The progress bar on the screen."""

from collections.abc import Sequence

import numpy as np
from tqdm import tqdm

from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.rows import column

SHOWN = (("success", "success_rate", 3), ("return", "discounted_return", 3), ("length", "length", 0))
"""Label, column of the metrics and digits of what stands behind the bar."""


class ProgressBar(Callback):
    """Frames, frames per second, time left, and averages over the seeds of the newest finished episodes.

    Frames are counted per seed. With several seeds the speed of all of them together stands behind ``all``.
    """

    def __init__(self) -> None:
        self._bar: tqdm | None = None

    def on_start(self, progress: TrainingProgress) -> None:
        """Show an empty bar, or that of a resumed run where it stood."""
        frames, seeds = progress.frames_per_iteration, len(progress.seeds)
        self._bar = tqdm(
            total=progress.iterations * frames,
            initial=progress.done * frames,
            desc="training" if seeds == 1 else f"training {seeds} seeds",
            unit="frame" if seeds == 1 else "frame per seed",
            unit_scale=True,
            dynamic_ncols=True,
            smoothing=0.1,
        )
        if not self._bar.fp.isatty():
            self._bar.mininterval = 10.0  # a log file needs no ten lines per second

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Move on by one iteration."""
        assert self._bar is not None
        shown = {label: _mean_text(rows, name, digits) for label, name, digits in SHOWN}
        rate = self._bar.format_dict.get("rate")
        if len(rows) > 1 and rate:
            shown["all"] = f"{tqdm.format_sizeof(rate * len(rows))}frame/s"
        self._bar.set_postfix(shown, refresh=False)
        self._bar.update(progress.frames_per_iteration)

    def on_end(self, progress: TrainingProgress) -> None:
        """Leave the finished bar on the screen."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def _mean_text(rows: Sequence[Row], name: str, digits: int) -> str:
    values = column(rows, name)
    known = values[~np.isnan(values)]
    return f"{np.mean(known):.{digits}f}" if known.size else "-"
