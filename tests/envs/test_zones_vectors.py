"""Numbers printed in the specification of the original: start, lidar, and the first steps of constant actions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.zones import point_robot
from envs.zones.point_closed_form import ClosedFormPoint
from envs.zones.point_robot import PointState

START_LIDAR = {
    "J": [0.0162, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.0292, 0.1069, 0.2231, 0.2024],
    "R": [0.4931, 0.4472, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.2096, 0.2865, 0.0769, 0.0458],
    "W": [0.1069, 0.1877, 0.2057, 0.0180, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.0465, 0.0781, 0.0975],
    "Y": [0.0320, 0, 0, 0.0458, 0.4931, 0.4472, 0, 0, 0, 0, 0, 0, 0, 0.0210, 0.0461, 0.0781],
}

# action, env steps, (x, y), heading, velocimeter (x, y), gyro z, accelerometer (x, y)
VECTORS = [
    ((1, 0), 1, (-0.00026, -1.49943), 2.00000, (0.05661, 0), 0, (2.7817, 0)),
    ((1, 0), 2, (-0.00098, -1.49785), 2.00000, (0.11108, 0), 2e-5, (2.6768, 0.001)),
    ((0, 1), 1, (0.00076, -1.49963), 2.04473, (-0.00028, -0.05379), 2.87614, (0.1600, -0.3393)),
    ((0, 1), 10, (0.00683, -1.49380), 2.58375, (0.00453, -0.04059), 2.99842, (0.1645, 0.0782)),
    ((1, 0.5), 1, (0.00020, -1.49921), 2.02697, (0.05648, -0.03552), 1.84761, (2.8478, 17.7043)),
    ((1, 0.5), 10, (-0.02187, -1.45312), 2.26764, (0.47467, -0.07889), 1.36072, (2.0117, -5.799)),
]

# The servo amplifies rounding errors by about 5 per substep unless it saturates. In float32 only these rows are
# determined to the last digit; in the others the turning rate already chatters, and only the path is determined.
DETERMINED = [((0, 1), 1), ((0, 1), 10), ((1, 0.5), 1)]


def test_constants_are_the_published_ones():
    np.testing.assert_allclose(point_robot.MASS, 0.00518879, atol=1e-8)
    np.testing.assert_allclose(point_robot.COM_OFFSET, 0.0192723, atol=1e-7)
    np.testing.assert_allclose(point_robot.INERTIA, 2.842183e-5, atol=1e-11)


def test_original_model_has_the_same_constants(original):
    assert original.ngeom == 1 + 204 + 2
    assert original.body("robot").mass[0] == pytest.approx(point_robot.MASS, rel=1e-12)
    assert original.body("robot").ipos[0] == pytest.approx(point_robot.COM_OFFSET, rel=1e-12)
    np.testing.assert_allclose(original.dof_damping, [0.01, 0.01, 0.005])


@pytest.mark.slow
def test_start(env):
    state = env.reset(jax.random.key(0))
    np.testing.assert_allclose(state.pipeline_state.qpos, [0.0, -1.5, 2.0])
    np.testing.assert_allclose(state.pipeline_state.qvel, 0.0)
    expected = [0, 0, 9.81, 0, 0, 0, -0.4546, 0.2081, 0, 0, 0, 0]
    np.testing.assert_allclose(state.obs[:12], expected, atol=5.1e-5)
    np.testing.assert_allclose(state.obs[12:].reshape(4, 16), list(START_LIDAR.values()), atol=5.1e-5)


def test_start_distances_in_index_order(env):
    state = env.reset(jax.random.key(0)).pipeline_state
    distances = np.linalg.norm(state.zones - state.qpos[:2], axis=1)
    expected = [1.5, 2.236, 3.640, 0.707, 1.25, 1.581, 2.236, 2.55, 2.55, 0.707, 3.640]
    np.testing.assert_allclose(distances, expected, atol=6e-4)


def test_first_steps_of_constant_actions(drive):
    states = drive([(0.0, -1.5, 2.0)] * len(VECTORS), [row[0] for row in VECTORS])
    for i, (action, steps, position, heading, velocimeter, gyro, accelerometer) in enumerate(VECTORS):
        qpos, obs = states.pipeline_state.qpos[steps - 1, i], states.obs[steps - 1, i]
        np.testing.assert_allclose(qpos[:2], position, atol=1e-4)
        np.testing.assert_allclose(qpos[2], heading, atol=0.01)
        np.testing.assert_allclose(obs[9], velocimeter[0], atol=1e-3)
        if (action, steps) in DETERMINED:
            np.testing.assert_allclose(qpos, [*position, heading], atol=6e-6)
            np.testing.assert_allclose(obs[9:11], velocimeter, atol=6e-6)
            np.testing.assert_allclose(obs[5], gyro, atol=1e-5)
            np.testing.assert_allclose(obs[:2], accelerometer, atol=1.1e-4)


def test_vectors_in_double_precision():
    """Without float32's rounding the closed form gives every row but the chaotic last one to the printed digits."""
    with jax.enable_x64(True):
        point = ClosedFormPoint()
        step = jax.jit(point.step)
        for action, steps, position, heading, _, gyro, accelerometer in VECTORS[:-1]:
            state = PointState(qpos=jnp.array([0.0, -1.5, 2.0]), qvel=jnp.zeros(3))
            for _ in range(steps):
                state = step(state, jnp.array(action, jnp.float32))
            assert state.qpos.dtype == jnp.float64
            np.testing.assert_allclose(state.qpos, [*position, heading], atol=6e-6)
            np.testing.assert_allclose(state.qvel[2], gyro, atol=2.1e-5)
            acceleration = point.acceleration(state, jnp.array(action, jnp.float32))
            np.testing.assert_allclose(acceleration, accelerometer, atol=1.1e-3)


