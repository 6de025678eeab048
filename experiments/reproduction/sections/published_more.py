"""The published program on more seeds, beside the runs before and the published means."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.paper import published_widths
from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction import below
from experiments.reproduction.cells import COST, cost
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.published_runs import KEPT, VALUES
from experiments.reproduction.sections.critic_moved import moved
from experiments.reproduction.sections.critic_sign import begun, by_sign, split
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import curves_by_frames
from experiments.tuning import in_words
from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.statistics import SOLVED, Estimate

BEFORE = ("zone-published-t1tl", "zone-published")
"""The runs of the sections before, of T1TL and of T2TL."""

MORE = ("zone-published-t1tl-more", "zone-published-t2tl-more")
"""The same on more seeds."""

GROUPS = {"T1TL, all": (BEFORE[0], MORE[0]), "T2TL, all": (BEFORE[1], MORE[1])}
"""What is also shown together."""

_T1TL = (published_widths.FRAMES, published_widths.ZONE["T1TL 16"])
_T2TL = ZONE_CURVES["T2TL_pre (published)"]
PUBLISHED = {name: curve for names, curve in zip(GROUPS.values(), (_T1TL, _T2TL), strict=True) for name in names}
"""The published curve of each run: that of T1TL is without pre-training, that of T2TL after it."""

DIFFER = """Of T2TL's seeds the first 12 are by MJX and without the first token of the window, the others in closed form
and with it; all of T1TL's are in closed form."""

EMPTY = """An empty window is zeros to the published reader, whose gradient there can be very large. Every training
begins with such windows, unless they hold the made-up first token of the authors' code ([methods](methods.md))."""

UNKNOWN = """The split by sign was made after the results were seen. It does not compare with the published means,
whose seeds and signs are not known; how far they would differ with other seeds is not counted."""


def more_seeds(runs: Mapping[str, Stored]) -> str:
    """Final figures, by themselves and together, the curves of the new runs, outcomes by the critic's sign and by
    setting it, and what remains."""
    if not runs:
        return ""
    with_bias = {name: runs[name] for name in (*VALUES, KEPT) if name in runs}
    runs = {name: run for name, run in runs.items() if name not in with_bias}
    new = {name: runs[name] for name in MORE if name in runs}
    published = {name: PUBLISHED[name] for name in new}
    labels = {name: name for name in new}
    parts = (
        _figures(runs) if runs else "",
        paragraph(DIFFER) if set(GROUPS["T2TL, all"]) <= runs.keys() else "",
        curves_by_frames(new, labels, published_widths.FRAMES, published) if new else "",
        below.by_frames(new, published, published_widths.FRAMES),
        by_sign(runs, GROUPS, MORE),
        moved(with_bias, _T1TL[1][-1]),
        first_gradients(runs),
        remains(runs) if runs else "",
    )
    return "\n\n".join(part for part in parts if part)


def _together(runs: Mapping[str, Stored]) -> dict[str, Sequence[str]]:
    """Names of runs by what a line is called: each by itself, and groups that are complete."""
    alone: dict[str, Sequence[str]] = {name: (name,) for name in runs}
    return alone | {label: names for label, names in GROUPS.items() if runs.keys() >= set(names)}


def _figures(runs: Mapping[str, Stored]) -> str:
    rows = []
    for label, names in _together(runs).items():
        some = [runs[name] for name in names]
        rates = [rate for run in some for rate in run.by_seed("success_rate").values()]
        solved = sum(rate > SOLVED for rate in rates)
        end, curve = _end(some), PUBLISHED[names[0]]
        rows.append(
            (
                label,
                ", ".join(in_words(run.seeds) for run in some),
                f"{solved}/{len(rates)}" if rates else "-",
                statistics.rate(solved, len(rates)).text(),
                end.text(),
                f"{curve[1][-1]:.2f}",
                place(end, curve[1][-1]),
                *(cost(some[0]) if len(some) == 1 else ["-"] * len(COST)),
            )
        )
    heading = (
        *("run", "seeds", "solved", "share of seeds", "return at the end", "published"),
        *("published mean and our interval", *COST),
    )
    return table(heading, rows)


def _end(runs: Sequence[Stored]) -> Estimate:
    return statistics.mean([value for run in runs for value in run.end("discounted_return").values()])


def place(ours: Estimate, published: float) -> str:
    """Where a published mean lies."""
    if ours.low is None or ours.high is None:
        return "no interval"
    return "above it" if published > ours.high else "below it" if published < ours.low else "in it"


def remains(runs: Mapping[str, Stored]) -> str:
    """What all seeds of each method that there are, and the new ones alone, say of the published mean; and what the
    new ones of each sign come to."""
    said = []
    for method, names in zip(("T1TL without pre-training", "T2TL with its pre-training"), GROUPS.values(), strict=True):
        there = [name for name in names if name in runs]
        if not there:
            continue
        published = PUBLISHED[names[0]][1][-1]
        end = _end([runs[name] for name in there])
        said.append(
            f"{method}, {end.count} seeds: {end.text()}, which {_WORDS[place(end, published)]} mean, {published:.2f}."
        )
        if len(there) > 1:
            end = _end([runs[names[1]]])
            said.append(f"The {end.count} new ones alone: {end.text()}, which {_WORDS[place(end, published)]} mean.")
        low, high = split(begun(runs[names[1]]) if names[1] in runs else ())
        if len(low) > 1 and len(high) > 1:
            of_sign = [statistics.mean([seed.end for seed in some]).text() for some in (low, high)]
            said.append(
                f"Of those {len(low)} begin below 0 and come to {of_sign[0]}, {len(high)} others to {of_sign[1]}."
            )
    return paragraph(" ".join(["What remains, by the return at the end.", *said, UNKNOWN]))


_WORDS = {
    "above it": "is below the published",
    "in it": "is not shown to differ from the published",
    "below it": "is above the published",
    "no interval": "has no interval yet to compare with the published",
}

FAR = 100.0
"""So many times the median over seeds is a gradient of another size."""


def first_gradients(runs: Mapping[str, Stored]) -> str:
    """How large the gradients of the first iteration are with and without the first token; '' where it is unknown."""
    said = []
    for name in (BEFORE[1], MORE[1]):
        if name not in runs or "gradient_norm" not in runs[name].metrics:
            continue
        run = runs[name]
        learner: Any = run.config.learner
        first = dict(zip(run.seeds, run.metrics["gradient_norm"][:, 0].tolist(), strict=True))
        usual = FAR * float(np.median(list(first.values())))
        large = [f"{size:,.0f} in seed {seed}" for seed, size in first.items() if size > usual]
        others = max(size for size in first.values() if not size > usual)
        token = "without" if learner.network.context.first_token == "none" else "with"
        rest = f"at most {others:.2f} in the others" if large else f"at most {others:.2f}"
        said.append(f"{', '.join([*large, rest])} ({name}, {token} it)")
    if not said:
        return ""
    return paragraph(f"{EMPTY} Mean norm of the gradient in the first iteration: {'; '.join(said)}.")
