"""The progress bar of a run."""

from collections.abc import Mapping, Sequence

import numpy as np
from tqdm import tqdm

Row = Mapping[str, float | int | None]


class Progress:
    """Frames, frames per second, time left, and averages over the seeds of the newest finished episodes.

    Frames are counted per seed. With several seeds the speed of all of them together stands behind ``all``.
    """

    def __init__(self, total: int, done: int, seeds: int, quiet: bool = False) -> None:
        self._seeds = seeds
        self._bar = tqdm(
            total=total,
            initial=done,
            desc="training" if seeds == 1 else f"training {seeds} seeds",
            unit="frame" if seeds == 1 else "frame per seed",
            unit_scale=True,
            dynamic_ncols=True,
            smoothing=0.1,
            disable=quiet,
        )
        if not self._bar.disable and not self._bar.fp.isatty():
            self._bar.mininterval = 10.0  # a log file needs no ten lines per second

    def advance(self, frames: int, rows: Sequence[Row]) -> None:
        """Show one iteration: frames of each seed, and the rows of ``metrics.csv``."""
        shown = {
            label: _mean_text(rows, name, digits)
            for label, name, digits in (
                ("success", "success_rate", 3),
                ("return", "discounted_return", 3),
                ("length", "length", 0),
            )
        }
        rate = self._bar.format_dict.get("rate")
        if self._seeds > 1 and rate:
            shown["all"] = f"{tqdm.format_sizeof(rate * self._seeds)}frame/s"
        self._bar.set_postfix(shown, refresh=False)
        self._bar.update(frames)

    def close(self) -> None:
        """Leave the finished bar on the screen."""
        self._bar.close()


def _mean_text(rows: Sequence[Row], name: str, digits: int) -> str:
    values = [value for value in (row[name] for row in rows) if value is not None]
    return f"{np.mean(values):.{digits}f}" if values else "-"
