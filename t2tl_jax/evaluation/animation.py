"""One episode seen from above, as an animated GIF: drawn with Pillow from positions, so no OpenGL is needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from flax import struct
from jax.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont

from t2tl_jax.training.types import Agent, Params

SIDE = 384
"""The longer side of the arena between its walls, pixels."""

WALL = 8
"""Thickness of the walls, pixels."""

LINE = 18
"""Height of a line of the caption, pixels."""

TEXT_LINES = 8
"""Lines of the caption below the one with the step; what does not fit is cut."""

MAX_FRAMES = 150
FRAME_MS = 60

FILLS = {
    "Black": (40, 40, 40),
    "White": (255, 255, 255),
    "Blue": (60, 100, 230),
    "Green": (40, 170, 70),
    "Red": (220, 50, 47),
    "Yellow": (240, 210, 40),
    "Cyan": (60, 200, 210),
    "Magenta": (200, 60, 180),
    "Purple": (110, 50, 150),
    "Orange": (240, 140, 30),
    "Gray": (140, 140, 140),
    "Pink": (250, 170, 195),
}


@struct.dataclass
class Scene:
    """What there is to see of one state, in the environment's unit of length; episodes have a leading axis."""

    discs: jax.Array | np.ndarray
    """``float32[n, 2]``: centres."""
    radii: jax.Array | np.ndarray
    """``float32[n]``: radius of each disc."""
    agent: jax.Array | np.ndarray
    """``float32[2]``: centre of the agent."""
    heading: jax.Array | np.ndarray
    """``float32[2]``: where the agent looks or moves, at most of length 1; drawn as its nose."""


