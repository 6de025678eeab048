"""What happens at a wall: where the robot stops, and how far the cheaper walls are from the original's 204 cubes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.zones.point_robot import PointState

QUARTERS = np.array([0.0, 0.5, 1.0, 1.5]) * np.pi


def test_stopping_distances(drive):
    """Five seconds of full drive from the centre towards each wall, first ahead, then backwards."""
    headings = np.concatenate([QUARTERS, QUARTERS + np.pi])
    qpos = np.stack([np.zeros(8), np.zeros(8), headings], axis=1)
    path = drive(qpos, [(1.0, 0.0)] * 4 + [(-1.0, 0.0)] * 4).pipeline_state.qpos
    towards = np.stack([np.cos(QUARTERS), np.sin(QUARTERS)], axis=1)
    reached = np.einsum("tid,id->ti", path[..., :2], np.concatenate([towards, towards]))
    np.testing.assert_allclose(reached[-1, :4], 2.25, atol=0.01)
    np.testing.assert_allclose(reached[-1, 4:], 2.30, atol=0.01)
    assert reached[:, :4].max() < 2.265 and reached[:, 4:].max() < 2.315


@pytest.fixture(scope="module")
def wall_states():
    """500 random motions that touch the right wall or are within a millimetre of it, with random actions."""
    rng, states = np.random.default_rng(0), []
    while len(states) < 500:
        x, y, heading = rng.uniform([2.2, -1.5, -np.pi], [2.305, 1.5, np.pi])
        cos, sin = np.cos(heading), np.sin(heading)
        reach = x + max(0.1, 0.1 * cos + 0.05 * (abs(cos) + abs(sin)))
        if 2.399 < reach < 2.405:
            states.append(((x, y, heading), rng.uniform([-1, -1, -3], [1, 1, 3]), rng.uniform(-1, 1, 2)))
    return tuple(np.array(part) for part in zip(*states, strict=True))


def errors_after_one_env_step(point, run_original, wall_states):
    """Distances in position and in velocity from the original after 20 ms, for every state."""
    qpos, qvel, _ = run_original(*wall_states, substeps=10)
    states = PointState(*(jnp.asarray(a, jnp.float32) for a in wall_states[:2]))
    ours = jax.jit(jax.vmap(point.step))(states, jnp.asarray(wall_states[2], jnp.float32))
    return np.linalg.norm((ours.qpos - qpos)[:, :2], axis=1), np.linalg.norm((ours.qvel - qvel)[:, :2], axis=1)


@pytest.mark.slow
def test_mjx_walls_are_close_to_the_original(mjx_point, run_original, wall_states):
    """Measured: positions 0.15 mm (median) and 1.4 mm (95 %) off, velocities 0.01 and 0.08 m/s."""
    position, velocity = errors_after_one_env_step(mjx_point, run_original, wall_states)
    print(f"mjx: {np.quantile(position, [0.5, 0.95])} m, {np.quantile(velocity, [0.5, 0.95])} m/s")
    assert np.median(position) < 3e-4 and np.quantile(position, 0.95) < 3e-3
    assert np.median(velocity) < 0.02 and np.quantile(velocity, 0.95) < 0.15


def test_closed_form_walls_stop_at_the_same_place(closed_form_point, run_original, wall_states):
    """Measured: positions 3 mm (median) and 10 mm (95 %) off, velocities 0.10 and 0.38 m/s: no rebound, no softness."""
    position, velocity = errors_after_one_env_step(closed_form_point, run_original, wall_states)
    print(f"closed form: {np.quantile(position, [0.5, 0.95])} m, {np.quantile(velocity, [0.5, 0.95])} m/s")
    assert np.median(position) < 0.005 and np.quantile(position, 0.95) < 0.02
    assert np.median(velocity) < 0.15 and np.quantile(velocity, 0.95) < 0.5


def test_slides_along_a_wall_with_friction(env, drive, run_original):
    """Two seconds of full drive at 45 degrees. Original 0.96 m, MJX 1.03 m, closed form 0.77 m; 1.58 m frictionless."""
    start, action = np.array([[1.5, -1.5, np.pi / 4]]), np.array([[1.0, 0.0]])
    qpos, _, _ = run_original(start, np.zeros((1, 3)), action, substeps=1000)
    travelled = drive(start, action).pipeline_state.qpos[99, 0, 1] + 1.5
    expected = qpos[0, 1] + 1.5
    print(f"{env.backend}: {travelled:.3f} m, original {expected:.3f} m")
    assert travelled == pytest.approx(expected, abs=0.15 if env.backend == "mjx" else 0.3)


@pytest.mark.slow
def test_nothing_leaves_the_arena(closed_form_env):
    """Twenty seconds of driving forwards in random curves."""
    key = jax.random.key(0)
    heading = jax.random.uniform(key, (64,), maxval=6.28)
    qpos = jnp.stack([jnp.zeros(64), jnp.zeros(64), heading], axis=1)
    states = jax.jit(jax.vmap(closed_form_env.reset_to, in_axes=(0, None)))(qpos, jnp.zeros(3))

    def step(states, key):
        actions = jnp.array([1.0, 0.3]) * jax.random.uniform(key, (64, 2))
        states = jax.vmap(closed_form_env.step)(states, actions)
        return states, jnp.abs(states.pipeline_state.qpos[:, :2]).max()

    _, furthest = jax.lax.scan(step, states, jax.random.split(key, 1000))
    assert 2.2 < furthest.max() < 2.3 + 1e-6
