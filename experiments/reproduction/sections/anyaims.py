"""What is asked of agents for any task, and what becomes of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.reproduction.page import table
from experiments.reproduction.sections.anycertified import Bounds, bounds
from experiments.reproduction.sections.anyfigures import MODE, SAMPLED, by_spread, by_tasks, figures, interval
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import Estimate


@dataclass(frozen=True)
class Bar:
    """What is asked of a run, and what decides it."""

    says: str
    tasks: tuple[str, ...]
    least: float | None = None
    most: float | None = None
    figure: str = "success_rate"
    policy: str = SAMPLED
    over: str = "mean"
    """The mean over tasks and seeds, or the worst seed and task ("worst"), or the mean over seeds of the task that has
    the worst one ("task")."""


def _in_time(run: Stored, most: float) -> tuple[str, str, str, str]:
    """Whether training of all seeds took no longer than it may, compiling and pre-training included."""
    before = run.status.get("pretraining", {}).get("training_seconds", 0.0)
    took = run.train_seconds + run.compile_seconds + before
    says = f"seconds, training of all {len(run.seeds)} seeds and compiling"
    return says, f"under {most:g}", f"{took:.0f}", REACHED if took < most else MISSED


Aim = tuple[str, str, str, str]
"""What is asked, the bar, what was measured, and what becomes of it."""

Aims = Callable[[Mapping[str, Stored]], list[Aim]]
"""The aims of a section, of the runs that are there."""

AIMS_HEADING = ("aim of this project", "bar", "measured", "")

REACHED, MISSED = "reached", "**not reached**"


def aims_of_run(name: str, bars: Sequence[Bar], seconds: float | None = None) -> Aims:
    """What becomes of what is asked of one run.

    Args:
        name: of the run.
        bars: what is asked.
        seconds: that training of all seeds and compiling may take; None where nothing is asked.
    """

    def found(runs: Mapping[str, Stored]) -> list[Aim]:
        if name not in runs:
            return []
        run = runs[name]
        timed = [] if seconds is None else [_in_time(run, seconds)]
        return [*aims(figures(run), bars, bounds(run)), *timed]

    return found


def aims(of: Mapping[str, Any], bars: Sequence[Bar], certified: Mapping[str, Bounds] | None = None) -> list[Aim]:
    """What is asked, what was measured, and whether it is reached.

    Args:
        of: figures, as `figures` gives them.
        bars: what is asked; those of which a task was not played are left out.
        certified: by task, what a certificate says of the sampled policy of one seed.
    """
    rows = []
    for bar in bars:
        if not set(bar.tasks) <= of.keys():
            continue
        measured, estimate = _measured(of, bar)
        wanted = f"at least {bar.least:g}" if bar.least is not None else f"at most {bar.most:g}"
        says = f"{bar.says} (mode)" if bar.policy == MODE else bar.says
        said = _reached(of, bar, certified or {}) if _holds(bar, measured) else MISSED
        rows.append((says, wanted, estimate, said))
    return rows


def verdicts(of: Mapping[str, Any], bars: Sequence[Bar]) -> str:
    """The same as a table; '' where nothing was played."""
    return table(AIMS_HEADING, aims(of, bars))


def _holds(bar: Bar, value: float) -> bool:
    return (bar.least is None or value >= bar.least) and (bar.most is None or value <= bar.most)


def _reached(of: Mapping[str, Any], bar: Bar, certified: Mapping[str, Bounds]) -> str:
    """That a mean reaches the bar, and what speaks against it: an interval that includes the bar, or a certificate that
    lies below it."""
    doubts, digits = [], _digits(bar)
    seeds = by_spread(_by_seed(of, bar), bar.figure)
    if bar.over != "worst" and _includes(seeds, bar):
        ends = "" if bar.over == "mean" and len(bar.tasks) == 1 else f", {interval(seeds, digits)},"
        doubts.append(f"the interval over seeds{ends} includes the bar")
    doubts += _below(bar, certified)
    if doubts:
        return f"{REACHED} by the mean alone: {'; '.join(doubts)}"
    if bar.over == "mean" and len(bar.tasks) > 1 and _includes(by_tasks(of, bar.tasks, bar.policy, bar.figure), bar):
        return f"{REACHED} for these formulas; the interval for others of their kind includes the bar"
    return REACHED


def _by_seed(of: Mapping[str, Any], bar: Bar) -> np.ndarray:
    """float[seeds]: what the bar is about, of each seed; the mean over tasks, or of the task that is worst."""
    each = np.array([of[task][bar.policy][bar.figure] for task in bar.tasks])
    found: np.ndarray = min(each, key=np.nanmean) if bar.over == "task" else np.nanmean(each, axis=0)
    return found


def _includes(estimate: Estimate, bar: Bar) -> bool:
    """Whether an interval does not lie wholly on the right side of the bar."""
    return any(not _holds(bar, end) for end in (estimate.low, estimate.high) if end is not None)


def _below(bar: Bar, certified: Mapping[str, Bounds]) -> list[str]:
    """Certificates of single tasks that the bar is about, which lie wholly below it."""
    if bar.least is None or bar.policy != SAMPLED or bar.figure != "success_rate":
        return []
    single = bar.tasks if bar.over != "mean" or len(bar.tasks) == 1 else ()  # a mean asks nothing of its parts
    return [
        f"the certificate of {task}, of seed {one.seed}, lies below it: {one.success.text(4)}"
        for task in single
        if (one := certified.get(task)) and one.success.high is not None and one.success.high < bar.least
    ]


def _digits(bar: Bar) -> int:
    return 0 if bar.figure == "success_length" else 3


def _measured(of: Mapping[str, Any], bar: Bar) -> tuple[float, str]:
    each = [of[task][bar.policy][bar.figure] for task in bar.tasks]
    digits = _digits(bar)
    if bar.over == "worst":
        values = [float(np.nanmin(values)) for values in each]
    elif bar.over == "task":
        values = [float(np.nanmean(values)) for values in each]
    else:
        estimate = (
            by_spread(np.asarray(each[0]), bar.figure)
            if len(each) == 1
            else by_tasks(of, bar.tasks, bar.policy, bar.figure)
        )
        return (np.nan if estimate.value is None else estimate.value), estimate.text(digits)
    worst = int(np.argmin(values))
    said = f"{values[worst]:.{digits}f} ({bar.tasks[worst]})"
    if bar.over == "task":  # a mean hides what single seeds do
        said += f"; worst seed and formula {min(float(np.nanmin(values)) for values in each):.{digits}f}"
    return values[worst], said
