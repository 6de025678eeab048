"""The published program with its critic set below and above 0 at first, and as it is: whether that matters."""

from collections.abc import Mapping

from scipy import stats

from experiments.reproduction.cells import median_frames
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.published_runs import KEPT, VALUE_BIAS, VALUES
from experiments.reproduction.sections.critic_sign import Begun, begun
from experiments.reproduction.stored import Stored
from experiments.tuning import in_words
from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.comparisons import holm
from t2tl_jax.evaluation.statistics import CONFIDENCE

TRIED = f"""What the critic's start does was tried on other seeds, the next numbers, chosen before any of their outcomes
was known. Each was trained twice: once with {VALUE_BIAS:g} taken from the critic's value at first and once with as much
added, by the bias of its last layer (`network.value_bias`). The two configurations differ in nothing else, and a seed
draws the same for both; but a program by PPO on a GPU differs a little from run to run
([performance](performance.md#loops-as-cuda-graphs))."""

WITHOUT_KEPT = """These seeds were not trained without such a change, so that what is shown is a difference between the
two, and not which of them departs from the program."""
WITH_KEPT = (
    f"`{KEPT}` is the program without such a change on the same seeds, trained after the two were known and by a later "
    "commit."
)


def moved(runs: Mapping[str, Stored], published: float) -> str:
    """Outcomes of both runs, the test of who solves the task, and what it says; '' until both are there.

    Args:
        runs: those that are there.
        published: the published mean at the end.
    """
    if not runs.keys() >= VALUES.keys():
        return ""
    below, above = ({seed.seed: seed for seed in begun(runs[name])} for name in VALUES)
    both = sorted(below.keys() & above.keys())
    if not both:
        return ""
    pairs = [(below[seed], above[seed]) for seed in both]
    rows = [_row(name, of) for name, of in zip(VALUES, zip(*pairs, strict=True), strict=True)]
    kept = {seed.seed: seed for seed in begun(runs[KEPT])} if KEPT in runs else {}
    known, departs = WITHOUT_KEPT, ""
    if kept.keys() >= set(both):
        rows.insert(1, _row(KEPT, tuple(kept[seed] for seed in both)))
        changed = dict(zip(VALUES, (below, above), strict=True))
        known = WITH_KEPT
        departs = _departs({name: [(of[seed], kept[seed]) for seed in both] for name, of in changed.items()})
    heading = (
        *("run", "seeds", "begin below 0", "solved", "return at the end"),
        "frames until the noise is at its limit, median",
    )
    parts = (f"{TRIED} {known}", table(heading, rows), _said(pairs, published), departs)
    return "\n\n".join(part if part.startswith("|") else paragraph(part) for part in parts if part)


def _row(name: str, seeds: tuple[Begun, ...]) -> tuple[str, ...]:
    return (
        name,
        in_words([seed.seed for seed in seeds]),
        f"{sum(seed.value < 0 for seed in seeds)}/{len(seeds)}",
        f"{sum(seed.solved for seed in seeds)}/{len(seeds)}",
        statistics.mean([seed.end for seed in seeds]).text(),
        median_frames([seed.limit for seed in seeds]),
    )


def _mcnemar(pairs: list[tuple[Begun, Begun]]) -> tuple[int, int, float]:
    """How many seeds solve the task with the first start alone, how many with the second, and the exact test's p."""
    low, high = (sum(a.solved and not b.solved for a, b in some) for some in (pairs, [(b, a) for a, b in pairs]))
    return low, high, float(stats.binomtest(low, low + high).pvalue) if low + high else 1.0


def _departs(pairs: Mapping[str, list[tuple[Begun, Begun]]]) -> str:
    """Each changed start against the program as it is, corrected for both comparisons by Holm.

    pairs: of each changed run its seeds and the same ones of the program as it is.
    """
    found = {name: _mcnemar(some) for name, some in pairs.items()}
    corrected = holm([p for _, _, p in found.values()])
    said = []
    for (name, (more, fewer, _)), p in zip(found.items(), corrected, strict=True):
        gap = statistics.mean([a.end - b.end for a, b in pairs[name]])
        shown = "no difference is shown" if p >= 1 - CONFIDENCE else "more do" if more > fewer else "fewer do"
        said.append(
            f"{name}: {more} solve the task only with it and {fewer} only without ({shown}; p {p:.2g}); return at the "
            f"end, with it less without: {gap.text()}"
        )
    return (
        "That test was planned before there was a run of the program as it is. Beside this run, by the same test "
        f"corrected for two: {'; '.join(said)}."
    )


def _said(pairs: list[tuple[Begun, Begun]], published: float) -> str:
    low, high, p = _mcnemar(pairs)
    gap = statistics.mean([a.end - b.end for a, b in pairs])
    if p < 1 - CONFIDENCE and low > high:
        shown = (
            f"So a critic that is set {2 * VALUE_BIAS:g} lower at first makes more seeds solve the task, as the "
            "inference has it. Whether the sign counts or how far from 0 it is, and whether it works through the "
            "noise, the test does not say."
        )
    elif p < 1 - CONFIDENCE:
        shown = "So a critic that is set lower at first makes fewer seeds solve the task, against the inference."
    else:
        shown = "So it is not shown that where the critic begins makes a difference."
    end = statistics.mean([a.end for a, _ in pairs])
    rest = (
        f" Below 0 the return at the end, {end.text()}, is still below the published mean, {published:.2f}: "
        "where the critic begins does not explain all of it."
        if end.high is not None and end.high < published
        else f" Below 0 the return at the end is {end.text()}; published is a mean of {published:.2f}."
    )
    return (
        f"Only with the lower start {low} of them solve the task, and only with the higher one {high} (McNemar's exact "
        f"test, two-sided: p {p:.2g}). The return at the end is higher with the lower start by {gap.text()}, paired. "
        f"{shown}{rest}"
    )
