"""What agents for any task did on their tests, by seed, and its means; other sections show it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from experiments.reproduction.anytask import met, suites, tested
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import Estimate, brackets, mean, mean_rate, score_interval, two_way_mean

SAMPLED, MODE = "sampled", "deterministic"

RANGES = {"success_length": (0.0, np.inf), "discounted_return": (-np.inf, np.inf)}
"""Of every figure that is no rate."""


def figures(run: Stored) -> dict[str, dict[str, dict[str, np.ndarray]]]:
    """By task, policy and figure: float[seeds], NaN where there is none. Tasks of other worlds name them."""
    found = {}
    for part, entry in tested.read(run.path).items():
        for task, policies in entry.get("tasks", {}).items():
            suite = _ELSEWHERE.get(part)
            found[tested.name_elsewhere(task, suite) if suite else task] = {
                policy: {name: np.array(values, np.float64) for name, values in of.items()}
                for policy, of in policies.items()
            }
    if (reports := {policy: run.played(policy=policy) for policy in (SAMPLED, MODE)}) and all(reports.values()):
        found[OWN] = {
            policy: {
                name: np.array([seed[name]["value"] for seed in report["seeds"]], np.float64) for name in tested.FIGURES
            }
            for policy, report in reports.items()
            if report is not None
        }
    return found


OWN = met.OWN
"""Formulas of the family of the training that it never had as they stand, on maps that it never had."""

_ELSEWHERE = {suite.name: suite for suite in (*suites.MORE_COLOURS, suites.EXCHANGED)}
"""Suites whose tasks are also played elsewhere, or otherwise."""


def over_seeds(values: np.ndarray, figure: str) -> Estimate:
    """The mean over seeds."""
    known = values[np.isfinite(values)]
    return mean(known, *RANGES[figure]) if figure in RANGES else mean_rate(known)


def by_spread(values: np.ndarray, figure: str) -> Estimate:
    """The mean over seeds with Student's t interval, of rates too; without one where all seeds are equal."""
    return mean(values[np.isfinite(values)], *RANGES.get(figure, (0.0, 1.0)))


def interval(estimate: Estimate, digits: int = 3) -> str:
    """The interval alone, for a cell; a dash where there is none."""
    if estimate.low is None or estimate.high is None:
        return "-"
    return brackets(estimate.low, estimate.high, digits)


def by_tasks(of: Mapping[str, Any], tasks: Sequence[str], policy: str, figure: str) -> Estimate:
    """The mean over seeds and tasks, both of them samples, with Student's t interval."""
    return two_way_mean(_stacked(of, tasks, policy, figure), *RANGES.get(figure, (0.0, 1.0)))


def over_tasks(of: Mapping[str, Any], tasks: Sequence[str], policy: str, figure: str) -> Estimate:
    """The same for a cell, whose interval of a rate is Wilson's over seeds at least, as in cells of a single task."""
    estimate = by_tasks(of, tasks, policy, figure)
    seeds = int(np.isfinite(_stacked(of, tasks, policy, figure)).any(axis=1).sum())
    if figure in RANGES or estimate.value is None or seeds < 2:
        return estimate
    wilson = score_interval(estimate.value, seeds)
    assert wilson.low is not None and wilson.high is not None
    by_t = [end for end in (estimate.low, estimate.high) if end is not None]
    return replace(estimate, low=min([wilson.low, *by_t]), high=max([wilson.high, *by_t]))


def _stacked(of: Mapping[str, Any], tasks: Sequence[str], policy: str, figure: str) -> np.ndarray:
    return np.stack([of[task][policy][figure] for task in tasks], axis=1)


def own_family(run: Stored, policy: str = SAMPLED) -> dict[int, float]:
    """Success by seed on formulas of the training's family that it never had as they stand, on maps likewise."""
    return run.by_seed("success_rate", policy=policy)


def state_of(run: Stored) -> str:
    """What the policy reads of observations."""
    learner: Any = run.config.learner
    return type(learner.network.state).__name__.removesuffix("Config").lower()
