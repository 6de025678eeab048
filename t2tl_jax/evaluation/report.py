"""What evaluated episodes amount to: rates, steps and returns with intervals, per seed and over seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import inf
from typing import Any

import jax
import numpy as np

from t2tl_jax.evaluation.episodes import Episodes
from t2tl_jax.evaluation.statistics import SOLVED, Estimate, mean, mean_rate, rate

COLUMNS = {
    "success": "success_rate",
    "violation": "violation_rate",
    "time-out": "timeout_rate",
    "ended by env": "env_termination_rate",
    "steps on success": "success_length",
    "discounted return": "discounted_return",
}
"""Columns of every printed table: their headings, and the estimates in them."""


@dataclass(frozen=True, kw_only=True)
class Outcomes:
    """What becomes of episodes, as estimates: of a seed over its episodes, or means over seeds or over tasks too."""

    success_rate: Estimate
    """Share of episodes in which the formula became true."""
    violation_rate: Estimate
    """Share of episodes in which it became false."""
    timeout_rate: Estimate
    """Share of episodes cut by the time limit."""
    env_termination_rate: Estimate
    """Share of episodes that the environment ended by itself while the task was open, such as by leaving the arena."""
    success_length: Estimate
    """Steps of the successful episodes, over the seeds and tasks that have some."""
    discounted_return: Estimate
    """Mean of the sum of discount^t r_t from t = 0, whatever the rewards."""


@dataclass(frozen=True, kw_only=True)
class SeedReport(Outcomes):
    """One policy of one seed; Wilson intervals of rates and t intervals of means, over its episodes."""

    seed: int
    """Number of the seed."""
    paper_return: Estimate
    """The paper's average discounted return: the mean of (sum of r_t) * discount^(steps - 1); t interval. The same
    where only the last step pays, as formulas do."""


@dataclass(frozen=True, kw_only=True)
class Report(Outcomes):
    """One policy (deterministic or sampled) of all seeds of a run: means over seeds.

    Intervals are over seeds, of rates Wilson's with one trial a seed, else t; None with a single seed.
    """

    seeds: tuple[SeedReport, ...]
    """Each seed by itself."""
    paper_return: Estimate
    """Mean over seeds of the same."""
    solved: Estimate
    """Share of seeds whose success rate exceeds 95 %; Wilson interval over seeds. A seed has *solved* its task when
    this was played by its final parameters."""

    ranges: Mapping[str, tuple[float, float]]
    """The smallest and the largest possible value of each mean that is no rate, by its name; not stored."""

    def as_json(self) -> dict[str, Any]:
        """The same as nested dictionaries, lists, numbers and None, without the ranges."""
        return {name: value for name, value in asdict(self).items() if name != "ranges"}


def summarise(episodes: Episodes, seeds: Sequence[int], limit: float = inf, machines: bool = True) -> Report:
    """Estimates from the outcomes of every seed.

    Args:
        episodes: on the host, ``[seeds, episodes]``.
        seeds: their numbers.
        limit: most steps of an episode, where that is known.
        machines: whether the tasks may be reward machines, which can pay anything, and not formulas.
    """
    ranges = _ranges(episodes, limit, machines)
    reports = tuple(
        _seed_report(seed, jax.tree.map(lambda part, index=index: np.asarray(part)[index], episodes), ranges)
        for index, seed in enumerate(seeds)
    )

    def known(name: str) -> list[float]:
        values = [getattr(report, name).value for report in reports]
        return [value for value in values if value is not None]

    solving = sum((report.success_rate.value or 0.0) > SOLVED for report in reports)
    return Report(
        seeds=reports,
        success_rate=mean_rate(known("success_rate")),
        violation_rate=mean_rate(known("violation_rate")),
        timeout_rate=mean_rate(known("timeout_rate")),
        env_termination_rate=mean_rate(known("env_termination_rate")),
        **{name: mean(known(name), *ends) for name, ends in ranges.items()},
        solved=rate(solving, len(reports)),
        ranges=ranges,
    )


def _ranges(episodes: Episodes, limit: float, machines: bool) -> dict[str, tuple[float, float]]:
    """What the means can be that are no rates. Returns are bounded where nothing but verdicts was ever paid."""
    verdicts = np.asarray(episodes.success, np.float64) - np.asarray(episodes.violation)
    bounded = not machines and bool((np.asarray(episodes.total_reward) == verdicts).all())
    returns = (-1.0, 1.0) if bounded else (-inf, inf)
    return {"success_length": (1.0, limit), "discounted_return": returns, "paper_return": returns}


def table(reports: Mapping[str, Report]) -> str:
    """A table to print: one line per policy and seed, and one over the seeds.

    Args:
        reports: by the name of the policy, for instance ``{"final deterministic": ..., "best sampled": ...}``. Of
            those whose names begin with "final", the final parameters, alone it is said that they solve the task.
    """
    lines: list[tuple[str, ...]] = [("policy", "seed", "episodes", *COLUMNS)]
    for policy, report in reports.items():
        lines += [(policy, str(seed.seed), str(seed.success_rate.count), *cells(seed)) for seed in report.seeds]
        if len(report.seeds) > 1:
            lines.append((policy, "mean", "", *cells(report)))
    text = aligned(lines)
    for policy, report in reports.items():
        above = _above(report, policy.startswith("final"))
        text.append(f"{policy}: {above}, mean discounted return {report.discounted_return.text()}")
    if len({seed.success_rate.count for report in reports.values() for seed in report.seeds}) > 1:
        text.append("Where start, dynamics and policy are deterministic, a task's episode repeats; it counts once.")
    text.append("Brackets: 95 % intervals, over the episodes of a seed and, in the lines 'mean', over seeds.")
    return "\n".join(text)


def _above(report: Report, final: bool) -> str:
    """How many seeds are above the threshold; that the task is solved only of final parameters."""
    count, above = report.solved.count, round((report.solved.value or 0.0) * report.solved.count)
    if not final and count == 1:
        return f"success {'' if above else 'not '}above {SOLVED:.0%}"
    if not final:
        return f"success above {SOLVED:.0%} in {above} of {count} seeds"
    solved = f"{above} of {count} seeds solve the task" if count > 1 else f"the task is {'' if above else 'not '}solved"
    return f"{solved} (success above {SOLVED:.0%}, final parameters)"


def _seed_report(seed: int, episodes: Episodes, ranges: Mapping[str, tuple[float, float]]) -> SeedReport:
    means = {
        "success_length": episodes.length[episodes.success],
        "discounted_return": episodes.discounted_return,
        "paper_return": episodes.paper_return,
    }
    decided = episodes.success | episodes.violation | episodes.env_termination
    count = len(decided)
    return SeedReport(
        seed=seed,
        success_rate=rate(int(episodes.success.sum()), count),
        violation_rate=rate(int(episodes.violation.sum()), count),
        timeout_rate=rate(int((~decided).sum()), count),
        env_termination_rate=rate(int(episodes.env_termination.sum()), count),
        **{name: mean(np.asarray(values), *ranges[name]) for name, values in means.items()},
    )


def cells(report: Outcomes) -> tuple[str, ...]:
    """The `COLUMNS` of a report."""
    return tuple(getattr(report, name).text(1 if name == "success_length" else 3) for name in COLUMNS.values())


def aligned(lines: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table in columns of equal width, with a rule below the first one."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    return [text[0], "  ".join("-" * width for width in widths), *text[1:]]
