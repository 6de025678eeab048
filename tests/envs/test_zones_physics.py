"""One substep three ways: the original MuJoCo scene, MJX, and the closed form."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.zones.point_robot import PointState

STATES = 1000


@pytest.fixture(scope="module")
def free_states():
    """Random motions and actions clear of the walls: qpos and qvel ``float64[1000, 3]``, action ``[1000, 2]``."""
    rng = np.random.default_rng(1)
    qpos = np.concatenate([rng.uniform(-2.2, 2.2, (STATES, 2)), rng.uniform(-np.pi, np.pi, (STATES, 1))], axis=1)
    qvel = np.concatenate([rng.uniform(-1.5, 1.5, (STATES, 2)), rng.uniform(-3.5, 3.5, (STATES, 1))], axis=1)
    # Rounded to float32 first: the comparison is about the step, not about its input.
    return tuple(a.astype(np.float32).astype(float) for a in (qpos, qvel, rng.uniform(-1.3, 1.3, (STATES, 2))))


def substep(point, states):
    """One substep and the acceleration after it, for a batch of states, with the given physics."""

    def one(qpos, qvel, action):
        state = point.step(PointState(qpos=qpos, qvel=qvel), action, substeps=1)
        return state.qpos, state.qvel, point.acceleration(state, action)

    return tuple(np.asarray(a) for a in jax.jit(jax.vmap(one))(*(jnp.asarray(a, jnp.float32) for a in states)))


@pytest.fixture(scope="module")
def original_substep(run_original, free_states):
    qpos, qvel, qacc = run_original(*free_states, substeps=1)
    cos, sin = np.cos(qpos[:, 2]), np.sin(qpos[:, 2])
    body = np.stack([cos * qacc[:, 0] + sin * qacc[:, 1], cos * qacc[:, 1] - sin * qacc[:, 0]], axis=1)
    return qpos, qvel, body


@pytest.fixture(scope="module")
def mjx_substep(mjx_point, free_states):
    return substep(mjx_point, free_states)


@pytest.fixture(scope="module")
def closed_form_substep(closed_form_point, free_states):
    return substep(closed_form_point, free_states)


MJX = [pytest.param(pair, marks=pytest.mark.slow) for pair in ("mjx-original", "closed_form-mjx")]


@pytest.mark.parametrize("pair", ["closed_form-original", *MJX])
def test_one_substep_agrees(pair, request):
    results = {name: request.getfixturevalue(f"{name}_substep") for name in pair.split("-")}
    ours, reference = (results[name] for name in pair.split("-"))
    np.testing.assert_allclose(ours[0], reference[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(ours[1], reference[1], rtol=0, atol=1e-5)
    # The servo turns an error of the turning rate into 60 times as much acceleration.
    np.testing.assert_allclose(ours[2], reference[2], rtol=0, atol=2e-4)


@pytest.mark.slow
def test_ten_substeps_are_one_environment_step(closed_form_env, closed_form_point):
    state = closed_form_env.reset(jax.random.key(0))
    action = jnp.array([0.3, 0.9])
    robot = state.pipeline_state.robot
    for _ in range(10):
        robot = closed_form_point.step(robot, action, substeps=1)
    stepped = closed_form_env.step(state, action).pipeline_state
    np.testing.assert_allclose(stepped.qpos, robot.qpos, atol=1e-5)


@pytest.mark.slow
def test_mjx_step_and_acceleration_are_those_of_the_two_apart(mjx_point, free_states):
    """At the walls too: eleven substeps in one loop are ten substeps and a forward pass. With JAX 0.9 they are equal
    bit for bit, with 0.11 to rounding, which contacts make more of in some velocities."""
    qpos, qvel, action = (jnp.asarray(a, jnp.float32) for a in free_states)
    states = PointState(qpos=qpos.at[::2, 0].set(2.25), qvel=qvel)

    def apart(state, action):
        after = mjx_point.step(state, action)
        return after, mjx_point.acceleration(after, action)

    robot, acceleration = jax.jit(jax.vmap(mjx_point.step_and_acceleration))(states, action)
    robot_apart, acceleration_apart = jax.jit(jax.vmap(apart))(states, action)
    np.testing.assert_allclose(robot.qpos, robot_apart.qpos, rtol=0, atol=2e-6)
    np.testing.assert_allclose(robot.qvel, robot_apart.qvel, rtol=0, atol=5e-4)
    np.testing.assert_allclose(acceleration, acceleration_apart, rtol=1e-4, atol=1e-3)


def test_mjx_model_has_the_constants_of_the_robot(mjx_point):
    model = mjx_point._model
    assert model.opt.timestep == pytest.approx(0.002)
    assert int(model.ngeom) == 4 + 2 + 2
    np.testing.assert_allclose(model.body_mass[1], 0.00518879, rtol=1e-5)
    np.testing.assert_allclose(model.body_ipos[1], [0.0192723, 0, 0], atol=1e-7)
