"""The page of results: every item as Markdown, from stored runs alone."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence

from experiments import tuning
from experiments.reproduction.plan import Item
from experiments.reproduction.stored import Stored

SMOKE = "**Smoke test: tiny networks and budgets, closed-form physics. These figures mean nothing.**"

HEAD = """# The paper, measured again

Written by `python -m experiments.reproduce --report True` from the runs in `results/paper`; do not edit.
Each run is there with its configuration, metrics, evaluation, versions and the commit that made it.

Return: average discounted return of the sampled policy over the last 5 % of training. Solved: seeds whose final
parameters succeed in over 95 % of the evaluation's sampled episodes. Brackets are 95 % intervals: Student's t over
seeds for means, Wilson for shares; differences are Welch's, or paired where seed k has the same map in both runs, and
corrected for the number of comparisons of a table, be all of its runs there or not. Seconds are upper bounds: several
trainings shared a GPU. Values with "±" are as published, a spread that is not said what it is. A claimed ordering is
*reproduced* where the whole interval of the difference is above zero, *not reproduced* where it is below, else
*undecided*."""


def page(items: Mapping[str, Item], runs: Mapping[str, Stored], smoke: bool) -> str:
    """All items, those that are not measured with what is missing."""
    parts = [HEAD, *([SMOKE] if smoke else [])]
    for name, item in items.items():
        missing = [run for run in item.runs if run not in runs]
        there = {run: runs[run] for run in item.runs if run in runs}
        parts.append(f"## {item.title}\n\n`--only {name}`")
        if smoke:
            parts.append(SMOKE)
        if there or not item.runs:
            parts.append(item.section(there))
            parts.append(made_by(list(there.values())))
        if missing:
            parts.append(textwrap.fill(f"Not measured yet: {', '.join(missing)}.", 120, break_on_hyphens=False))
    return "\n\n".join(part for part in parts if part) + "\n"


def made_by(runs: Sequence[Stored]) -> str:
    """Which commits and machines made the runs of an item."""
    commits = sorted({(run.versions.get("git_revision") or "unknown")[:7] for run in runs})
    machines = sorted({device for run in runs for device in run.versions.get("devices", [])})
    seeds = sorted({len(run.seeds) for run in runs})
    if not commits:
        return ""
    counts = f"Seeds: {', '.join(map(str, seeds))}. " if any(seeds) else ""
    chosen = sorted({seed for run in runs if run.seeds for seed in tuning.tuning_seeds(run.config, run.seeds)})
    note = f" Settings were chosen in part on seeds {tuning.in_words(chosen)} of these." if chosen else ""
    return f"{counts}Commits: {', '.join(commits)}. Hardware: {', '.join(machines)}.{note}"


def table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; '' without rows."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    if not lines:
        return ""
    return "\n".join([f"| {' | '.join(heading)} |", "|" + "---|" * len(heading), *lines])
