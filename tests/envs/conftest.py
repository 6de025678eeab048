"""Shared by the environment tests: both physics, and the original MuJoCo model with its 204 wall cubes."""

from functools import partial

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from envs.zones import ZoneConfig, ZoneEnv
from envs.zones.original_scene import original_model
from envs.zones.point_closed_form import ClosedFormPoint
from envs.zones.point_mjx import MjxPoint

OPTIMISED = {"xla_backend_optimization_level": 1}
"""Compiler options of programs that run much longer than they compile; see `tests/conftest.py`."""


@pytest.fixture(scope="session")
def original() -> mujoco.MjModel:
    return original_model()


@pytest.fixture(scope="session")
def run_original(original):
    """``(qpos [n, 3], qvel [n, 3], action [n, 2], substeps) -> (qpos, qvel, qacc)``, the last from a forward pass."""

    def run(qpos, qvel, action, substeps):
        data, results = mujoco.MjData(original), []
        for q, v, a in zip(qpos, qvel, action, strict=True):
            mujoco.mj_resetData(original, data)
            data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, a
            mujoco.mj_step(original, data, substeps)
            mujoco.mj_forward(original, data)
            results.append((data.qpos.copy(), data.qvel.copy(), data.qacc.copy()))
        return tuple(np.array(part) for part in zip(*results, strict=True))

    return run


@pytest.fixture(scope="session", params=[pytest.param("mjx", marks=pytest.mark.slow), "closed_form"])
def env(request) -> ZoneEnv:
    """Both physics; the fast subset leaves MJX out, since compiling a step takes long."""
    return ZoneEnv(ZoneConfig(physics=request.param))


@pytest.fixture(scope="session")
def drive(env):
    """``(qpos [n, 3], action [n, 2]) -> State [250, n]``: five seconds under held actions, for n up to 8.

    From rest, or from velocities ``[n, 3]`` as a third argument.

    One compiled program serves every test that needs a trajectory, because compiling MJX is what these tests wait for.
    """

    @partial(jax.jit, compiler_options=OPTIMISED)
    def run(qpos, actions, qvel):
        states = jax.vmap(env.reset_to)(qpos, qvel)

        def step(states, _):
            states = jax.vmap(env.step)(states, actions)
            return states, states

        return jax.lax.scan(step, states, None, length=250)[1]

    def padded(qpos, actions, qvel=()):
        count = len(qpos)
        given = ((3, qpos), (2, actions), (3, qvel))
        fill = [jnp.zeros((8, width)).at[: len(a)].set(jnp.array(a).reshape(-1, width)) for width, a in given]
        return jax.tree.map(lambda x: np.asarray(x[:, :count]), run(*fill))

    return padded


@pytest.fixture(scope="session")
def closed_form_env() -> ZoneEnv:
    return ZoneEnv(ZoneConfig(physics="closed_form"))


@pytest.fixture(scope="session")
def mjx_point() -> MjxPoint:
    return MjxPoint()


@pytest.fixture(scope="session")
def closed_form_point() -> ClosedFormPoint:
    return ClosedFormPoint()
