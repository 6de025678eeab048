"""The drawing loop on views made by hand, and the views of both environments."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image, ImageFont

from envs.waterworld import LETTERS, WaterWorld, WaterWorldConfig
from envs.zones import ZoneConfig, ZoneEnv
from experiments.views import view_of
from t2tl_jax.evaluation.animation import FILLS, SIDE, TEXT_LINES, WALL, Recording, Scene, View, save_gif, wrapped
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv

VIEW = View(lambda state: state, (0.0, 0.0), (4.0, 2.0), ("Red",), 0.25, (255, 255, 255), 0.5)


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
        (disc,) = VIEW.pixels(np.array([1.0, 0.5]))
        (agent,) = VIEW.pixels(np.array([1 + 2 * step / 3, 1.6]))
        for (x, y), colour in ((disc, FILLS["Red"]), (agent, (255, 255, 255))):
            assert np.abs(picture[round(y), round(x)] - colour).max() < 20
    below = VIEW.size[1]
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
    ("env", "task"),
    [
        (ZoneEnv(ZoneConfig(physics="closed_form")), "F Red"),
        (ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=2)), "F Red"),
        (WaterWorld(), "F Pink"),
        (WaterWorld(WaterWorldConfig(colours=LETTERS, layout="random", pool_size=2, balls_per_colour=1)), "F a"),
    ],
)
def test_views_agree_with_the_environment(env, task):
    view = view_of(TaskEnv(env, compile_tasks([task], env.propositions, env.alphabet)))
    state = env.reset(jax.random.key(1)).pipeline_state
    scene = jax.eval_shape(view.scene, state)
    assert scene.discs.shape == (len(view.colours), 2) and scene.radii.shape == (len(view.colours),)
    assert scene.agent.shape == scene.heading.shape == (2,)
    assert set(view.colours) <= set(FILLS)
    actual = view.scene(state)
    assert jnp.linalg.norm(actual.heading) <= 1.0 + 1e-6
    inside = (actual.discs > jnp.array(view.low)) & (actual.discs < jnp.array(view.high))
    assert inside.all()


def test_other_environments_have_no_view():
    assert view_of(object()) is None