def test_full_thrust_from_rest(drive):
    """Speed and distance of a straight run, which the servo's chatter hardly bends."""
    expected = {
        1: (0.0566, 0.0006),
        5: (0.2625, 0.0138),
        10: (0.4790, 0.0514),
        25: (0.9267, 0.269),
        50: (1.2809, 0.835),
    }
    robot = drive([(-1.0, 0.0, 0.0)], [(1.0, 0.0)]).pipeline_state
    for steps, (speed, distance) in expected.items():
        np.testing.assert_allclose(np.linalg.norm(robot.qvel[steps - 1, 0, :2]), speed, rtol=0.002)
        np.testing.assert_allclose(robot.qpos[steps - 1, 0, 0] + 1.0, distance, rtol=0.005, atol=6e-5)


@pytest.mark.slow
def test_motor_saturates_at_a_twentieth(closed_form_env):
    state = closed_form_env.reset(jax.random.key(0))
    full = closed_form_env.step(state, jnp.array([1.0, 0.0]))
    for drive in (0.05, 0.5, 7.0):
        weak = closed_form_env.step(state, jnp.array([drive, 0.0]))
        np.testing.assert_array_equal(weak.pipeline_state.qpos, full.pipeline_state.qpos)


def test_mean_turning_rates(closed_form_env):
    turns, means = [0.0, 0.2, 0.5, 0.8, 0.95, 1.0], [0.0, 0.50, 1.35, 2.44, 3.0, 3.0]

    def rate(turn):
        def run(state, steps):
            action = jnp.stack([0.0, turn])
            return jax.lax.fori_loop(0, steps, lambda _, s: closed_form_env.step(s, action), state)

        settled = run(closed_form_env.reset_to(jnp.zeros(3), jnp.zeros(3)), 200)
        later = run(settled, 500)
        return (later.pipeline_state.qpos[2] - settled.pipeline_state.qpos[2]) / 10.0

    np.testing.assert_allclose(jax.jit(jax.vmap(rate))(jnp.array(turns)), means, atol=0.03)
