"""The drawing loop on views made by hand, and the views of both environments."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image, ImageFont

from envs.flatworld import FlatWorld, FlatWorldConfig
from envs.letterworld import LetterWorld, LetterWorldConfig
from envs.waterworld import LETTERS, WaterWorld, WaterWorldConfig
from envs.zones import OPEN, ZoneConfig, ZoneEnv
from t2tl_jax.evaluation.animation import (
    FILLS,
    SIDE,
    TEXT_LINES,
    WALL,
    Recording,
    picture_size,
    pixels,
    save_gif,
    wrapped,
)
from t2tl_jax.single_state import SingleState
from t2tl_jax.view import Scene, View

pytestmark = pytest.mark.slow  # nearly every test loads, compiles or draws

VIEW = View(lambda state, params: state, (0.0, 0.0), (4.0, 2.0), ("Red",), 0.25, (255, 255, 255), 0.5)


def recording(steps):
    """A disc at rest, and an agent that moves to the right."""
    agent = np.stack([np.linspace(1, 3, steps + 1), np.full(steps + 1, 1.5)], axis=1)
    discs, radii = np.full((steps + 1, 1, 2), [[1.0, 0.5]]), np.full((steps + 1, 1), 0.25)
    rows = np.arange(steps + 1) // 2
    return Recording(Scene(discs, radii, agent, np.zeros((steps + 1, 2))), rows, verdict=1)


def test_frames_show_what_was_recorded(tmp_path):
    save_gif(recording(3), VIEW, tmp_path / "one.gif", lambda row: "word " * 30 * row)
    with Image.open(tmp_path / "one.gif") as gif:
        assert gif.n_frames == 4
        assert gif.width == SIDE + 2 * WALL
        pictures = []
        for index in range(gif.n_frames):
            gif.seek(index)
            pictures.append(np.asarray(gif.convert("RGB"), int))
    for step, picture in enumerate(pictures):
        (disc,) = pixels(VIEW, np.array([1.0, 0.5]))
        (agent,) = pixels(VIEW, np.array([1 + 2 * step / 3, 1.6]))
        for (x, y), colour in ((disc, FILLS["Red"]), (agent, (255, 255, 255))):
            assert np.abs(picture[round(y), round(x)] - colour).max() < 20
    below = picture_size(VIEW)[1]
    assert (pictures[2][below + 20 :] < 100).any() and not (pictures[0][below + 20 :] < 100).any()  # text of row 1 only


def test_long_episodes_are_shortened(tmp_path):
    save_gif(recording(1000), VIEW, tmp_path / "long.gif")
    with Image.open(tmp_path / "long.gif") as gif:
        assert 100 < gif.n_frames <= 152


def test_text_is_wrapped_and_cut():
    font = ImageFont.load_default(13)
    text = "(!Pink & !Green) U (Yellow & " * 4
    lines = wrapped(text, font, 200)
    assert len(lines) > 1 and max(map(font.getlength, lines)) <= 200
    assert " ".join(lines) == text.strip()
    many = wrapped(text * 9, font, 200)
    assert len(many) == TEXT_LINES and many[-1].endswith(" ...") and font.getlength(many[-1]) <= 200
    assert wrapped("", font, 200) == []


@pytest.mark.parametrize(
    "env",
    [
        ZoneEnv(ZoneConfig(physics="closed_form")),
        ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=2)),
        WaterWorld(),
        WaterWorld(WaterWorldConfig(colours=LETTERS, layout="random", pool_size=2, balls_per_colour=1)),
        ZoneEnv(dataclasses.replace(OPEN, physics="closed_form", pool_size=2)),
        FlatWorld(FlatWorldConfig(pool_size=2)),
        LetterWorld(LetterWorldConfig(pool_size=2)),
    ],
)
def test_views_agree_with_the_environment(env):
    view, params = env.view(), env.make_params(0)
    actual = jax.jit(lambda key: view.scene(env.reset(key).pipeline_state, params))(jax.random.key(1))
    scene = jax.eval_shape(lambda: actual)
    assert scene.discs.shape == (len(view.colours), 2) and scene.radii.shape == (len(view.colours),)
    assert scene.agent.shape == scene.heading.shape == (2,)
    assert set(view.colours) <= set(FILLS)
    assert jnp.linalg.norm(actual.heading) <= 1.0 + 1e-6
    inside = (actual.discs > jnp.array(view.low)) & (actual.discs < jnp.array(view.high))
    assert inside.all()


def test_discs_have_the_colour_that_holds_in_them():
    env = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", colours="YJWR", pool_size=2))
    zones = env.make_params(0).zones[0]
    labels_at = jax.jit(lambda centre: env.labels(env.reset_to(jnp.append(centre, 0.0), jnp.zeros(3), zones)))
    for centre, colour in zip(zones, env.view().colours, strict=True):
        labels = labels_at(centre)
        assert env.propositions[int(np.argmax(labels))] == colour and labels.sum() == 1


def test_letters_are_drawn_where_the_grid_has_them():
    """Wherever the agent is: the picture stays, and the agent moves over it."""
    env = LetterWorld(LetterWorldConfig(pool_size=2))
    view, grid = env.view(), env.make_params(0).maps[1]
    for position in ((0, 0), (2, 5)):
        scene = view.scene(env.reset_to(position, grid).pipeline_state, None)
        np.testing.assert_array_equal(scene.agent, [position[1] + 0.5, 6.5 - position[0]])
        for (x, y), text in zip(scene.discs, view.texts, strict=True):
            assert env.propositions[grid[int(7 - y), int(x)]] == text
    assert len(set(map(tuple, np.asarray(scene.discs)))) == 24


def test_a_way_through_joined_walls_is_not_drawn_across_the_picture(tmp_path):
    """From the right edge on to the left one: with walls, a line; where they are joined, none."""
    agent = np.array([[3.5, 1.5], [3.9, 1.5], [0.1, 1.5], [0.5, 1.5]])
    steps = dataclasses.replace(recording(3).scenes, agent=agent)
    told = dataclasses.replace(recording(3), scenes=steps)
    (x, y) = map(round, pixels(VIEW, np.array([2.0, 1.5]))[0])
    crossed = []
    for joined in (False, True):
        save_gif(told, dataclasses.replace(VIEW, joined=joined, texts=("a",)), tmp_path / "way.gif")
        with Image.open(tmp_path / "way.gif") as gif:
            gif.seek(3)
            blue = np.asarray(gif.convert("RGB"), int)[y, x] - (30, 90, 200)
        crossed.append(np.abs(blue).max() < 30)
    assert crossed == [True, False]


def test_a_world_without_seconds_counts_steps_only(tmp_path):
    view = dataclasses.replace(VIEW, seconds_per_step=0.0, frame_ms=250)
    save_gif(recording(3), view, tmp_path / "one.gif")
    with Image.open(tmp_path / "one.gif") as gif:
        assert gif.info["duration"] == 250


def test_other_environments_have_no_view():
    assert SingleState().view() is None


@pytest.mark.parametrize(
    ("verdict", "truncated", "said"),
    [(1, False, "done"), (-1, False, "violated"), (0, True, "out of time"), (0, False, "ended by the environment")],
)
def test_the_end_is_told(verdict, truncated, said):
    assert dataclasses.replace(recording(2), verdict=verdict, truncated=truncated).outcome == said
