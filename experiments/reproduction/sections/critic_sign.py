"""How seeds of the published program come out by the sign of the critic that they begin with."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from experiments.reproduction.cells import median_frames, text
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.sections.figures import MOST_ENTROPY, NEAR
from experiments.reproduction.stored import Stored
from experiments.tuning import in_words
from t2tl_jax.evaluation.comparisons import holm
from t2tl_jax.evaluation.statistics import CONFIDENCE, SOLVED

WHAT = """The sign is that of the critic's value in the first iteration of training, which is stored as the mean over
its gradient steps. The weights of the value are drawn evenly about 0, so that half of all seeds should begin below
0."""

WHY = """What the sign does is our inference. Successes are rare at first, a time-out is an end, and
advantages are not normalised. What a step does is then hardly ever paid, so that its advantage has on average the
opposite sign of the value. Above 0 most actions seem worse than was expected: the policy moves away from what it does,
and its noise soon grows to its limit. Below 0 most seem better, which holds the noise back."""

TESTED = """That the sign might matter was seen on seeds 24 to 35, so that nothing is tested on them. Seeds from 36 on
are the next numbers, chosen before any of their outcomes was known. Tests are two-sided: Fisher's exact one for who
solves the task, Mann and Whitney's for the frames. They are corrected for four by Holm, even where fewer are made."""

TESTS = 4
"""Two of each of the two runs on new seeds."""


@dataclass(frozen=True)
class Begun:
    """One seed: how it began, and what came of it."""

    seed: int
    value: float
    """Of the critic in the first iteration."""
    limit: float
    """Frames until the noise of the policy was first at its limit; inf if it never was."""
    solved: bool
    end: float
    """Return at the end."""


def begun(run: Stored) -> list[Begun]:
    """The seeds of a run; none where it is not known how they began, or what came of them."""
    curves, rates = run.metrics, run.by_seed("success_rate")
    if not {"value", "entropy"} <= curves.keys() or run.columns["iteration"].min() != 1:
        return []
    at_limit = curves["entropy"] > MOST_ENTROPY - NEAR
    limits = np.where(at_limit, curves["frames"], np.inf).min(axis=1)
    firsts, ends = curves["value"][:, 0], run.end("discounted_return")
    return [
        Begun(seed, float(first), float(limit), rates[seed] > SOLVED, ends[seed])
        for seed, first, limit in zip(run.seeds, firsts, limits, strict=True)
        if seed in rates
    ]


def by_sign(runs: Mapping[str, Stored], groups: Mapping[str, Sequence[str]], tested: Sequence[str]) -> str:
    """Outcomes by sign of every run and of groups of them, tests of some, and what that says; '' where it is unknown.

    Args:
        runs: those that are there.
        groups: by what they are called, names of runs that are also counted together once all are there.
        tested: names of the runs that are tested.
    """
    seeds = {name: found for name, run in runs.items() if (found := begun(run))}
    if not seeds:
        return ""
    joint = {
        label: [seed for name in names for seed in seeds[name]]
        for label, names in groups.items()
        if seeds.keys() >= set(names)
    }
    rows = [row for name, some in (seeds | joint).items() for row in _rows(name, some)]
    heading = (
        *("run", "value at first", "seeds", "solved", "return at the end"),
        "frames until the noise is at its limit, median",
    )
    new = {name: seeds[name] for name in tested if name in seeds}
    said = (f"{WHAT} {counted(seeds)}", f"{TESTED} {compared(new)}", f"{WHY} {shared(seeds, groups)}")
    before, *after = (paragraph(one) for one in said)
    return "\n\n".join((before, table(heading, rows), *after))


def _rows(name: str, seeds: Iterable[Begun]) -> list[tuple[str, ...]]:
    return [
        (
            name,
            kind,
            str(len(some)),
            f"{sum(seed.solved for seed in some)}/{len(some)}",
            text([seed.end for seed in some]),
            median_frames([seed.limit for seed in some]),
        )
        for kind, some in zip(("below 0", "0 or above"), split(seeds), strict=True)
        if some
    ]


