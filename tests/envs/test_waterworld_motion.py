"""A thousand steps beside an independent double-precision world: motion, bounces, touches, observations."""

import dataclasses
import math
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.waterworld import LETTERS, WaterWorld, WaterWorldConfig
from tests.envs.waterworld_reference import ReferenceWorld, published_map

STEPS = 1000
BIG = (15.0,) * 5 + (37.5,) * 3
WORLDS = [
    pytest.param(WaterWorldConfig(), 1, id="eight colours"),
    pytest.param(WaterWorldConfig(colours=LETTERS), 2, id="six colours"),
    pytest.param(WaterWorldConfig(radii=BIG), 4, id="large obstacles"),
]


def actions_of(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 5, STEPS).astype(np.int32)


def run(env, state, actions, params=None):
    """Positions, velocities, observations and labels after each action."""

    def step(state, action):
        state = env.step(state, action, params)
        return state, (state.pipeline_state, state.obs, env.labels(state))

    return jax.jit(lambda state, actions: jax.lax.scan(step, state, actions)[1])(state, jnp.asarray(actions))


def reference(config, map_number, actions):
    """The same from the independent world, and the world itself for its counters."""
    start = published_map(map_number, 2 * len(config.colours))
    radii = [radius for radius in config.radii for _ in range(2)] or None
    world = ReferenceWorld(*start, radii=radii)
    rows = []
    for action in actions:
        onset, level = world.step(int(action))
        labels = [[colour in found for colour in range(len(config.colours))] for found in (onset, level)]
        positions, velocities = (np.array([body[i] for body in [world.agent, *world.balls]]) for i in (0, 1))
        rows.append((positions, velocities, world.observation(), *labels))
    return start, world, tuple(np.array(part) for part in zip(*rows, strict=True))


def stacked(pipeline):
    positions = np.concatenate([pipeline.agent_position[:, None], pipeline.ball_positions], axis=1)
    velocities = np.concatenate([pipeline.agent_velocity[:, None], pipeline.ball_velocities], axis=1)
    return positions, velocities


@pytest.mark.slow
@pytest.mark.parametrize(("config", "number"), WORLDS)
def test_single_precision_follows_the_reference(config, number):
    actions = actions_of(number)
    (agent, balls, velocities), world, expected = reference(config, number, actions)
    # Otherwise rounding might shift a touch by a step, and this test would be about luck.
    assert world.smallest_margin > 1e-2 and world.bounces > 100
    for events, labels in (("onset", expected[3]), ("level", expected[4])):
        env = WaterWorld(dataclasses.replace(config, events=events))
        pipeline, obs, found = run(env, env.reset_to(agent, jnp.zeros(2), balls, velocities), actions)
        assert obs.dtype == jnp.float32
        positions, speeds = stacked(pipeline)
        np.testing.assert_allclose(positions, expected[0], rtol=0, atol=8e-3)
        np.testing.assert_allclose(speeds, expected[1], rtol=0, atol=1e-5)
        np.testing.assert_allclose(obs, expected[2], rtol=0, atol=2.5e-5)
        np.testing.assert_array_equal(found, labels)
        assert labels.any(axis=1).sum() > 20


