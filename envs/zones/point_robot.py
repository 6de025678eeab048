"""The Point robot of Safety-Gym: its constants, its state, and what a physics for it must offer.

The robot is one rigid body in the plane: a sphere, and a cube ahead of it that shows the heading. It slides without
lateral friction, against linear damping, driven by a force along its heading and a velocity servo on its heading.

Two properties of the robot look like mistakes here but are those of the published model. The motor saturates at an
action of 0.05. And the servo is unstable at this time step (``GEAR**2 * TIMESTEP / INERTIA`` = 6.3 > 2): only its
torque limit bounds it, and the turning rate chatters by about 0.5 rad/s from one substep to the next.
"""

import math
from typing import Protocol

import jax
import jax.numpy as jnp
from flax import struct

TIMESTEP = 0.002
"""Seconds of one physics substep."""

SUBSTEPS = 10
"""Physics substeps of one environment step; the action is held meanwhile."""

SPHERE_RADIUS = 0.1
"""Metres; the sphere sits at the body origin."""

ARROW_OFFSET = 0.1
"""Metres from the body origin to the centre of the cube, along the heading."""

ARROW_HALF_SIZE = 0.05
"""Half the edge of the cube, in metres."""

SPHERE_MASS = 4.0 / 3.0 * math.pi * SPHERE_RADIUS**3
"""Kilograms, at the model's density of 1 kg/m^3."""

ARROW_MASS = (2.0 * ARROW_HALF_SIZE) ** 3
"""Kilograms, at the same density."""

MASS = SPHERE_MASS + ARROW_MASS
"""Kilograms; 0.00518879."""

COM_OFFSET = ARROW_MASS * ARROW_OFFSET / MASS
"""Metres from the body origin to the centre of mass, along the heading; 0.0192723."""

INERTIA = (
    0.4 * SPHERE_MASS * SPHERE_RADIUS**2
    + ARROW_MASS * (2.0 * ARROW_HALF_SIZE) ** 2 / 6.0
    + ARROW_MASS * ARROW_OFFSET**2
)
"""Moment of inertia about the vertical through the body origin, in kg m^2; 2.842183e-5."""

SLIDE_DAMPING = 0.01
"""Newtons per metre per second, in every direction of the plane."""

HINGE_DAMPING = 0.005
"""Newton metres per radian per second."""

GEAR = 0.3
"""Gear of both actuators."""

FORCE_LIMIT = 0.05
"""Both actuators saturate at this force, before the gear."""

GRAVITY = 9.81
"""Metres per second squared; reaches only the accelerometer's third axis."""

FRICTION = 1.0
"""Coefficient of sliding friction between the robot and a wall."""

WALL = 2.4
"""The inner faces of the four walls, in metres from the centre."""

EDGE = 3.3
"""Where the open arena ends, in metres from the centre along x and y."""


@struct.dataclass
class PointState:
    """Motion of the robot in the world frame."""

    qpos: jax.Array
    """``float32[3]``: position of the body origin in metres and heading in radians (not wrapped)."""
    qvel: jax.Array
    """``float32[3]``: rates of change of ``qpos`` in m/s and rad/s."""


def clip_action(action: jax.Array) -> jax.Array:
    """The action as ``float32[2]`` clipped to the actuators' range of [-1, 1]."""
    return jnp.clip(jnp.asarray(action, jnp.float32), -1.0, 1.0)


class PointPhysics(Protocol):
    """A way to move the robot."""

    def step(self, state: PointState, action: jax.Array, substeps: int = SUBSTEPS) -> PointState:
        """The robot after ``substeps`` substeps of 2 ms under a held ``action`` of ``float[2]``."""

    def acceleration(self, state: PointState, action: jax.Array) -> jax.Array:
        """Acceleration of the body origin in the body frame, without gravity: ``float32[2]`` in m/s^2."""

    def step_and_acceleration(self, state: PointState, action: jax.Array) -> tuple[PointState, jax.Array]:
        """The robot one environment step later, and its acceleration then, still under the same ``action``."""
