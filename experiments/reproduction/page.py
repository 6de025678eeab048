"""The page of results: every item as Markdown, from stored runs alone."""

import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from experiments import tuning
from experiments.reproduction.plan import Item
from experiments.reproduction.stored import Stored
from t2tl_jax.runs import faults

SMOKE = "**Smoke test: tiny networks and budgets, closed-form physics. These figures mean nothing.**"

HEAD = "# The paper, measured again"

MOST_NAMED = 20
"""So many runs of an item that are missing are named."""

TERMS = """\
Return: average discounted return of the sampled policy over the last 5 % of training. Solved: seeds whose final
parameters succeed in over 95 % of the evaluation's sampled episodes; the deterministic policy is counted likewise, but
where everything is fixed, as in all items here, it has one episode a seed. Curves by episode: a seed that plays fewer
counts with what it came to. Brackets are 95 % intervals: Student's t over seeds for means, Wilson for shares;
differences are Welch's, or paired where seed k has the same map in both runs, and corrected for the number of
comparisons of a table, be all of its runs there or not (Bonferroni). p is that of a two-sided permutation test, by
Holm's correction; outcomes go by the interval alone, so that the two can differ near the edge. Interquartile means
have bootstrap intervals (BCa), which with a dozen seeds cover somewhat less than 95 %.
Intervals of means and of differences know of no failure that the seeds do not show: where one training in twelve fails,
a dozen often show none, and such an interval misses the true value in a third of the cases instead of a twentieth.
Shares have Wilson's, which allow for it.
Where a table says that it is of episodes without discount, it is not that return.
Seconds are upper bounds, of runs that shared a GPU with different others and were not all made by one commit: they do
not compare methods. An encoder goes on from the best parameters of its pre-training, which a seed may have lost again
by its end.
Runs that were made at different times or on different machines began with pre-trainings of their own, from the same
seeds; a GPU does not repeat them exactly, and one of them is stored. Sections name such runs. Frames before are those
of a run's own.
A difference without an interval: every seed of both runs came to the same, which does not make it sure.
Values with "±" are as published, a spread that is not said what it is. A claimed ordering is *reproduced* where the
whole interval of the difference is above zero, *not reproduced* where it is below, else *undecided*."""


def page(
    items: Mapping[str, Item],
    runs: Mapping[str, Stored],
    smoke: bool,
    head: str = HEAD,
    pictures: Mapping[str, str] | None = None,
    terms: str = TERMS,
    summary: Callable[[Mapping[str, str]], str] | None = None,
    remark: Callable[[Mapping[str, Stored]], str] | None = None,
) -> str:
    """All items, those that are not measured with what is missing.

    Args:
        items: by the name that ``--only`` takes.
        runs: those that are stored, by name.
        smoke: whether they are of a smoke test, which is then said beside every item.
        head: what the page begins with.
        pictures: by the name of an item, the line that shows its picture.
        terms: what words and brackets mean.
        summary: of all sections, by item: what stands before them.
        remark: of the runs of an item: what else there is to say of them.
    """
    parts, sections = [], {}
    for name, item in items.items():
        missing = [run for run in item.runs if run not in runs]
        there = {run: runs[run] for run in (*item.beside, *item.runs) if run in runs}
        parts.append(f"## {item.title}\n\n    python -m experiments.reproduce --only {name}")
        if smoke:
            parts.append(SMOKE)
        section = item.section(there) if there or not item.runs else ""
        sections[name] = section
        if section:
            said = remark(there) if remark else ""
            parts += [fitting(section), (pictures or {}).get(name, ""), said, made_by(list(there.values()))]
        if missing:
            parts.append(paragraph(f"Not measured yet: {named(missing)}."))
    before = [head, SMOKE if smoke else "", terms, summary(sections) if summary else ""]
    return "\n\n".join(part for part in (*before, *parts) if part) + "\n"


def named(runs: Sequence[str]) -> str:
    """Names of runs in a sentence: of many the first ones, and how many others there are."""
    shown = runs if len(runs) <= MOST_NAMED else runs[: MOST_NAMED - 1]
    others = len(runs) - len(shown)
    return ", ".join(shown) + (f" and {others} others" if others else "")


def fitting(text: str) -> str:
    """A text whose long lines are broken, but for tables, commands and pictures."""
    lines = text.splitlines()
    return "\n".join(line if line.startswith(("|", "    ", "!")) else paragraph(line) for line in lines)


def paragraph(text: str) -> str:
    """A text broken into lines that fit, at spaces alone."""
    return textwrap.fill(" ".join(text.split()), 120, break_on_hyphens=False, break_long_words=False)


def made_by(runs: Sequence[Stored]) -> str:
    """Which commits, machines and versions made the runs of an item, and on which seeds settings were chosen."""
    if not runs:
        return ""
    seeds = sorted({len(run.seeds) for run in runs if run.seeds})
    counts = f"Seeds: {', '.join(map(str, seeds))}. " if seeds else ""
    chosen = sorted({seed for run in runs if run.seeds for seed in tuning.tuning_seeds(run.config, run.seeds)})
    note = f" Settings were chosen in part on seeds {tuning.in_words(chosen)} of these." if chosen else ""
    broken = [
        f"{run.path.name} seed {seed} after {entry['frames']:,} frames ({entry['cause']})"
        for run in runs
        for seed, entry in run.status.get(faults.NAME, {}).items()
    ]
    note += f" Frozen, and shown as they were then: {'; '.join(broken)}." if broken else ""
    return paragraph(f"{counts}{origin([run.versions for run in runs])}{note}")


def origin(versions: Sequence[Mapping[str, Any]]) -> str:
    """Commits, hardware and versions of JAX, as runs and benchmarks store them."""
    commits = sorted({commit(one) for one in versions})
    machines = sorted({_machine(one) for one in versions})
    jax = sorted({one.get("packages", {}).get("jax") or "unknown" for one in versions})
    return f"Commits: {', '.join(commits)}. Hardware: {', '.join(machines)}. JAX {', '.join(jax)}."


def commit(versions: Mapping[str, Any]) -> str:
    """The commit that something was made from, in short."""
    return (versions.get("git_revision") or "unknown")[:7]


def _machine(versions: Mapping[str, Any]) -> str:
    """The accelerators, with how many there were if several; a processor with how many devices it was to JAX, and its
    own name."""
    devices = versions.get("devices", [])
    if set(devices) == {"cpu"}:
        return f"{len(devices)} x CPU ({versions.get('cpu') or 'unknown'})"
    kinds = sorted(Counter(devices).items())
    return ", ".join(kind if count == 1 else f"{count} x {kind}" for kind, count in kinds) or "unknown"


def table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; '' without rows."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    if not lines:
        return ""
    return "\n".join([f"| {' | '.join(heading)} |", "|" + "---|" * len(heading), *lines])
