"""Reports of one policy on many tasks as one table, with means over all tasks."""

from collections.abc import Mapping, Sequence

import numpy as np

from t2tl_jax.evaluation.report import COLUMNS, Outcomes, Report, aligned, cells
from t2tl_jax.evaluation.statistics import Estimate, two_way_mean

RANGES = {"success_length": (0.0, float("inf")), "discounted_return": (float("-inf"), float("inf"))}
"""The range of every quantity that is no rate."""


def over_tasks(reports: Sequence[Report]) -> Outcomes:
    """Means over the seeds and tasks of reports of the same seeds; for the intervals see `two_way_mean`."""

    def estimate(name: str) -> Estimate:
        values = [[getattr(seed, name).value for report in reports if (seed := report.seeds[k])] for k in seeds]
        return two_way_mean(np.array(values, np.float64), *RANGES.get(name, (0.0, 1.0)))  # None becomes NaN

    seeds = range(len(reports[0].seeds))
    return Outcomes(**{name: estimate(name) for name in COLUMNS.values()})


def tasks_table(policies: Mapping[str, Mapping[str, Report]], met: Mapping[str, tuple[str, str]] | None = None) -> str:
    """A table to print: one line per policy and task, and one over the tasks.

    Args:
        policies: by the name of the policy, then of the task; all of the same tasks.
        met: per task, how many of its open rows training met, in meaning and under other names too; None for unknown.
    """
    lines: list[tuple[str, ...]] = [("policy", "task", "rows met", "renamed", *COLUMNS)]
    seeds = 1
    for policy, reports in policies.items():
        for task, report in reports.items():
            seeds = len(report.seeds)
            shown = report if seeds > 1 else report.seeds[0]
            lines.append((policy, task, *((met or {}).get(task, ("-", "-"))), *cells(shown)))
        if len(reports) > 1:
            lines.append((policy, "all tasks", "", "", *cells(over_tasks(list(reports.values())))))
    over = "seeds" if seeds > 1 else "the episodes of the one seed"
    both = "seeds and tasks" if seeds > 1 else "seeds and tasks, for which one seed is too few"
    return "\n".join(
        [
            *aligned(lines),
            "rows met: open rows of the task that training met too, 0 of them for a task that is new; renamed: also "
            "under other names of propositions.",
            f"Brackets: 95 % intervals, over {over}; in the lines 'all tasks', over {both}.",
        ]
    )