@dataclass(frozen=True)
class View:
    """How an environment looks from above: what this module knows about it."""

    scene: Callable[[Any], Scene]
    """From a pipeline state of the environment to what is drawn; pure."""
    low: tuple[float, float]
    """Inner corner of the walls at the bottom left."""
    high: tuple[float, float]
    """Inner corner of the walls at the top right."""
    colours: tuple[str, ...]
    """Name of each disc's colour."""
    agent_radius: float
    """How large the agent is."""
    agent_colour: tuple[int, int, int]
    """How the agent is filled."""
    seconds_per_step: float
    """Time between two states."""

    @property
    def scale(self) -> float:
        """Pixels per unit of length."""
        return SIDE / max(self.high[0] - self.low[0], self.high[1] - self.low[1])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the arena with its walls, pixels."""
        width, height = (round((self.high[i] - self.low[i]) * self.scale) + 2 * WALL for i in (0, 1))
        return width, height

    def pixels(self, points: ArrayLike) -> list[tuple[float, float]]:
        """Positions ``[..., 2]`` to pixels; y points up in the arena and down in the picture."""
        centres = np.asarray(points, np.float64).reshape(-1, 2)
        (left, _), (_, top) = self.low, self.high
        return [(WALL + (x - left) * self.scale, WALL + (top - y) * self.scale) for x, y in centres.tolist()]


@dataclass(frozen=True)
class Recording:
    """A recorded episode of T steps; NumPy arrays."""

    scenes: Scene
    """With leading axis ``[T + 1]``, from the first state to the last."""
    rows: np.ndarray
    """``int32[T + 1]``: row of the task table."""
    verdict: int
    """+1 the task was carried out, -1 violated, 0 neither within the time limit."""


def record(
    env: Any, view: View, agent: Agent, params: Params, key: jax.Array, episode_length: int, deterministic: bool
) -> Recording:
    """Play one episode and keep what there was to see.

    Args:
        env: a ``TaskEnv``.
        view: of the environment inside.
        agent: offers ``embed``, ``begin``, ``act`` and ``remember``.
        params: of one seed.
        key: a single key.
        episode_length: time limit in steps.
        deterministic: whether to take the mode of the policy.
    """

    def look(state: Any) -> tuple[Scene, jax.Array]:
        return view.scene(state.pipeline_state.env), env.row(state)

    def play(params: Params, key: jax.Array) -> tuple[Any, ...]:
        embedding = agent.embed(params)
        reset_key, act_key = jax.random.split(key)
        first = env.reset(reset_key)

        def step(carry: tuple, key: jax.Array) -> tuple[tuple, tuple]:
            state, memory = carry
            action = agent.act(params, embedding, memory, state.obs, env.row(state), key, deterministic)
            moved = env.step(state, action)
            memory = agent.remember(params, memory, state.obs, action, moved.reward)
            return (moved, memory), (look(moved), env.verdict(moved), moved.done)

        _, steps = jax.lax.scan(step, (first, agent.begin()), jax.random.split(act_key, episode_length))
        return look(first), steps

    first, (seen, verdicts, done) = jax.device_get(jax.jit(play)(params, key))
    ended = np.flatnonzero(done > 0)
    length = int(ended[0]) + 1 if ended.size else episode_length
    scenes, rows = jax.tree.map(lambda one, more: np.concatenate([np.asarray(one)[None], more[:length]]), first, seen)
    verdict = int(verdicts[length - 1])
    if ended.size and verdict == 0:  # the physics failed
        verdict = -1
    return Recording(scenes, rows, verdict)


def save_gif(recording: Recording, view: View, target: Path, caption: Callable[[int], str] = lambda row: "") -> None:
    """Write an episode as a GIF of at most about 150 frames, the last one shown for two seconds.

    Args:
        recording: what happened.
        view: how to draw it.
        target: the file to write.
        caption: from a row of the task table to a text, for instance the formula that remains; long ones are wrapped.
    """
    length = len(recording.rows) - 1
    stride = max(1, -(-length // MAX_FRAMES))
    shown = [*range(0, length, stride), length]
    font = ImageFont.load_default(13)
    width, height = view.size
    lines = {row: wrapped(caption(row), font, width - 2 * WALL) for row in {int(recording.rows[i]) for i in shown}}
    canvas = Image.new("RGB", (width, height + LINE * (1 + max(map(len, lines.values()))) + WALL), (235, 235, 235))
    frames = []
    for step in shown:
        frame = canvas.copy()
        _draw(ImageDraw.Draw(frame), recording, view, step)
        seconds = f"step {step}, {step * view.seconds_per_step:.1f} s"
        outcome = {1: ", done", -1: ", violated", 0: ", out of time"}[recording.verdict] if step == length else ""
        text = "\n".join([seconds + outcome, *lines[int(recording.rows[step])]])
        for number, line in enumerate(text.splitlines()):
            ImageDraw.Draw(frame).text((WALL, height + 4 + LINE * number), line, fill=(0, 0, 0), font=font)
        frames.append(frame)
    durations = [FRAME_MS] * (len(frames) - 1) + [2000]
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=durations, loop=0, disposal=1)


def captions(texts: Sequence[str]) -> Callable[[int], str]:
    """A caption per row from a sequence of texts."""
    return lambda row: f"left to do: {texts[row]}" if row < len(texts) else ""


def _draw(draw: ImageDraw.ImageDraw, recording: Recording, view: View, step: int) -> None:
    """The arena at one step: walls, discs, the way so far, the agent."""
    width, height = view.size
    draw.rectangle((0, 0, width - 1, height - 1), fill=(130, 130, 130))
    draw.rectangle((WALL, WALL, width - WALL - 1, height - WALL - 1), fill=(222, 226, 230))
    scenes = recording.scenes
    radii = scenes.radii[step] * view.scale
    for (x, y), radius, colour in zip(view.pixels(scenes.discs[step]), radii.tolist(), view.colours, strict=True):
        fill = FILLS.get(colour, (160, 160, 160))
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=fill, outline=(90, 90, 90))
    way = view.pixels(scenes.agent[: step + 1])
    if len(way) > 1:
        draw.line(way, fill=(30, 90, 200), width=2)
    x, y = way[-1]
    radius = view.agent_radius * view.scale
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=view.agent_colour, outline=(20, 20, 20))
    nose = scenes.agent[step] + 1.8 * view.agent_radius * scenes.heading[step]
    draw.line([(x, y), *view.pixels(nose)], fill=(20, 20, 20), width=3)


def wrapped(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> list[str]:
    """The text in lines that are not wider than `width` pixels, at most ``TEXT_LINES`` of them."""
    lines: list[str] = []
    for word in text.split():
        if lines and font.getlength(f"{lines[-1]} {word}") <= width:
            lines[-1] += " " + word
        else:
            lines.append(word)
    if len(lines) <= TEXT_LINES:
        return lines
    last = lines[TEXT_LINES - 1]
    while font.getlength(last + " ...") > width:
        last = last[:-1]
    return [*lines[: TEXT_LINES - 1], last + " ..."]
