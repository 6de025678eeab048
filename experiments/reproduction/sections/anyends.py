"""How episodes end that do not succeed: in a violation, by the environment's own end, or by the time limit."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.reproduction.sections.anyfigures import SAMPLED, over_tasks
from experiments.reproduction.stored import Stored

ENDS = ("violation_rate", "env_termination_rate", "timeout_rate")
"""What is stored of them, in the order of `CALLED`."""

CALLED = "violation / ended by env / time-out"


def shares(of: Mapping[str, Any], tasks: Sequence[str]) -> list[str]:
    """Of the sampled policy's episodes, means over seeds and tasks; dashes where a task was not played."""
    if not set(tasks) <= of.keys():
        return ["-"] * len(ENDS)
    means = (over_tasks(of, tasks, SAMPLED, name).value for name in ENDS)
    return ["-" if mean is None else f"{mean:.3f}" for mean in means]


def cell(of: Mapping[str, Any], tasks: Sequence[str], unplayed: str = "-") -> str:
    """The same in one cell; `unplayed` where a task was not played."""
    return " / ".join(shares(of, tasks)) if set(tasks) <= of.keys() else unplayed


def of_training(run: Stored) -> str:
    """The same of the last part of a training, means over seeds; '-' where it is not stored."""
    if not set(ENDS) <= run.metrics.keys():
        return "-"
    return " / ".join(f"{np.nanmean(list(run.end(name).values())):.3f}" for name in ENDS)
