"""Since when the success rate in training has been above 95 %, and stayed there to the end.

It is a sign that the task is solved, watched while parameters and exploration still change. *Solved* itself is said of
evaluation episodes of the final parameters alone, see `t2tl_jax.evaluation.report`.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from t2tl_jax.evaluation.statistics import SOLVED
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.rows import column

LEAST = 5
"""So many iterations in a row, at least, make it credible while training is still under way."""


def window(config: Config) -> int:
    """How many iterations in a row must lie above the threshold: enough for an episode to reach its time limit.

    Otherwise robots that stand still would not show: their episodes have not ended yet.
    """
    return max(LEAST, -(-config.episode_length // config.learner.unroll_length))


def success_since(success_rate: np.ndarray, window: int) -> np.ndarray:
    """The iteration from which on each seed stayed above 95 % until the end of its curve: int[seeds], counted from 1.

    An iteration in which no episode ended neither counts nor breaks the series. 0 stands for a seed that is not above
    it at the end, or for fewer iterations than the window.

    Args:
        success_rate: float[seeds, iterations], NaN where no episode ended.
        window: see there.
    """
    since = np.zeros(len(success_rate), int)
    for index, curve in enumerate(success_rate):
        known = np.flatnonzero(np.isfinite(curve))
        failing = np.flatnonzero(~(curve[known] > SOLVED))
        staying = known[failing[-1] + 1 :] if failing.size else known
        if len(staying) >= window:
            since[index] = staying[0] + 1
    return since


class SuccessWatch:
    """The same, iteration by iteration, from the rows of the metrics."""

    def __init__(self, seeds: int, window: int, success_rate: np.ndarray | None = None) -> None:
        """Begin, or take up again after the iterations whose rates are given: float[seeds, iterations] or None."""
        self._window = window
        self._since = np.zeros(seeds, int)
        self._count = np.zeros(seeds, int)
        self._iteration = 0
        for rates in () if success_rate is None else success_rate.T:
            self._add(rates)

    def add(self, rows: Sequence[Mapping[str, float | int | None]]) -> None:
        """Take in one iteration: a row of metrics for every seed."""
        self._add(column(rows, "success_rate"))

    @property
    def since(self) -> np.ndarray:
        """As `success_since`, of the curve so far."""
        return np.where(self._count >= self._window, self._since, 0)

    @property
    def all(self) -> bool:
        """Whether every seed is above 95 % now."""
        return bool((self.since > 0).all())

    def info(self) -> dict[str, Any]:
        """What it knows, as JSON."""
        return {"since": self._since.tolist(), "count": self._count.tolist(), "iteration": self._iteration}

    def go_on(self, info: Mapping[str, Any]) -> None:
        """Know what `info` says."""
        self._since, self._count = np.array(info["since"]), np.array(info["count"])
        self._iteration = info["iteration"]

    def _add(self, success_rate: np.ndarray) -> None:
        self._iteration += 1
        known, above = np.isfinite(success_rate), success_rate > SOLVED
        self._since = np.where(known & above & (self._count == 0), self._iteration, self._since)
        self._count = np.where(known, np.where(above, self._count + 1, 0), self._count)
