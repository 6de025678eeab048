"""The picture of one agent that carries out several formulas on one map, drawn from stored episodes."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont, PngImagePlugin

from envs.zones import ZoneEnv
from experiments.reproduction.anytask import tested
from experiments.reproduction.pictures import KEYWORD
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.animation import FILLS, wrapped
from t2tl_jax.ltl import resolve_task

RUN, ITEM = "any-zones", "any-open"

SIDE, MARGIN, TEXT = 300, 8, 92
"""Of a panel, pixels: the arena, the space around it, the height of what stands below it."""

GROUND, ARENA, WAY = (255, 255, 255), (222, 226, 230), (30, 90, 200)


@dataclass(frozen=True)
class EpisodesPicture:
    """A picture of `docs`: a panel for each episode."""

    file: str
    """Its name there."""
    caption: str
    episodes: tuple[Mapping[str, Any], ...]
    """As `tested` stores them."""
    colours: tuple[str, ...]
    """Of the discs."""
    radius: float
    """Of the discs, metres."""
    edge: float
    """Where the arena ends, metres from its centre."""

    def digest(self) -> str:
        """Of everything that is drawn."""
        shown = [list(self.episodes), self.colours, self.radius, self.edge]
        return hashlib.sha256(json.dumps(shown, sort_keys=True).encode()).hexdigest()

    def draw(self, target: Path) -> None:
        """Write the PNG."""
        width = MARGIN + (SIDE + MARGIN) * len(self.episodes)
        canvas = Image.new("RGB", (width, SIDE + TEXT + 2 * MARGIN), GROUND)
        for number, episode in enumerate(self.episodes):
            panel = Image.new("RGB", (SIDE, SIDE + TEXT), GROUND)
            self._panel(ImageDraw.Draw(panel), episode)
            canvas.paste(panel, (MARGIN + number * (SIDE + MARGIN), MARGIN))
        noted = PngImagePlugin.PngInfo()
        noted.add_text(KEYWORD, self.digest())
        canvas.save(target, pnginfo=noted)

    def markdown(self) -> str:
        """The line that shows it on a page beside it."""
        return f"![{self.caption}]({self.file})"

    def _panel(self, draw: ImageDraw.ImageDraw, episode: Mapping[str, Any]) -> None:
        draw.rectangle((0, 0, SIDE - 1, SIDE - 1), fill=ARENA, outline=(130, 130, 130))
        for centre, colour in zip(episode["discs"], self.colours, strict=True):
            self._disc(draw, centre, self.radius * self._scale, FILLS[colour])
        draw.line([self._pixel(place) for place in episode["way"]], fill=WAY, width=3)
        for place in episode["changes"]:  # where the formula went on
            self._disc(draw, place, 5, GROUND)
        self._disc(draw, episode["way"][0], 6, (20, 20, 20))
        font = ImageFont.load_default(13)
        text = f"{resolve_task(episode['task'])}"
        lines = [*wrapped(text, font, SIDE), f"{episode['outcome']} after {episode['steps']} steps"]
        for number, line in enumerate(lines):
            draw.text((0, SIDE + 5 + 17 * number), line, fill=(0, 0, 0), font=font)

    @property
    def _scale(self) -> float:
        return SIDE / (2 * self.edge)

    def _pixel(self, place: Sequence[float]) -> tuple[float, float]:
        return (place[0] + self.edge) * self._scale, (self.edge - place[1]) * self._scale

    def _disc(
        self, draw: ImageDraw.ImageDraw, centre: Sequence[float], radius: float, fill: tuple[int, int, int]
    ) -> None:
        x, y = self._pixel(centre)
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=fill, outline=(60, 60, 60))


def of_runs(runs: Mapping[str, Stored]) -> dict[str, EpisodesPicture]:
    """By item; none where nothing is stored.

    Args:
        runs: those of agents for any task, by name.
    """
    drawn = tested.read(runs[RUN].path).get(tested.DRAWN) if RUN in runs else None
    if drawn is None:
        return {}
    config: Any = runs[RUN].config.env
    view = ZoneEnv(config).view()
    caption = (
        f"One agent (seed {drawn['seed']}, {drawn['policy']}) and {len(drawn['episodes'])} formulas that it was not "
        "trained on, from the black dot on one map that it was not trained on; white dots: where the formula went on."
    )
    picture = EpisodesPicture(
        "any_task.png", caption, tuple(drawn["episodes"]), view.colours, config.radius, view.high[0]
    )
    return {ITEM: picture}
