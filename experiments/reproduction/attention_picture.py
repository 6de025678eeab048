"""The paper's attention figure: what each token receives at the start and at the end of training, ours beside it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from experiments.paper import published_attention
from experiments.reproduction.pictures import KEYWORD
from experiments.reproduction.sections.attention import RUNS, STAGES, TITLES
from experiments.reproduction.stored import Stored
from experiments.reproduction.work import READING
from t2tl_jax.evaluation.statistics import Estimate
from t2tl_jax.runs.folder import read_json

PUBLISHED = "published, one agent"


@dataclass(frozen=True)
class AttentionPicture:
    """A picture of `docs`: a panel for each run and one for the paper's agent, two bars for each token."""

    file: str
    """Its name there."""
    caption: str
    panels: Mapping[str, tuple[tuple[Estimate, ...], ...]]
    """By title, at each of the stages what every token receives."""

    def digest(self) -> str:
        """Of everything that is drawn: numbers count to six digits."""
        shown = {
            title: [[[f"{x:.6g}" for x in _bar(one)] for one in stage] for stage in stages]
            for title, stages in self.panels.items()
        }
        return hashlib.sha256(json.dumps([shown, published_attention.TOKENS]).encode()).hexdigest()

    def draw(self, target: Path) -> None:
        """Write the PNG."""
        figure = Figure(figsize=(10.0, 3.4), layout="constrained")
        canvas = FigureCanvasAgg(figure)
        places = np.arange(len(published_attention.TOKENS))
        panels = figure.subplots(1, len(self.panels), sharey=True, squeeze=False)[0]
        for axes, (title, stages) in zip(panels, self.panels.items(), strict=True):
            for number, (name, stage) in enumerate(zip(STAGES, stages, strict=True)):
                values, low, high = np.array([_bar(one) for one in stage]).T
                errors = None if np.array_equal(low, high) else [values - low, high - values]
                axes.bar(places + 0.4 * number - 0.2, values, 0.4, yerr=errors, capsize=2, label=name)
            axes.set_xticks(places, published_attention.TOKENS, rotation=60)
            axes.set_title(title, fontsize="medium")
            axes.grid(alpha=0.3, axis="y")
        panels[0].set_ylabel("attention received")
        panels[0].legend(frameon=False, fontsize="small")
        canvas.print_png(str(target), metadata={KEYWORD: self.digest()})

    def markdown(self) -> str:
        """The line that shows it on a page beside it."""
        return f"![{self.caption}]({self.file})"


def _bar(received: Estimate) -> tuple[float, float, float]:
    """Its height, and the ends of its interval; the height itself where there is none."""
    value = float("nan") if received.value is None else received.value
    low, high = (value if end is None else end for end in (received.low, received.high))
    return value, low, high


def attention_picture(paper: Mapping[str, Stored]) -> dict[str, AttentionPicture]:
    """By its item; nothing unless both runs were read over seeds."""
    panels = {}
    for name in RUNS:
        if name not in paper:
            return {}
        read = read_json(paper[name].path / READING)
        stages = [read["over_seeds"][stage] for stage in STAGES]
        if any(tuple(stage["tokens"]) != published_attention.TOKENS for stage in stages):
            return {}
        panels[TITLES[name]] = tuple(tuple(Estimate(**one) for one in stage["attention_received"]) for stage in stages)
    published = (published_attention.START, published_attention.END)
    panels[PUBLISHED] = tuple(tuple(Estimate(value, None, None, 1) for value in stage) for stage in published)
    caption = "Attention that each token of phi_zone_prime receives, at the start and at the end of training. "
    caption += f"Mean of {len(paper[RUNS[0]].seeds)} seeds with 95 % intervals; the paper's agent is one."
    return {"attention": AttentionPicture("phi_zone_prime_attention.png", caption, panels)}
