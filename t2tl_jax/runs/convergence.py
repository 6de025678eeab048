"""When training has converged: the return no longer improves. Decided on the host, from the recorded metrics alone.

Where tasks are random, the pools differ in what they allow at best, so that returns of different ones say little about
progress: there it is the distance from the optimum, the regret, that no longer shrinks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from t2tl_jax import checks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.ltl.ahead import distance_to_true
from t2tl_jax.runs.rows import column


@dataclass(frozen=True)
class ConvergenceConfig:
    """Stop early when the mean discounted return of the last iterations no longer exceeds that of those before; of
    random tasks, when the mean regret no longer falls: `optimal_return` less the discounted return.

    A run with several seeds stops when each of them has been at that point, now or earlier.
    """

    window: int = 0
    """Iterations in each of the two means; 0 never stops early."""
    delta: float = 0.002
    """Improvements up to this much count as none. A return of 0 or less is never the end."""

    def __post_init__(self) -> None:
        checks.counts(self, "window", least=0)
        checks.not_negative(self, "delta")


_distance_to_true = jax.jit(distance_to_true)


def optimal_return(table: TaskTable, discount: float) -> float:
    """The mean over a table's tasks of the discounted return of the shortest way to true, or 0 where there is none.

    So much can be had where every letter is free at each step, as in the world with one state; elsewhere less.
    """
    steps = np.asarray(_distance_to_true(table))[np.asarray(table.initial_row)]
    return float(np.mean(np.where(steps < table.num_rows, discount ** (steps - 1.0), 0.0)))


class Convergence:
    """The test of `ConvergenceConfig`, iteration by iteration."""

    def __init__(
        self,
        config: ConvergenceConfig,
        seeds: int,
        returns: np.ndarray | None = None,
        optimal: np.ndarray | None = None,
    ) -> None:
        """Begin, or take up again after the iterations whose `returns` are given: float[seeds, iterations] or None.

        `optimal` is the optimum of the tasks of each, of the same shape; None where the tasks are always the same.
        """
        self._config = config
        self._returns: list[np.ndarray] = []
        self._regrets: list[np.ndarray] = []
        self._done = np.zeros(seeds, bool)
        if returns is not None:
            for one, best in zip(returns.T, np.zeros_like(returns.T) if optimal is None else optimal.T, strict=True):
                self._add(one, best)

    def add(self, rows: Sequence[Mapping[str, float | int | None]]) -> None:
        """Take in one iteration: a row of ``metrics.csv`` for every seed."""
        self._add(column(rows, "discounted_return"), column(rows, "optimal_return"))

    @property
    def reached(self) -> bool:
        """Whether training may stop."""
        return bool(self._done.all())

    def info(self) -> dict[str, Any]:
        """What it knows, as JSON."""
        return {
            "returns": [values.tolist() for values in self._returns],
            "regrets": [values.tolist() for values in self._regrets],
            "done": self._done.tolist(),
        }

    def go_on(self, info: Mapping[str, Any]) -> None:
        """Know what `info` says, as far as a window that was changed meanwhile needs it."""
        self._returns, self._regrets = ([np.array(x, float) for x in info[name]] for name in ("returns", "regrets"))
        self._done = np.array(info["done"], bool)

    def _add(self, returns: np.ndarray, optimal: np.ndarray) -> None:
        window = self._config.window
        if not window:
            return
        self._returns = [*self._returns, returns][-window:]
        self._regrets = [*self._regrets, optimal - returns][-2 * window :]
        if len(self._regrets) == 2 * window:
            before, after = (_mean(np.array(part)) for part in (self._regrets[:window], self._regrets[window:]))
            gains_nothing = before - after <= self._config.delta  # NaN compares as False
            self._done |= (_mean(np.array(self._returns)) > 0) & gains_nothing


def _mean(values: np.ndarray) -> np.ndarray:
    """Mean over the first axis of what is not NaN; NaN where there is nothing."""
    known = np.isfinite(values)
    return np.where(known, values, 0.0).sum(0) / np.where(known.any(0), known.sum(0), np.nan)