def split(seeds: Iterable[Begun]) -> tuple[list[Begun], list[Begun]]:
    """Those that begin with a value below 0, and the others."""
    seeds = list(seeds)
    return [seed for seed in seeds if seed.value < 0], [seed for seed in seeds if not seed.value < 0]


def counted(seeds: Mapping[str, Sequence[Begun]]) -> str:
    """How many seeds of each run begin below 0."""
    each = []
    for name, some in seeds.items():
        low = [seed.seed for seed in split(some)[0]]
        which = f" ({in_words(low)})" if low else ""
        each.append(f"{len(low)} of {len(some)}{which} in {name}")
    return f"Below 0 begin {'; '.join(each)}."


def compared(seeds: Mapping[str, Sequence[Begun]]) -> str:
    """Whether the outcomes differ by sign, in words; runs with seeds of one sign alone are not tested."""
    halves = {name: split(some) for name, some in seeds.items() if all(split(some))}
    found = [test(*of) for of in halves.values() for test in (_solved, _limits)]
    corrected = holm([*found, *[1.0] * (TESTS - len(found))]).tolist()
    said = []
    for number, (name, (low, high)) in enumerate(halves.items()):
        first, second = corrected[2 * number : 2 * number + 2]
        counts = [f"{sum(seed.solved for seed in some)} of {len(some)}" for some in (low, high)]
        more = np.sign(_share(low) - _share(high))
        later = np.sign(sum(np.sign(_gap(a.limit, b.limit)) for a in low for b in high))
        said.append(
            f"In {name} {counts[0]} seeds below 0 solve the task and {counts[1]} others: "
            f"{_in_words(first, more, 'that is more', 'that is less')}. "
            f"When the noise comes to its limit: {_in_words(second, later, 'later below 0', 'sooner below 0')}."
        )
    return " ".join(said) or "None of them can be made so far."


def _in_words(p: float, sign: float, more: str, less: str) -> str:
    shown = p < 1 - CONFIDENCE and sign != 0
    return f"{(more if sign > 0 else less) if shown else 'no difference is shown'} (p {p:.2g})"


def _share(seeds: Sequence[Begun]) -> float:
    return sum(seed.solved for seed in seeds) / len(seeds)


def _gap(first: float, second: float) -> float:
    return 0.0 if first == second else first - second  # both may be inf


def _solved(low: Sequence[Begun], high: Sequence[Begun]) -> float:
    counts = [[sum(seed.solved is kind for seed in some) for kind in (True, False)] for some in (low, high)]
    return float(stats.fisher_exact(counts).pvalue)


def _limits(low: Sequence[Begun], high: Sequence[Begun]) -> float:
    limits = [[seed.limit for seed in some] for some in (low, high)]
    if len({limit for some in limits for limit in some}) < 2:
        return 1.0
    return float(stats.mannwhitneyu(*limits).pvalue)


def shared(seeds: Mapping[str, Sequence[Begun]], groups: Mapping[str, Sequence[str]]) -> str:
    """That runs of the same seeds share their draws, and how often their signs agree; '' without two such runs."""
    said = []
    for first, second in zip(*groups.values(), strict=True):
        signs = [{seed.seed: seed.value < 0 for seed in seeds.get(name, ())} for name in (first, second)]
        both = sorted(signs[0].keys() & signs[1].keys())
        others = [seed for seed in both if signs[0][seed] != signs[1][seed]]
        if both:
            not_these = f" (not in {in_words(others)})" if others else ""
            said.append(f"in {len(both) - len(others)} of {len(both)} seeds of {first} and {second}{not_these}")
    if not said:
        return ""
    return (
        "Both methods draw the same parameters from a seed where their networks are alike, so that their outcomes are "
        f"not independent: the sign is the same {', and '.join(said)}."
    )
