"""One episode seen from above, as an animated GIF: drawn with Pillow from positions, so no OpenGL is needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont

from t2tl_jax.env import State
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.types import Agent, Params, repeated
from t2tl_jax.training.unroll import Step, begin, player_of, unroll
from t2tl_jax.view import Scene, View

SIDE = 384
"""The longer side of the arena between its walls, pixels."""

WALL = 8
"""Thickness of the walls, pixels."""

LINE = 18
"""Height of a line of the caption, pixels."""

TEXT_LINES = 8
"""Lines of the caption below the one with the step; what does not fit is cut."""

MAX_FRAMES = 150

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
    "Aqua": (120, 230, 220),
    "Lime": (160, 220, 60),
    "Teal": (20, 120, 120),
}


@dataclass(frozen=True)
class Recording:
    """A recorded episode of T steps; NumPy arrays."""

    scenes: Scene
    """With leading axis ``[T + 1]``, from the first state to the last."""
    rows: np.ndarray
    """``int32[T + 1]``: row of the task table."""
    verdict: int
    """+1 the task was carried out, -1 violated, 0 neither."""
    truncated: bool = True
    """Whether it was the time limit that ended the episode; what ends it without a verdict is else the environment."""

    @property
    def outcome(self) -> str:
        """How the episode ended, in words."""
        if self.verdict:
            return "done" if self.verdict > 0 else "violated"
        return "out of time" if self.truncated else "ended by the environment"


NOTHING = Scene(*(np.zeros(shape, np.float32) for shape in ((0, 2), 0, 2, 2)))
"""The scene of an environment without a view."""

Recorder = Callable[[Params, TaskParams, jax.Array], Recording]
"""From the parameters of one seed, those of its environment, and a single key to a recorded episode."""


def recorder(env: TaskEnv, view: View | None, agent: Agent, episode_length: int, deterministic: bool) -> Recorder:
    """What plays one episode and keeps what there was to see; compiled once for all tables of equal shapes.

    Args:
        env: the environment.
        view: of the environment inside; without one the scenes hold `NOTHING`.
        agent: offers ``embed``, ``begin``, ``act`` and ``remember``.
        episode_length: time limit in steps.
        deterministic: whether to take the mode of the policy.
    """

    def play(params: Params, env_params: TaskParams, key: jax.Array) -> tuple[Any, Any]:
        policy = player_of(agent, env, params, agent.embed(params, env_params.table), deterministic)

        def look(state: State) -> tuple[Scene, jax.Array]:
            inner = jax.tree.map(lambda x: x[0], state.pipeline_state.env)
            return NOTHING if view is None else view.scene(inner, env_params.env), env.row(state)[0]

        def seen(step: Step) -> tuple[tuple[Scene, jax.Array], jax.Array, jax.Array, jax.Array]:
            verdict = env.verdict(step.state, env_params)
            return look(step.state), verdict[0], step.terminated[0], step.truncated[0]

        reset_key, key = jax.random.split(key)
        first, carry = begin(env, env_params, reset_key, 1, episode_length), repeated(agent.begin(), 1)
        _, _, steps = unroll(
            env, env_params, policy, first, carry, key, episode_length, episode_length, discount=1.0, keep=seen
        )
        return look(first.state), steps

    compiled = jax.jit(play)

    def recorded(params: Params, env_params: TaskParams, key: jax.Array) -> Recording:
        first, (then, verdicts, terminated, truncated) = jax.device_get(compiled(params, env_params, key))
        last = int(np.flatnonzero(terminated | truncated)[0])  # what follows is the next episode
        length = last + 1
        scenes, rows = jax.tree.map(
            lambda one, more: np.concatenate([np.asarray(one)[None], more[:length]]), first, then
        )
        return Recording(scenes, rows, int(verdicts[last]), bool(truncated[last]))

    return recorded


def record(
    env: TaskEnv,
    view: View,
    agent: Agent,
    params: Params,
    env_params: TaskParams,
    key: jax.Array,
    episode_length: int,
    deterministic: bool,
) -> Recording:
    """Play one episode and keep what there was to see; the arguments are those of `recorder` and of what it gives."""
    return recorder(env, view, agent, episode_length, deterministic)(params, env_params, key)


def save_gif(
    recording: Recording,
    view: View,
    target: Path,
    caption: Callable[[int], str] = lambda row: "",
    comment: str = "",
) -> None:
    """Write an episode as a GIF of at most about 150 frames, the last one shown for two seconds.

    Args:
        recording: what happened.
        view: how to draw it.
        target: the file to write.
        caption: from a row of the task table to a text, for instance the formula that remains; long ones are wrapped.
        comment: what the file says of itself, not shown.
    """
    length = len(recording.rows) - 1
    stride = max(1, -(-length // MAX_FRAMES))
    shown = [*range(0, length, stride), length]
    font = ImageFont.load_default(13)
    width, height = picture_size(view)
    lines = {row: wrapped(caption(row), font, width - 2 * WALL) for row in {int(recording.rows[i]) for i in shown}}
    canvas = Image.new("RGB", (width, height + LINE * (1 + max(map(len, lines.values()))) + WALL), (235, 235, 235))
    frames = []
    for step in shown:
        frame = canvas.copy()
        _draw(ImageDraw.Draw(frame), recording, view, step)
        seconds = f"step {step}" + f", {step * view.seconds_per_step:.1f} s" * (view.seconds_per_step > 0)
        outcome = f", {recording.outcome}" if step == length else ""
        text = "\n".join([seconds + outcome, *lines[int(recording.rows[step])]])
        for number, line in enumerate(text.splitlines()):
            ImageDraw.Draw(frame).text((WALL, height + 4 + LINE * number), line, fill=(0, 0, 0), font=font)
        frames.append(frame)
    durations = [view.frame_ms] * (len(frames) - 1) + [2000]
    noted = {"comment": comment} if comment else {}
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=durations, loop=0, disposal=1, **noted)


def captions(texts: Sequence[str]) -> Callable[[int], str]:
    """A caption per row from a sequence of texts."""
    return lambda row: f"left to do: {texts[row]}" if row < len(texts) else ""


def picture_size(view: View) -> tuple[int, int]:
    """Width and height of the arena with its walls, pixels."""
    width, height = (round((view.high[i] - view.low[i]) * _scale(view)) + 2 * WALL for i in (0, 1))
    return width, height


def pixels(view: View, points: ArrayLike) -> list[tuple[float, float]]:
    """Positions ``[..., 2]`` to pixels; y points up in the arena and down in the picture."""
    centres, scale = np.asarray(points, np.float64).reshape(-1, 2), _scale(view)
    (left, _), (_, top) = view.low, view.high
    return [(WALL + (x - left) * scale, WALL + (top - y) * scale) for x, y in centres.tolist()]


def _scale(view: View) -> float:
    """Pixels per unit of length."""
    return SIDE / max(view.high[0] - view.low[0], view.high[1] - view.low[1])


def _draw(draw: ImageDraw.ImageDraw, recording: Recording, view: View, step: int) -> None:
    """The arena at one step: walls, discs, the way so far, the agent, texts."""
    width, height = picture_size(view)
    draw.rectangle((0, 0, width - 1, height - 1), fill=(130, 130, 130))
    draw.rectangle((WALL, WALL, width - WALL - 1, height - WALL - 1), fill=(222, 226, 230))
    scenes = recording.scenes
    radii = scenes.radii[step] * _scale(view)
    for (x, y), radius, colour in zip(pixels(view, scenes.discs[step]), radii.tolist(), view.colours, strict=True):
        fill = FILLS.get(colour, (160, 160, 160))
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=fill, outline=(90, 90, 90))
    for part in _pieces(view, np.asarray(scenes.agent[: step + 1])):
        way = pixels(view, part)
        if len(way) > 1:
            draw.line(way, fill=(30, 90, 200), width=2)
    x, y = way[-1]
    radius = view.agent_radius * _scale(view)
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=view.agent_colour, outline=(20, 20, 20))
    nose = scenes.agent[step] + 1.8 * view.agent_radius * scenes.heading[step]
    draw.line([(x, y), *pixels(view, nose)], fill=(20, 20, 20), width=3)
    font = ImageFont.load_default(16)
    for (x, y), text in zip(pixels(view, scenes.discs[step]), view.texts, strict=False):
        draw.text((x, y), text, fill=(0, 0, 0), font=font, anchor="mm")


def _pieces(view: View, way: np.ndarray) -> list[np.ndarray]:
    """The way ``[n, 2]`` as lines to draw; where walls are joined, it is cut where the agent goes through one."""
    if not view.joined:
        return [way]
    apart = np.abs(np.diff(way, axis=0)) > (np.array(view.high) - view.low) / 2
    return np.split(way, np.flatnonzero(apart.any(-1)) + 1)


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
