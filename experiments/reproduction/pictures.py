"""The pictures of the documentation: drawn from stored results, and each PNG says which numbers it shows."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont, PngImagePlugin

from experiments.paper import published_water, published_widths
from experiments.paper.published_water import EPISODES, PHI_WATER
from experiments.reproduction import runs as named
from experiments.reproduction.sections import attention, benchmark, ten_tasks, widths
from experiments.reproduction.sections.figures import ZONE_LABELS, ZONE_PUBLISHED
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import returns_at
from t2tl_jax.evaluation.curves import Line, plot_lines

KEYWORD = "Numbers"
"""Of the text in a PNG that holds the digest of what it shows."""

COLOURS = {method: k for k, method in enumerate(dict.fromkeys((*named.WATER_METHODS, *named.ZONE_METHODS)))}
"""The same for a method in every picture, and for its published curve."""

PUBLISHED_WATER = {
    "T2TL_pre": "t2tl",
    "T1TL_pre": "t1tl",
    "GNN_pre": "gnn",
    "RM": "rm",
    "DFA": "dfa",
    "DFA_cont": "dfa_cont",
}
"""The methods of the published curves on `phi_water`."""

BAND = 24
"""Height of the band above a picture that says what it is of, pixels."""

MARKS = tuple(range(EPISODES[0], EPISODES[-1] + 1, 250))
"""Episodes at which curves by episode are drawn."""


@dataclass(frozen=True)
class Picture:
    """A picture of `docs`."""

    file: str
    """Its name there."""
    caption: str
    lines: tuple[Line, ...]
    xlabel: str
    ylabel: str

    def digest(self) -> str:
        """Of everything that is drawn, the same wherever it is computed: numbers count to six digits."""
        lines = [
            (one.label, one.colour, one.dashed, _rounded(one.x), _rounded(one.values), *["shares"] * one.shares)
            for one in self.lines
        ]
        return hashlib.sha256(json.dumps([self.xlabel, self.ylabel, lines]).encode()).hexdigest()

    def draw(self, target: Path) -> None:
        """Write the PNG."""
        plot_lines(self.lines, target, self.xlabel, self.ylabel, {KEYWORD: self.digest()})

    def markdown(self) -> str:
        """The line that shows it on a page beside it."""
        return f"![{self.caption}]({self.file})"


def drawn(file: Path) -> str | None:
    """The digest that a PNG or GIF was drawn with; None if it says nothing."""
    with Image.open(file) as image:
        if image.format != "GIF":
            return image.info.get(KEYWORD)
        comment = image.info.get("comment", b"")
        return comment.decode(errors="replace") or None


def say_above(file: Path, text: str) -> None:
    """Write a line into a band above a PNG; the digest that it was drawn with stays."""
    with Image.open(file) as image:
        below, digest = image.convert("RGB"), image.info.get(KEYWORD)
    whole = Image.new("RGB", (below.width, below.height + BAND), (255, 255, 255))
    whole.paste(below, (0, BAND))
    ImageDraw.Draw(whole).text((8, 4), text, fill=(200, 0, 0), font=ImageFont.load_default(14))
    noted = PngImagePlugin.PngInfo()
    if digest is not None:
        noted.add_text(KEYWORD, digest)
    whole.save(file, pnginfo=noted)


def pictures(paper: Mapping[str, Stored], short: Mapping[str, Stored]) -> dict[str, Picture]:
    """By item of the paper, or `short` for the short schedule; those of which something is stored.

    An item with two pictures has them by its name and a word behind a slash.

    Args:
        paper: the stored runs of the paper's items, by name.
        short: those of the short schedule.
    """
    zone, published = by_method(paper, "zone", named.ZONE_METHODS), "Dashed: published, read off a picture."
    water = by_method(paper, "water", named.WATER_METHODS)
    found = {
        "fig-zone": Picture(
            "phi_zone_curves.png",
            f"Discounted return during training on phi_zone, 10 million frames. {published}",
            (*_by_frames(zone), *_published_zone()),
            *("frames per seed", "discounted return"),
        ),
        "fig-water": Picture(
            "phi_water_curves.png",
            f"Return without discount of the last 500 training episodes on phi_water. {published}",
            (*_by_episode(water), *_published_water()),
            *("episodes per seed", "undiscounted return of the last 500 episodes"),
        ),
        "fig-dimensions/water": Picture(
            "width_water_curves.png",
            f"Return of the last 500 training episodes on phi_water, by width of the code. {published}",
            (*_widths_of_water(paper), *_published(published_widths.WATER, published_widths.EPISODES)),
            *("episodes per seed", "return of the last 500 episodes"),
        ),
        "fig-dimensions/zone": Picture(
            "width_zone_curves.png",
            f"Discounted return during training on phi_zone, 10 million frames, by width of the code. {published}",
            (*_widths_of_zone(paper), *_published(published_widths.ZONE, published_widths.FRAMES)),
            *("frames per seed", "discounted return"),
        ),
        "benchmark": Picture(
            "rm_benchmark_curves.png",
            "Normalised score of the last 1,000 training episodes on the ten tasks, with 95 % intervals over maps. "
            "Dashed: published, mean of two repeats on the same maps.",
            (*_benchmark(paper), *_published(_SCORES, published_water.STEPS)),
            *("environment steps", "normalised score"),
        ),
        "benchmark/single": Picture(
            "rm_benchmark_single.png",
            "Share of the last 100 training episodes of the single task that pay 1, with 95 % intervals over maps "
            "(Wilson's). Dashed: published, on the same maps.",
            (*_single(paper), *_published(_PAID, published_water.SINGLE_STEPS)),
            *("environment steps", "share of episodes that pay 1"),
        ),
        "attention/change": Picture(
            "phi_zone_prime_projections.png",
            "How far training moved the out-projections of each layer of the task's Transformer on phi_zone_prime, "
            "relative to their size at the start: means over seeds with 95 % intervals.",
            tuple(_moved(paper)),
            *("layer", "change of the out-projection, relative"),
        ),
        "short": Picture(
            "zone_short_curves.png",
            f"Discounted return of the short schedule, beside the published curves. {published}",
            (*_by_frames({name: short[name] for name in ("t2tl", "t1tl") if name in short}), *_published_zone()),
            *("frames per seed", "discounted return"),
        ),
    }
    return {name: one for name, one in found.items() if any(not line.dashed for line in one.lines)}


def by_method(runs: Mapping[str, Stored], world: str, methods: Sequence[str]) -> dict[str, Stored]:
    """The runs of the six methods in a world, by method, as far as they are stored."""
    return {method: runs[f"{world}-{method}"] for method in methods if f"{world}-{method}" in runs}


def _by_frames(runs: Mapping[str, Stored]) -> list[Line]:
    return [
        Line(
            _label(method, run),
            np.nanmax(run.metrics["frames"], axis=0),
            run.metrics["discounted_return"],
            COLOURS[method],
        )
        for method, run in runs.items()
    ]


def _by_episode(runs: Mapping[str, Stored]) -> list[Line]:
    return [
        Line(
            _label(method, run),
            MARKS,
            returns_at(run, MARKS),
            COLOURS[method],
        )
        for method, run in runs.items()
    ]


def _widths_of_water(paper: Mapping[str, Stored]) -> list[Line]:
    runs = {name: paper[name] for name in widths.WATER if name in paper}
    return [
        Line(_label(widths.WATER[name], run), MARKS, returns_at(run, MARKS), _COLOURS[widths.WATER[name]])
        for name, run in runs.items()
    ]


def _widths_of_zone(paper: Mapping[str, Stored]) -> list[Line]:
    runs = {name: paper[name] for name in widths.ZONE if name in paper}
    return [
        Line(
            _label(widths.ZONE[name], run),
            np.nanmax(run.metrics["frames"], axis=0),
            run.metrics["discounted_return"],
            _COLOURS[widths.ZONE[name]],
        )
        for name, run in runs.items()
    ]


def _benchmark(paper: Mapping[str, Stored]) -> list[Line]:
    curves = ten_tasks.scores({name: paper[name] for name in ten_tasks.TEN if name in paper})
    return [
        Line(f"{label} ({len(of)} maps)", published_water.STEPS, np.array(list(of.values())), _COLOURS[label])
        for label, of in ((ten_tasks.TEN[name], of) for name, of in curves.items())
    ]


def _single(paper: Mapping[str, Stored]) -> list[Line]:
    runs = {name: paper[name] for name in benchmark.SINGLE if name in paper}
    marks = published_water.SINGLE_STEPS
    return [
        Line(
            f"{label} ({len(run.seeds)} maps)",
            marks,
            benchmark.recent(run, marks, "total_reward"),
            _COLOURS[label],
            shares=True,
        )
        for label, run in ((benchmark.SINGLE[name], run) for name, run in runs.items())
        if "total_reward" in run.metrics
    ]


def _moved(paper: Mapping[str, Stored]) -> list[Line]:
    """Of each run of the attention figure a line over layers."""
    lines = []
    for colour, name in enumerate(attention.RUNS):
        change = attention.moved(paper[name]) if name in paper else None
        if change is not None:
            lines.append(Line(attention.TITLES[name], np.arange(change.shape[1]), change, colour))
    return lines


_PAID = published_water.SINGLE_REWARDED

_SCORES = {name: means for name, (means, _) in published_water.SCORES.items()}

_COLOURS = {
    label: k
    for labels in (widths.WATER.values(), widths.ZONE.values(), ten_tasks.TEN.values())
    for k, label in enumerate(labels)
}
"""The same for a curve and its published one, by the name that both have in the paper."""


def _published(curves: Mapping[str, Sequence[float]], at: Sequence[float]) -> list[Line]:
    return [
        Line(f"{name}, published", at, np.array([curves[name]]), _COLOURS[name], dashed=True)
        for name in sorted(curves, key=_COLOURS.__getitem__)
    ]


def _label(method: str, run: Stored) -> str:
    return f"{method} ({len(run.seeds)} seeds)"


def _published_zone() -> list[Line]:
    return [
        Line(f"{ZONE_LABELS[name]}, published", frames, np.array([returns]), COLOURS[ZONE_LABELS[name]], dashed=True)
        for name, (frames, returns) in ZONE_PUBLISHED.items()
    ]


def _published_water() -> list[Line]:
    lines = []
    for name, curve in PHI_WATER.items():
        method = PUBLISHED_WATER[name]
        lines.append(Line(f"{method}, published", EPISODES, np.array([curve]), COLOURS[method], dashed=True))
    return lines


def _rounded(values: Sequence[float] | np.ndarray) -> list[str]:
    return [f"{value:.6g}" for value in np.ravel(values)]
