"""The same training once more: how far two runs of one method are apart that differ in nothing but commit and day."""

from collections.abc import Mapping

from experiments.reproduction.page import paragraph
from experiments.reproduction.runs import WATER_METHODS, again_name
from experiments.reproduction.sections import figures
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import methods

PAIRS = [(f"water-{method}", again_name(f"water-{method}")) for method in WATER_METHODS]
"""Each method's main run, and the same once more."""

RUNS = tuple(name for pair in PAIRS for name in pair)

SAME = """Both runs of a method have its seeds, maps and settings, and begin with pre-trainings of their own from the
same seeds. They were made on different days by different commits, beside different runs, and the main runs are the
later ones, whose parameters are stored. What makes them differ was not looked for: a compiler that chooses kernels
anew and sums that a GPU adds up in another order are enough, since what follows from a last digit grows in training.
Every table of WaterWorld has this much chance beside that of the seeds."""


def once_more(runs: Mapping[str, Stored]) -> str:
    """Final figures of both runs of every method, their differences, and how far the solved seeds are apart."""
    there = [(first, again) for first, again in PAIRS if first in runs and again in runs]
    if not there:
        return ""
    shown = {name: runs[name] for pair in there for name in pair}
    parts = (
        methods(shown, {name: name for name in shown}),
        figures.water_order(runs, PAIRS),
        paragraph(SAME + _apart(shown)),
    )
    return "\n\n".join(part for part in parts if part)


def _apart(runs: Mapping[str, Stored]) -> str:
    """Of the method whose two runs differ most in how many seeds solved the task; '' where that is not known."""
    counts = {name: run.solved() for name, run in runs.items()}
    if any(one.value is None for one in counts.values()):
        return ""
    solved = {name: round((one.value or 0.0) * one.count) for name, one in counts.items()}
    gaps = {first: abs(solved[first] - solved[again]) for first, again in PAIRS if first in solved}
    widest = max(gaps, key=lambda name: gaps[name])
    same = [first for first, again in PAIRS if first in runs and _equal(runs[first], runs[again])]
    equal = f" Equal in every seed: {', '.join(name.removeprefix('water-') for name in same)}." if same else ""
    return (
        f"{equal} Solved seeds are apart by {min(gaps.values())} to {gaps[widest]} of {counts[widest].count}, most for "
        f"{widest.removeprefix('water-')}: {solved[widest]} and {solved[again_name(widest)]}."
    )


def _equal(one: Stored, other: Stored) -> bool:
    return one.area("discounted_return") == other.area("discounted_return")
