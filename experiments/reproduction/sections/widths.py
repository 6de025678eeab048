"""The figure of widths of codes: the two comparisons of the paper, each beside the values read off it."""

from collections.abc import Mapping

import numpy as np

from experiments.paper import published_widths
from experiments.reproduction import below
from experiments.reproduction.cells import COST, cost, solved, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.settings import what_differs
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import (
    MEAN_AT_EPISODES,
    curves_by_episode,
    curves_by_frames,
    mean_return_at,
    returns_at,
)

WATER = {
    "water-t1tl-8": "T1TL_pre 8",
    "water-t1tl-16": "T1TL_pre 16",
    "water-t1tl": "T1TL_pre 32",
    "water-rm-6": "RM 6",
    "water-rm": "RM 16",
    "water-rm-32": "RM 32",
}
"""Runs by the names of the paper's curves."""

ZONE = {
    "zone-t1tl-fresh-8": "T1TL 8",
    "zone-t1tl-fresh-16": "T1TL 16",
    "zone-t1tl-fresh-32": "T1TL 32",
    "zone-dfa_number": "DFA 1",
    "zone-dfa": "DFA 16",
    "zone-dfa-32": "DFA 32",
}

WATER_CLAIMS = [
    ("water-t1tl", "water-t1tl-16"),
    ("water-t1tl", "water-t1tl-8"),
    ("water-t1tl-8", "water-rm-6"),
    ("water-t1tl-16", "water-rm"),
    ("water-t1tl", "water-rm-32"),
]
"""32 numbers are the best of the Transformer's, and each of its codes is above the machine's of like width."""

ZONE_CLAIMS = [
    ("zone-t1tl-fresh-16", other)
    for other in ("zone-t1tl-fresh-8", "zone-t1tl-fresh-32", "zone-dfa_number", "zone-dfa", "zone-dfa-32")
]
"""16 numbers are the best of the Transformer's, and above every code of the automaton."""

NOTE = """The text says that 16 numbers do well for T1TL in ZoneEnv; the other claims are orders that the curves show.
They do not show that the Transformer is better at every width: in ZoneEnv its 32 numbers end below the DFA's."""


EARLY = """The early episodes are those of the six methods, with the same default settings: see
`--only water-beginning` for what was found of them."""


def dimensions(runs: Mapping[str, Stored]) -> str:
    """Both comparisons: final figures, curves, and the published order."""
    parts = [part for part in (_water(runs), _zone(runs)) if part]
    return "\n\n".join([*parts, NOTE]) if parts else ""


def _water(runs: Mapping[str, Stored]) -> str:
    """Compared by the mean return at the episodes at which the picture was read."""
    marks = published_widths.EPISODES
    shown = {name: runs[name] for name in WATER if name in runs}
    if not shown:
        return ""
    means = {name: mean_return_at(run, marks) for name, run in shown.items()}
    ends = {name: dict(zip(run.seeds, returns_at(run, marks)[:, -1], strict=True)) for name, run in shown.items()}
    published = {name: published_widths.WATER[curve] for name, curve in WATER.items()}
    return "\n\n".join(
        part
        for part in (
            "**WaterWorld: pre-trained Transformer against the reward machine's state**",
            _table(shown, WATER, ((MEAN_AT_EPISODES, means), ("the same at the last one", ends)), published),
            curves_by_episode(shown, WATER, marks, published_widths.WATER),
            differences(shown, WATER_CLAIMS, means, MEAN_AT_EPISODES, WATER_CLAIMS),
            below.by_episode(shown, published, marks),
            EARLY if below.by_episode(shown, published, marks) else "",
            what_differs(shown, WATER, "water"),
        )
        if part
    )


def _zone(runs: Mapping[str, Stored]) -> str:
    """Compared by the return at the end."""
    shown = {name: runs[name] for name in ZONE if name in runs}
    if not shown:
        return ""
    means = {name: run.area("discounted_return") for name, run in shown.items()}
    ends = {name: run.end("discounted_return") for name, run in shown.items()}
    published = {name: published_widths.ZONE[curve] for name, curve in ZONE.items()}
    curves = {name: (published_widths.FRAMES, values) for name, values in published.items()}
    return "\n\n".join(
        part
        for part in (
            "**ZoneEnv: Transformer without pre-training against the automaton's state**",
            _table(shown, ZONE, (("mean return over training", means), ("at the end", ends)), published),
            curves_by_frames(shown, ZONE, published_widths.FRAMES, curves),
            differences(shown, ZONE_CLAIMS, ends, "return at the end", ZONE_CLAIMS),
            below.by_frames(shown, curves, published_widths.FRAMES),
            what_differs(shown, ZONE, "zone"),
        )
        if part
    )


def _table(
    runs: Mapping[str, Stored],
    labels: Mapping[str, str],
    measures: tuple[tuple[str, Mapping[str, Mapping[int, float]]], ...],
    published: Mapping[str, tuple[float, ...]],
) -> str:
    """Ours and the published mean over the marks, ours and the published last value, and what it took."""
    (over_all, means), (last, ends) = measures
    rows = [
        (
            labels[name],
            name,
            text(means[name]),
            f"{np.mean(published[name]):.2f}",
            text(ends[name]),
            f"{published[name][-1]:.2f}",
            solved(run),
            *cost(run),
        )
        for name, run in runs.items()
    ]
    return table(("code", "run", over_all, "published", last, "published", "solved", *COST), rows)
