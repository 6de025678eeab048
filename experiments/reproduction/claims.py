"""What becomes of the orderings that the paper claims: differences between runs, and shares of seeds."""

from collections.abc import Mapping

import numpy as np

from experiments.reproduction.page import paragraph, table
from experiments.reproduction.stored import Stored
from experiments.worlds import worlds
from t2tl_jax.evaluation.comparisons import Difference, Outcome, Pairs, compare, outcome
from t2tl_jax.evaluation.statistics import CONFIDENCE, Estimate, score_interval

Values = Mapping[str, Mapping[int, float]]
"""By run and seed."""

UNKNOWN = ("", "")
"""In the place of a pair that is counted and not compared."""

Share = tuple[float, int]
"""A share of seeds, or the mean over seeds of shares, and how many seeds there are."""


def differences(
    runs: Mapping[str, Stored], pairs: Pairs, values: Values, unit: str, claims: Pairs = (), less: bool = False
) -> str:
    """The first run of each pair against the second, corrected for so many pairs, be all of them measured or not.

    Args:
        runs: those that are there.
        pairs: names of runs, all that are planned.
        values: by run and seed, what is compared; seeds of which it is not known are left out, and named.
        unit: what that is, in words.
        claims: those of the pairs of which the paper says that the first run is better; it is said what becomes of it.
        less: whether less is better; then a difference is how much less the first run has.

    Raises:
        ValueError: for a claim that is not among the pairs.
    """
    if unplanned := [pair for pair in claims if pair not in pairs]:
        raise ValueError(f"claims are some of the planned pairs; not among them: {unplanned}")
    known, found = compared(runs, pairs, values, less)
    rows = []
    for (first, second), each in found.items():
        claimed = (first, second) in claims
        between = ("<" if less else ">") if claimed else "-"
        rows.append(
            (
                f"{first} {between} {second}",
                each.gap.text(),
                f"{each.pvalue:.3g}",
                each.improvement.text(2),
                "paired" if each.paired else "",
                *([outcome(each.gap) if claimed else "not claimed"] if claims else []),
            )
        )
    unequal = unequal_budgets(runs, pairs)
    if not rows:
        return _not_compared(unequal)
    heading = [
        "claim" if claims else "runs",
        f"how much less: {unit}" if less else f"difference, {unit}",
        "p (Holm)",
        "probability of improvement",
        "",
        *(["outcome"] if claims else []),
    ]
    below = _corrected(len(found), len(pairs)) + _left_out(known, values)
    return "\n\n".join(part for part in (table(heading, rows), below, _not_compared(unequal)) if part)


def compared(
    runs: Mapping[str, Stored], pairs: Pairs, values: Values, less: bool = False
) -> tuple[Values, dict[tuple[str, str], Difference]]:
    """What `differences` shows: the values that are known, as they are compared, and the differences by pair; of pairs
    that were to have different numbers of frames there is none, as if they were not measured yet."""
    sign = -1.0 if less else 1.0
    known = {
        name: {seed: sign * value for seed, value in values[name].items() if np.isfinite(value)}
        for name in runs
        if name in values
    }
    unequal = unequal_budgets(runs, pairs)
    planned = [UNKNOWN if pair in unequal else pair for pair in pairs]
    return known, compare(known, {name: worlds(runs[name].config, tuple(runs[name].seeds)) for name in known}, planned)


def unequal_budgets(runs: Mapping[str, Stored], pairs: Pairs) -> list[tuple[str, str]]:
    """Pairs of runs that are there of which one was to have more frames than the other."""
    there = [pair for pair in pairs if all(name in runs for name in pair)]
    return [pair for pair in there if len({runs[name].config.frames for name in pair}) > 1]


def _not_compared(unequal: Pairs) -> str:
    each = [f"{first} and {second}" for first, second in unequal]
    return paragraph(f"Not compared, since one had more frames than the other: {'; '.join(each)}.") if each else ""


def majorities(shares: Mapping[str, Share | None]) -> str:
    """Claims about one agent, asked of many: whether they hold for more than half, corrected for all claims.

    Args:
        shares: by claim, of how many seeds or, as a mean over seeds, of how many episodes it holds; None where that is
            not known yet.
    """
    level = 1 - (1 - CONFIDENCE) / max(len(shares), 1)
    known = {claim: score_interval(*found, level) for claim, found in shares.items() if found is not None and found[1]}
    rows = [(claim, found.text(2), str(found.count), half(found)) for claim, found in known.items()]
    if not rows:
        return ""
    heading = ("claim", "share", "seeds", "outcome: over one half")
    return f"{table(heading, rows)}\n\n{_corrected(len(known), len(shares))}"


def half(share: Estimate) -> Outcome:
    """Whether a share lies above one half."""

    def less(part: float | None) -> float | None:
        return None if part is None else part - 0.5

    return outcome(Estimate(less(share.value), less(share.low), less(share.high), share.count))


def _corrected(made: int, planned: int) -> str:
    so_far = "" if made == planned else f", {made} of which can be made so far"
    return f"Corrected for {planned} comparison{'' if planned == 1 else 's'}{so_far}."


def _left_out(known: Values, values: Values) -> str:
    fewer = [
        f"{name} {len(values[name]) - len(known[name])} of {len(values[name])}"
        for name in known
        if len(known[name]) < len(values[name])
    ]
    return f" Seeds left out, of which this is not known: {', '.join(fewer)}." if fewer else ""
