"""Reports of one policy on many tasks as one table, with means over all tasks."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from t2tl_jax.evaluation.report import COLUMNS, Outcomes, Report, aligned, cells
from t2tl_jax.evaluation.statistics import Estimate, two_way_mean
from t2tl_jax.ltl import Share, together

NOT_COUNTED = ("-", "-")
"""The cells of a task of which it is not known what training met."""


@dataclass(frozen=True)
class RowsMet:
    """The columns of what training met of each task, and what is to be said below the table."""

    by_task: Mapping[str, tuple[Share, Share]] = field(default_factory=dict)
    """Of the open rows of a task those that training met, in meaning and under other names too; may lack tasks."""
    notes: Sequence[str] = ()
    """Where the counts come from."""

    def cells(self, task: str) -> tuple[str, str]:
        """Both columns of a task."""
        exactly, renamed = self.by_task.get(task, NOT_COUNTED)
        return str(exactly), str(renamed)

    def cells_of_all(self, tasks: Iterable[str]) -> tuple[str, str]:
        """Both columns of some tasks together: sums, where each of them was counted."""
        tasks = list(tasks)
        if not all(task in self.by_task for task in tasks):
            return NOT_COUNTED
        exactly, renamed = zip(*(self.by_task[task] for task in tasks), strict=True)
        return str(together(exactly)), str(together(renamed))

    def legend(self) -> list[str]:
        """What the columns mean."""
        meaning = (
            "rows met: open rows of the task that training met too; renamed: also under other names of propositions"
        )
        return [f"{meaning}.", *self.notes]


def over_tasks(reports: Sequence[Report]) -> Outcomes:
    """Means over the seeds and tasks of reports of the same seeds; for the intervals see `two_way_mean`."""

    def estimate(name: str) -> Estimate:
        values = [[getattr(seed, name).value for report in reports if (seed := report.seeds[k])] for k in seeds]
        lows, highs = zip(*(report.ranges.get(name, (0.0, 1.0)) for report in reports), strict=True)
        return two_way_mean(np.array(values, np.float64), min(lows), max(highs))  # None becomes NaN

    seeds = range(len(reports[0].seeds))
    return Outcomes(**{name: estimate(name) for name in COLUMNS.values()})


def tasks_table(policies: Mapping[str, Mapping[str, Report]], met: RowsMet | None = None) -> str:
    """A table to print: one line per policy and task, and one over the tasks.

    Args:
        policies: by the name of the policy, then of the task; all of the same tasks.
        met: what training met of the tasks; None for unknown.
    """
    met = met or RowsMet()
    lines: list[tuple[str, ...]] = [("policy", "task", "rows met", "renamed", *COLUMNS)]
    seeds = 1
    for policy, reports in policies.items():
        for task, report in reports.items():
            seeds = len(report.seeds)
            shown = report if seeds > 1 else report.seeds[0]
            lines.append((policy, task, *met.cells(task), *cells(shown)))
        if len(reports) > 1:
            lines.append((policy, "all tasks", *met.cells_of_all(reports), *cells(over_tasks(list(reports.values())))))
    over = "seeds" if seeds > 1 else "the episodes of the one seed"
    both = "seeds and tasks" if seeds > 1 else "seeds and tasks, for which one seed is too few"
    return "\n".join(
        [
            *aligned(lines),
            *met.legend(),
            f"Brackets: 95 % intervals, over {over}; in the lines 'all tasks', over {both}.",
        ]
    )
