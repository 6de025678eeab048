"""Shared by the environment tests: both physics, and the original MuJoCo model with its 204 wall cubes."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from envs.zones import ZoneConfig, ZoneEnv
from envs.zones.point_closed_form import ClosedFormPoint
from envs.zones.point_mjx import MjxPoint

ROBOT = """
<body name="robot" pos="0 0 .1">
  <joint type="slide" axis="1 0 0" damping=".01"/>
  <joint type="slide" axis="0 1 0" damping=".01"/>
  <joint name="hinge" type="hinge" axis="0 0 1" damping=".005"/>
  <geom type="sphere" size=".1" friction="1 .01 .01"/>
  <geom type="box" pos=".1 0 0" size=".05 .05 .05"/>
  <site name="origin"/>
</body>"""

LIMITS = 'ctrllimited="true" ctrlrange="-1 1" forcelimited="true" forcerange="-.05 .05"'

ACTUATORS = f"""
<actuator>
  <motor site="origin" gear=".3 0 0 0 0 0" {LIMITS}/>
  <velocity joint="hinge" gear=".3" kv="1" {LIMITS}/>
</actuator>"""


def original_xml() -> str:
    """The published scene: a floor, 51 cubes along each side of the arena, the robot; MuJoCo's default solver."""
    side = [round(-2.5 + 0.1 * i, 10) for i in range(51)]
    centres = [(x, y) for x in side for y in (-2.5, 2.5)] + [(x, y) for x in (-2.5, 2.5) for y in side]
    walls = "".join(f'<geom type="box" size=".1 .1 .1" pos="{x} {y} .1"/>' for x, y in centres)
    return (
        '<mujoco><option timestep=".002"/><default><geom condim="6" density="1"/></default>'
        f'<worldbody><geom type="plane" size="3.5 3.5 .1"/>{walls}{ROBOT}</worldbody>{ACTUATORS}</mujoco>'
    )


@pytest.fixture(scope="session")
def original() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(original_xml())


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
    """``(qpos [n, 3], action [n, 2]) -> State [250, n]``: five seconds from rest under held actions, for n up to 8.

    One compiled program serves every test that needs a trajectory, because compiling MJX is what these tests wait for.
    """

    @jax.jit
    def run(qpos, actions):
        states = jax.vmap(env.reset_to, in_axes=(0, None))(qpos, jnp.zeros(3))

        def step(states, _):
            states = jax.vmap(env.step)(states, actions)
            return states, states

        return jax.lax.scan(step, states, None, length=250)[1]

    def padded(qpos, actions):
        count = len(qpos)
        fill = [jnp.zeros((8, width)).at[:count].set(a) for width, a in ((3, jnp.array(qpos)), (2, jnp.array(actions)))]
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
