"""One episode seen from above, as an animated GIF: drawn with Pillow from positions, so no OpenGL is needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from t2tl_jax.agents.agent import Agent, Params

ARENA = 2.5
"""Half the side of the picture, metres; the inner faces of the walls are 0.1 m inside."""

WALL = 2.4
ZONE_RADIUS = 0.25
ROBOT_RADIUS = 0.1
SCALE = 80
"""Pixels per metre."""

CAPTION = 44
"""Height of the caption below the arena, pixels."""

MAX_FRAMES = 150
SECONDS_PER_STEP = 0.02
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
}


@dataclass(frozen=True)
class Scene:
    """A recorded episode of T steps in an arena with n discs; NumPy arrays."""

    qpos: np.ndarray
    """``float32[T + 1, 3]``: x and y in metres, heading in radians, from the first state to the last."""
    rows: np.ndarray
    """``int32[T + 1]``: row of the task table."""
    zones: np.ndarray
    """``float32[n, 2]``: centres in metres."""
    colours: tuple[str, ...]
    """Name of each disc's colour."""
    verdict: int
    """+1 the task was carried out, -1 violated, 0 neither within the time limit."""


def has_view(env: Any) -> bool:
    """Whether an environment is an arena with a robot and discs, which is what can be drawn."""
    return hasattr(getattr(env, "env", None), "reset_to")


def record_scene(
    env: Any, agent: Agent, params: Params, key: jax.Array, episode_length: int, deterministic: bool
) -> Scene:
    """Play one episode and keep where the robot was.

    Args:
        env: a ``TaskEnv`` around a ``ZoneEnv``.
        agent: offers ``embed`` and ``act``.
        params: of one seed.
        key: a single key.
        episode_length: time limit in steps.
        deterministic: whether to take the mode of the policy.
    """

    def play(params: Params, key: jax.Array) -> tuple[Any, ...]:
        embedding = agent.embed(params)
        reset_key, act_key = jax.random.split(key)
        first = env.reset(reset_key)

        def step(state: Any, key: jax.Array) -> tuple[Any, tuple]:
            action = agent.act(params, embedding, state.obs, env.row(state), key, deterministic)
            state = env.step(state, action)
            return state, (state.pipeline_state.env.qpos, env.row(state), state.reward, state.done)

        _, steps = jax.lax.scan(step, first, jax.random.split(act_key, episode_length))
        return first.pipeline_state.env, env.row(first), steps

    world, row, (qpos, rows, rewards, done) = jax.device_get(jax.jit(play)(params, key))
    ended = np.flatnonzero(done > 0)
    length = int(ended[0]) + 1 if ended.size else episode_length
    return Scene(
        qpos=np.concatenate([world.qpos[None], qpos[:length]]),
        rows=np.concatenate([np.asarray(row)[None], rows[:length]]),
        zones=np.asarray(world.zones),
        colours=_disc_colours(env.env, np.asarray(world.zones)),
        verdict=int(np.sign(rewards[length - 1])) if ended.size else 0,
    )


def save_gif(scene: Scene, target: Path, caption: Callable[[int], str] = lambda row: "") -> None:
    """Write a scene as a GIF of at most about 150 frames, the last one shown for two seconds.

    Args:
        scene: what happened.
        target: the file to write.
        caption: from a row of the task table to a line of text, for instance the formula that remains.
    """
    length = len(scene.qpos) - 1
    stride = max(1, -(-length // MAX_FRAMES))
    shown = [*range(0, length, stride), length]
    background = _arena(scene)
    frames = [_frame(background, scene, step, caption(int(scene.rows[step]))) for step in shown]
    durations = [FRAME_MS] * (len(frames) - 1) + [2000]
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=durations, loop=0, disposal=1)


def _disc_colours(env: Any, zones: np.ndarray) -> tuple[str, ...]:
    """The proposition that holds at the centre of each disc."""

    def labels_at(centre: jax.Array) -> jax.Array:
        qpos = jax.numpy.append(centre, 0.0)
        return env.labels(env.reset_to(qpos, jax.numpy.zeros(3), zones))

    labels = np.asarray(jax.jit(jax.vmap(labels_at))(zones))
    return tuple(env.propositions[int(np.argmax(row))] for row in labels)


def _pixels(points: np.ndarray) -> list[tuple[float, float]]:
    """Metres ``[..., 2]`` to pixels; y points up in the arena and down in the picture."""
    points = np.asarray(points, np.float64).reshape(-1, 2)
    return [((x + ARENA) * SCALE, (ARENA - y) * SCALE) for x, y in points.tolist()]


def _arena(scene: Scene) -> Image.Image:
    side = int(2 * ARENA * SCALE)
    image = Image.new("RGB", (side, side + CAPTION), (235, 235, 235))
    draw = ImageDraw.Draw(image)
    (left, top), (right, bottom) = _pixels(np.array([[-WALL, WALL], [WALL, -WALL]]))
    draw.rectangle((0, 0, side, side), fill=(130, 130, 130))
    draw.rectangle((left, top, right, bottom), fill=(222, 226, 230))
    radius = ZONE_RADIUS * SCALE
    for (x, y), colour in zip(_pixels(scene.zones), scene.colours, strict=True):
        box = (x - radius, y - radius, x + radius, y + radius)
        draw.ellipse(box, fill=FILLS.get(colour, (160, 160, 160)), outline=(90, 90, 90))
    return image


def _frame(background: Image.Image, scene: Scene, step: int, text: str) -> Image.Image:
    image = background.copy()
    draw = ImageDraw.Draw(image)
    path = _pixels(scene.qpos[: step + 1, :2])
    if len(path) > 1:
        draw.line(path, fill=(30, 90, 200), width=2)
    x, y, heading = (float(value) for value in scene.qpos[step])
    radius = ROBOT_RADIUS * SCALE
    ((px, py),) = _pixels(np.array([[x, y]]))
    draw.ellipse((px - radius, py - radius, px + radius, py + radius), fill=(30, 90, 200), outline=(255, 255, 255))
    nose = np.array([x + 1.8 * ROBOT_RADIUS * np.cos(heading), y + 1.8 * ROBOT_RADIUS * np.sin(heading)])
    draw.line([(px, py), *_pixels(nose)], fill=(255, 255, 255), width=3)
    last = step == len(scene.qpos) - 1
    outcome = {1: ", done", -1: ", violated", 0: ", out of time"}[scene.verdict] if last else ""
    side = int(2 * ARENA * SCALE)
    font = ImageFont.load_default(13)
    draw.text((8, side + 5), f"step {step}, {step * SECONDS_PER_STEP:.1f} s{outcome}", fill=(0, 0, 0), font=font)
    draw.text((8, side + 23), _fitted(text, font, side - 16), fill=(0, 0, 0), font=font)
    return image


def _fitted(text: str, font: Any, width: int) -> str:
    """The text, cut so that it is not wider than the picture."""
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + " ...") > width:
        text = text[:-1]
    return text + " ..."


def captions(texts: Sequence[str]) -> Callable[[int], str]:
    """A caption per row from a sequence of texts."""
    return lambda row: f"left to do: {texts[row]}" if row < len(texts) else ""
