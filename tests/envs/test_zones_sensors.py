"""Order of the observation, the lidar against its definition, and the boundary of the discs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.zones import EPISODE_LENGTH, ZoneConfig, ZoneEnv
from envs.zones import layouts as zone_layouts


def published_lidar(qpos: np.ndarray, zones: np.ndarray, reading=lambda distance: np.exp(-distance)) -> np.ndarray:
    """The bins of one colour, disc by disc and bin by bin as the original defines them (float64)."""
    bins, width = np.zeros(16), 2 * np.pi / 16
    rotation = np.array([[np.cos(qpos[2]), -np.sin(qpos[2])], [np.sin(qpos[2]), np.cos(qpos[2])]])
    for centre in zones:
        ahead, left = (centre - qpos[:2]) @ rotation
        angle = np.arctan2(left, ahead) % (2 * np.pi)
        strength, index = reading(np.hypot(ahead, left)), int(angle / width)
        share = angle / width - index
        for bin_, part in ((index, 1.0), (index + 1, share), (index - 1, 1.0 - share)):
            bins[bin_ % 16] = max(bins[bin_ % 16], part * strength)
    return bins


def test_lidar_follows_the_definition(closed_form_env):
    rng = np.random.default_rng(0)
    qpos = np.concatenate([rng.uniform(-2.3, 2.3, (200, 2)), rng.uniform(-9, 9, (200, 1))], axis=1)
    zones = np.array(zone_layouts.FIXED_ZONES)
    obs = jax.jit(jax.vmap(closed_form_env.reset_to, (0, None)))(jnp.asarray(qpos), jnp.zeros(3)).obs
    for pose, lidars in zip(qpos, np.asarray(obs[:, 12:]).reshape(-1, 4, 16), strict=True):
        expected = [published_lidar(pose, zones[discs]) for discs in ([0, 1, 2], [3, 4], [5, 6, 7], [8, 9, 10])]
        np.testing.assert_allclose(lidars, expected, atol=3e-6)


def test_observation_order(closed_form_env):
    heading, velocity, turn = 0.3, np.array([0.5, -0.2]), 1.25
    obs = closed_form_env.reset_to(jnp.array([0.1, 0.2, heading]), jnp.array([*velocity, turn])).obs
    along = np.array([np.cos(heading), np.sin(heading)])
    aside = np.array([-np.sin(heading), np.cos(heading)])
    assert obs.shape == (76,) and obs.dtype == jnp.float32
    np.testing.assert_allclose(obs[2:6], [9.81, 0, 0, turn], atol=1e-6)
    np.testing.assert_allclose(obs[6:9], [*(-0.5 * np.array([along[1], aside[1]])), 0], atol=1e-6)
    np.testing.assert_allclose(obs[9:12], [velocity @ along, velocity @ aside, 0], atol=1e-6)


@pytest.mark.slow
def test_lidar_blocks_are_in_order_of_letters_and_labels_in_order_of_colours():
    """Stand in the only disc of each colour in turn: its block shows the strongest reading, its label alone is true."""
    env = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", colours="YWRJ", pool_size=1))
    assert env.propositions == ("Black", "White", "Red", "Yellow")
    zones = jnp.array([[-1.5, -1.5], [1.5, -1.5], [-1.5, 1.5], [1.5, 1.5]])
    for letter, block, label in (("J", 0, 0), ("R", 1, 2), ("W", 2, 1), ("Y", 3, 3)):
        centre = zones["YWRJ".index(letter)]
        state = env.reset_to(jnp.array([*centre, 0.5]), jnp.zeros(3), zones)
        lidars = state.obs[12:].reshape(4, 16)
        assert int(lidars.max(axis=1).argmax()) == block and float(lidars[block].max()) == pytest.approx(1.0)
        np.testing.assert_array_equal(env.labels(state), np.arange(4) == label)


@pytest.mark.slow
def test_other_colours_change_the_sizes():
    env = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", colours="GGMCB", pool_size=4))
    assert env.propositions == ("Blue", "Green", "Cyan", "Magenta")
    state = env.reset(jax.random.key(0))
    assert state.obs.shape == (env.observation_size,) == (12 + 4 * 16,)
    assert env.labels(state).shape == (4,)


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_labels_include_the_boundary(closed_form_env, direction):
    boundary = jnp.array(direction, jnp.float32) * 0.25  # exact in binary
    beyond = boundary * (1 + 1e-6)
    on = closed_form_env.reset_to(jnp.array([*boundary, 0.0]), jnp.zeros(3))
    off = closed_form_env.reset_to(jnp.array([*beyond, 0.0]), jnp.zeros(3))
    np.testing.assert_array_equal(closed_form_env.labels(on), [True, False, False, False])
    assert not closed_form_env.labels(off).any()


@pytest.mark.slow
def test_at_most_one_label_anywhere(closed_form_env):
    xs = jnp.linspace(-2.4, 2.4, 241)
    grid = jnp.stack([*jnp.meshgrid(xs, xs), jnp.zeros((241, 241))], axis=-1).reshape(-1, 3)
    labels = jax.jit(jax.vmap(lambda q: closed_form_env.labels(closed_form_env.reset_to(q, jnp.zeros(3)))))(grid)
    counts = np.asarray(labels.sum(axis=1))
    assert closed_form_env.alphabet == "at_most_one" and set(counts) == {0, 1}
    np.testing.assert_allclose(counts.mean() * 4.8**2, 11 * np.pi * 0.25**2, rtol=0.02)


def test_published_episode_limit():
    assert EPISODE_LENGTH == 1000