@pytest.mark.slow
@pytest.mark.parametrize(("config", "number"), WORLDS)
def test_double_precision_follows_the_reference(config, number):
    """A step computes in the precision of its state."""
    actions = actions_of(number)
    (agent, balls, velocities), _, expected = reference(config, number, actions)
    with jax.enable_x64(True):
        env = WaterWorld(config)
        state = env.reset_to(agent, jnp.zeros(2), balls, velocities)
        # 0.1 is not a float32: round the widened parameters back to the numbers that they stand for.
        params = jax.tree.map(lambda x: jnp.asarray(np.round(np.asarray(x, np.float64), 6)), env.make_params(0))
        exact = dataclasses.replace(
            state.pipeline_state,
            agent_position=jnp.asarray(agent),
            agent_velocity=jnp.zeros(2, jnp.float64),
            ball_positions=jnp.asarray(balls),
            ball_velocities=jnp.asarray(velocities),
        )
        state = state.replace(pipeline_state=exact, obs=jnp.float64(state.obs))
        pipeline, obs, labels = run(env, state, actions, params)
        assert obs.dtype == jnp.float64
        positions, speeds = stacked(pipeline)
        np.testing.assert_allclose(positions, expected[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(speeds, expected[1], rtol=0, atol=1e-12)
        np.testing.assert_allclose(obs, expected[2], rtol=0, atol=1e-11)
        np.testing.assert_array_equal(labels, expected[3])


@pytest.fixture(scope="module")
def one_ball() -> WaterWorld:
    return WaterWorld(WaterWorldConfig(colours=("Red",), balls_per_colour=1))


@cache
def compiled(env):
    return jax.jit(env.step)


def path(env, agent, velocity, ball, ball_velocity, actions):
    state, states = env.reset_to(agent, velocity, jnp.array([ball]), jnp.array([ball_velocity])), []
    for action in actions:
        state = compiled(env)(state, action)
        states.append(state.pipeline_state)
    return jax.tree.map(lambda *x: np.stack(x), *states)


@pytest.mark.parametrize(("action", "push"), list(enumerate([(0, 0), (0, 30), (30, 0), (0, -30), (-30, 0)])))
def test_actions_push_along_one_axis(one_ball, action, push):
    after = path(one_ball, (200, 200), (0, 0), (50, 50), (0, 0), [action])
    np.testing.assert_allclose(after.agent_velocity[0], push)
    np.testing.assert_allclose(after.agent_position[0], 200 + 0.1 * np.array(push), atol=1e-4)


def test_velocity_stays_and_is_limited_on_each_axis(one_ball):
    after = path(one_ball, (100, 100), (0, 0), (50, 350), (0, 0), [1, 1, 1, 1, 2, 2, 2, 2, 0, 0])
    expected = [(0, 30), (0, 60), (0, 90), (0, 90), (30, 90), (60, 90), (90, 90), (90, 90), (90, 90), (90, 90)]
    np.testing.assert_allclose(after.agent_velocity, expected)


def test_a_body_that_starts_beyond_a_wall_is_turned_twice(one_ball):
    """It flies inwards, is turned outwards by the wall, and turned back one step later. The agent does the same."""
    after = path(one_ball, (200, 390), (0, -30), (390, 200), (-30, 0), [0, 0, 0])
    np.testing.assert_allclose(after.ball_positions[:, 0, 0], [385, 385, 382])
    np.testing.assert_allclose(after.ball_velocities[:, 0, 0], [30, -30, -30])
    np.testing.assert_allclose(after.agent_position[:, 1], [385, 385, 382])
    np.testing.assert_allclose(after.agent_velocity[:, 1], [30, -30, -30])


def test_touching_a_wall_is_no_bounce_and_a_corner_is_two(one_ball):
    after = path(one_ball, (18, 382), (-30, 30), (200, 200), (0, 0), [0, 0, 0])
    np.testing.assert_allclose(after.agent_position, [(15, 385), (15, 385), (18, 382)])
    np.testing.assert_allclose(after.agent_velocity, [(-30, 30), (30, -30), (30, -30)])


def test_larger_balls_bounce_and_touch_earlier():
    env = WaterWorld(WaterWorldConfig(colours=("Red",), balls_per_colour=1, radii=(37.5,)))
    after = path(env, (200, 200), (0, 0), (40, 200), (-30, 0), [0, 0])
    np.testing.assert_allclose(after.ball_positions[:, 0, 0], [37.5, 40.5])
    assert path(env, (200, 200), (0, 0), (252.5, 200), (0, 0), [0]).contact[0, 0]
    assert not path(env, (200, 200), (0, 0), (252.6, 200), (0, 0), [0]).contact[0, 0]


def test_observation_of_a_known_state():
    env = WaterWorld()
    balls = np.arange(32.0).reshape(16, 2) * 10 + 20
    velocities = np.arange(32.0).reshape(16, 2) - 10
    agent, velocity = np.array([100.0, 300.0]), np.array([90.0, -45.0])
    obs = env.reset_to(agent, velocity, balls, velocities).obs
    assert obs.shape == (68,) == (env.observation_size,) and obs.dtype == jnp.float32
    np.testing.assert_allclose(obs[:4], [0.25, 0.75, 1.0, -0.5])
    for k in range(16):
        expected = [*(balls[k] - agent) / 400, *(velocities[k] - velocity) / 120]
        np.testing.assert_allclose(obs[4 + 4 * k : 8 + 4 * k], expected, atol=1e-6)


def test_balls_keep_their_speed(one_ball):
    after = path(one_ball, (15, 15), (0, 0), (200, 200), (30 * math.sin(1), 30 * math.cos(1)), [0] * 300)
    np.testing.assert_allclose(np.linalg.norm(after.ball_velocities, axis=-1), 30, rtol=1e-6)
