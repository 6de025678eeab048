"""The motion of the Point robot by MuJoCo MJX, the reference physics: soft walls with friction included."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import jax
import jax.numpy as jnp
import mujoco
from mujoco import mjx

from envs.straight_line import straight_line
from envs.zones.point_closed_form import solve
from envs.zones.point_robot import SUBSTEPS, TIMESTEP, PointState, clip_action

MODEL_FILE = Path(__file__).with_name("point.xml")
"""The MuJoCo model; its slide axes are world axes, so ``qpos`` is the robot's position and heading as they are."""

Numbers: TypeAlias = tuple[jax.Array, ...]
"""Single numbers."""

_SUBSTEPS: dict[bool, Callable[..., Numbers]] = {}
"""The substep with and without walls; it takes seconds to make, and all environments share it."""


class MjxPoint:
    """Physics by MJX. Only position and velocity pass from one substep to the next.

    MJX's own state has some ninety arrays. None of them is needed once a substep is over: the solver starts cold, which
    is both faster and more accurate here than its warm start (one Newton step from the unconstrained acceleration).

    Away from the walls a substep agrees with the original scene of 204 cubes to 1e-5. Where a robot that is driven by
    random actions touches a wall, its position, velocity and turning rate differ after 20 ms (median / 95 %) by
    0.22 / 0.98 mm, 0.018 / 0.085 m/s, 0.07 / 0.84 rad/s: planes have no gaps, the contacts have no torsional friction,
    and the front corners touch as two points. ``python -m experiments.benchmarks.walls`` measures it.

    Args:
        walls: whether they stop the robot.
    """

    def __init__(self, walls: bool = True) -> None:
        model = mujoco.MjModel.from_xml_string(MODEL_FILE.read_text())
        if not walls:  # nothing else can be touched, and MJX then has no solver to run
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        with jax.ensure_compile_time_eval():
            self._model = mjx.put_model(model, impl="jax")
            self._blank = mjx.make_data(self._model, impl="jax")
        self._walls = walls

    def step(self, state: PointState, action: jax.Array, substeps: int = SUBSTEPS) -> PointState:
        """The robot after ``substeps`` substeps of 2 ms under a held ``action`` of ``float32[2]``."""
        action = clip_action(action)
        start = _numbers(state)
        end, _ = jax.lax.scan(lambda motion, _: (self._substep(*motion, *action)[:6], None), start, None, substeps)
        return _state(end)

    def acceleration(self, state: PointState, action: jax.Array) -> jax.Array:
        """Acceleration of the body origin in the body frame, ``float32[2]`` in m/s^2, contact forces included."""
        return _in_body_frame(self._substep(*_numbers(state), *clip_action(action))[6:], state)

    def step_and_acceleration(self, state: PointState, action: jax.Array) -> tuple[PointState, jax.Array]:
        """The robot one environment step later, and its acceleration then, still under the same ``action``.

        A substep begins with the forward pass that gives the acceleration, so this is one substep more, whose motion is
        dropped: the program holds MuJoCo once instead of twice and compiles in little more than half the time.
        """
        action = clip_action(action)

        def substep(carry: tuple[Numbers, Numbers, Numbers], _: None) -> tuple[tuple, None]:
            motion = carry[1]
            after = self._substep(*motion, *action)
            return (motion, after[:6], after[6:]), None

        start = _numbers(state)
        zero = jnp.zeros_like(start[0])
        (motion, _, acceleration), _ = jax.lax.scan(substep, (start, start, (zero,) * 3), None, SUBSTEPS + 1)
        before_last = _state(motion)
        return before_last, _in_body_frame(acceleration, before_last)

    def _substep(self, *numbers: jax.Array) -> Numbers:
        """`mujoco_substep` as arithmetic on single numbers, which takes a fraction of its passes through memory."""
        if self._walls not in _SUBSTEPS:
            _SUBSTEPS[self._walls] = self._written_out()
        return _SUBSTEPS[self._walls](*numbers)

    def _written_out(self) -> Callable[..., Numbers]:
        """The substep in straight-line form, or as MJX has it where it does something that there is no rule for."""
        try:
            return straight_line(self.mujoco_substep, *[jax.ShapeDtypeStruct((), jnp.float32)] * 8)
        except NotImplementedError as why:
            warnings.warn(
                f"MJX's substep is not written out with JAX {jax.__version__} and MuJoCo {mujoco.__version__} ({why}): "
                "its results are the same, but it takes several times as long. Please report it",
                stacklevel=2,
            )
            return self.mujoco_substep

    def mujoco_substep(self, *numbers: jax.Array) -> Numbers:
        """Position, velocity and command -> position and velocity 2 ms later, and the acceleration before: 8 -> 9.

        MJX finds the forces, contacts included. Its semi-implicit Euler step is done here, as in the closed form: MJX
        factors the 3 x 3 matrix again for it, in a sixth of the small operations for which a GPU waits in a substep.
        """
        qpos, qvel, ctrl = jnp.stack(numbers[:3]), jnp.stack(numbers[3:6]), jnp.stack(numbers[6:])
        data = mjx.forward(self._model, self._blank.replace(qpos=qpos, qvel=qvel, ctrl=ctrl))
        fx, fy, torque = (data.qfrc_smooth + data.qfrc_constraint).astype(jnp.float32)
        cos, sin = jnp.cos(qpos[2]), jnp.sin(qpos[2])
        along, aside, turn = solve((cos * fx + sin * fy, cos * fy - sin * fx, torque), TIMESTEP)
        qvel = qvel + TIMESTEP * jnp.stack([cos * along - sin * aside, sin * along + cos * aside, turn])
        return *(qpos + TIMESTEP * qvel), *qvel, *data.qacc.astype(jnp.float32)


def _numbers(state: PointState) -> Numbers:
    return (*state.qpos, *state.qvel)


def _state(motion: Numbers) -> PointState:
    return PointState(qpos=jnp.stack(motion[:3]), qvel=jnp.stack(motion[3:]))


def _in_body_frame(acceleration: Numbers, state: PointState) -> jax.Array:
    """An acceleration of ``qpos``, along the world's axes, along those of the robot: ``float32[2]``."""
    ax, ay, _ = acceleration
    cos, sin = jnp.cos(state.qpos[2]), jnp.sin(state.qpos[2])
    return jnp.stack([cos * ax + sin * ay, cos * ay - sin * ax])
