"""The same training once more: how far two runs of one method are apart, and what becomes of the paper's orderings."""

from collections.abc import Mapping

from experiments.paper.published_water import EPISODES
from experiments.reproduction.claims import compared
from experiments.reproduction.page import paragraph
from experiments.reproduction.runs import WATER_METHODS, again_name
from experiments.reproduction.sections import figures
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import mean_return_at, methods
from t2tl_jax.evaluation.comparisons import outcome

PAIRS = [(f"water-{method}", again_name(f"water-{method}")) for method in WATER_METHODS]
"""Each method's main run, and the same once more."""

OTHER = "water-rm-6"
"""What the paper's orderings compare besides; it was trained once."""

RUNS = (*(name for pair in PAIRS for name in pair), OTHER)

CLAIMS = [
    (first if first == OTHER else again_name(first), than if than == OTHER else again_name(than))
    for first, than in figures.WATER_CLAIMS
]
"""The paper's orderings of the second runs."""

SAME = """Both runs of a method have its seeds, maps and settings; encoders were pre-trained anew, from the same seeds.
Between the commits the program changed as well, and compilers choose kernels anew, so what makes them differ is not
known. Intervals over seeds contain such chance; counts of solved seeds and outcomes near an edge flip by it. Ablations
share commits and pre-trainings with the main runs more than with these."""


def once_more(runs: Mapping[str, Stored]) -> str:
    """Final figures of both runs of every method, their differences, the paper's orderings of the second runs and which
    outcomes are others, and how far the solved seeds are apart."""
    there = [(first, again) for first, again in PAIRS if first in runs and again in runs]
    if not there:
        return ""
    shown = {name: runs[name] for pair in there for name in pair}
    parts = (
        methods(shown, {name: name for name in shown}),
        figures.water_order(runs, PAIRS),
        figures.water_order(runs, CLAIMS, CLAIMS),
        paragraph(" ".join((_changed(runs), _apart(shown), SAME))),
    )
    return "\n\n".join(part for part in parts if part)


def _changed(runs: Mapping[str, Stored]) -> str:
    """The paper's orderings whose outcomes differ between main and second runs."""
    values = {name: mean_return_at(run, EPISODES) for name, run in runs.items()}
    main, second = (compared(runs, claims, values)[1] for claims in (figures.WATER_CLAIMS, CLAIMS))
    each = [
        (f"{first} > {than}", outcome(main[first, than].gap), outcome(second[again].gap))
        for (first, than), again in zip(figures.WATER_CLAIMS, CLAIMS, strict=True)
        if (first, than) in main and again in second
    ]
    flipped = [f"{claim} ({one}, with the second runs {other})" for claim, one, other in each if one != other]
    if not each:
        return ""
    return f"Outcomes that are others: {'; '.join(flipped)}." if flipped else "All outcomes are those of the main runs."


def _apart(runs: Mapping[str, Stored]) -> str:
    """Of the methods whose two runs differ most in how many seeds solved the task; '' where that is not known."""
    counts = {name: run.solved() for name, run in runs.items()}
    if any(one.value is None for one in counts.values()):
        return ""
    solved = {name: round((one.value or 0.0) * one.count) for name, one in counts.items()}
    gaps = {first: abs(solved[first] - solved[again]) for first, again in PAIRS if first in solved}
    most = [
        f"{first.removeprefix('water-')} ({solved[first]} and {solved[again_name(first)]})"
        for first in gaps
        if gaps[first] == max(gaps.values())
    ]
    same = [first for first, again in PAIRS if first in runs and _equal(runs[first], runs[again])]
    equal = f" Equal returns in training: {', '.join(name.removeprefix('water-') for name in same)}." if same else ""
    total = next(iter(counts.values())).count
    span = f"{min(gaps.values())} to {max(gaps.values())} of {total}"
    return f"Solved seeds are apart by {span}, most for {', '.join(most)}.{equal}"


def _equal(one: Stored, other: Stored) -> bool:
    return one.area("discounted_return") == other.area("discounted_return")
