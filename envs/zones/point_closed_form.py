"""The exact motion of the Point robot in closed form.

Without contact MuJoCo's semi-implicit Euler substep is a 3x3 linear solve. In the body frame it splits into one
equation along the heading and a 2x2 system with constant matrix, so a substep is some forty multiplications. Walls stop
the robot dead.
"""

import jax
import jax.numpy as jnp

from envs.zones.point_robot import (
    ARROW_HALF_SIZE,
    ARROW_OFFSET,
    COM_OFFSET,
    FORCE_LIMIT,
    FRICTION,
    GEAR,
    HINGE_DAMPING,
    INERTIA,
    MASS,
    SLIDE_DAMPING,
    SPHERE_RADIUS,
    SUBSTEPS,
    TIMESTEP,
    WALL,
    PointState,
    clip_action,
)


def _forces(along: jax.Array, aside: jax.Array, turn: jax.Array, action: jax.Array) -> tuple[jax.Array, ...]:
    """Generalised forces in the body frame: actuators, damping and the centrifugal pull of the offset mass."""
    thrust = GEAR * jnp.clip(action[0], -FORCE_LIMIT, FORCE_LIMIT)
    torque = GEAR * jnp.clip(action[1] - GEAR * turn, -FORCE_LIMIT, FORCE_LIMIT)
    return (
        thrust - SLIDE_DAMPING * along + MASS * COM_OFFSET * turn * turn,
        -SLIDE_DAMPING * aside,
        torque - HINGE_DAMPING * turn,
    )


def solve(forces: tuple[jax.Array, ...], timestep: float) -> tuple[jax.Array, ...]:
    """Body-frame accelerations: (M + timestep D)^-1 forces. ``timestep`` 0 gives the plain forward dynamics."""
    mass = MASS + timestep * SLIDE_DAMPING
    inertia = INERTIA + timestep * HINGE_DAMPING
    coupling = MASS * COM_OFFSET
    determinant = mass * inertia - coupling * coupling
    along, aside, turn = forces
    return (
        along * (1.0 / mass),
        aside * (inertia / determinant) - turn * (coupling / determinant),
        turn * (mass / determinant) - aside * (coupling / determinant),
    )


def wall_distance(cos: jax.Array, sin: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Least and greatest coordinate of the body origin along an axis, given the heading's cosine and sine to that axis.

    The robot reaches as far as its sphere or the front corners of its cube, whichever is further: the origin stops
    0.15 m before a wall that is ahead and 0.10 m before one that is behind or beside it.
    """
    corner = ARROW_HALF_SIZE * (jnp.abs(cos) + jnp.abs(sin))
    low = jnp.maximum(SPHERE_RADIUS, corner - ARROW_OFFSET * cos) - WALL
    high = WALL - jnp.maximum(SPHERE_RADIUS, corner + ARROW_OFFSET * cos)
    return low, high


def _stop_at_wall(
    position: jax.Array, velocity: jax.Array, sideways: jax.Array, low: jax.Array, high: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Perfectly inelastic wall: the position is clamped, the velocity into the wall is lost.

    So is as much of the velocity along the wall, as far as there is any: Coulomb friction with coefficient 1.
    """
    kept = jnp.where(position > high, jnp.minimum(velocity, 0.0), velocity)
    kept = jnp.where(position < low, jnp.maximum(velocity, 0.0), kept)
    lost = FRICTION * jnp.abs(velocity - kept)
    return jnp.clip(position, low, high), kept, sideways - jnp.clip(sideways, -lost, lost)


class ClosedFormPoint:
    """Physics without MuJoCo, for speed; exact unless a wall is touched, and so always where there are none.

    After one environment step (20 ms) in which the robot touches a wall, it differs from the original scene by
    0.63 / 5.43 mm, 0.059 / 0.223 m/s, 0.36 / 1.07 rad/s (median / 95 %; results/walls.json), and the accelerometer does
    not feel the wall. The stopping distances are those of the original.

    Args:
        walls: whether there are any.
    """

    def __init__(self, walls: bool = True) -> None:
        self._walls = walls

    def step(self, state: PointState, action: jax.Array, substeps: int = SUBSTEPS) -> PointState:
        """The robot after ``substeps`` substeps of 2 ms under a held ``action`` of ``float32[2]``.

        Exact away from the walls. At a wall it stops dead instead of touching it softly, and is not turned by it.
        """
        action = clip_action(action)
        cos, sin = jnp.cos(state.qpos[2]), jnp.sin(state.qpos[2])

        def substep(carry: tuple[jax.Array, ...], _: None) -> tuple[tuple[jax.Array, ...], None]:
            x, y, heading, vx, vy, turn, cos, sin = carry
            along, aside = cos * vx + sin * vy, cos * vy - sin * vx
            d_along, d_aside, d_turn = solve(_forces(along, aside, turn, action), TIMESTEP)
            along, aside, turn = along + TIMESTEP * d_along, aside + TIMESTEP * d_aside, turn + TIMESTEP * d_turn
            vx, vy = cos * along - sin * aside, sin * along + cos * aside
            x, y, heading = x + TIMESTEP * vx, y + TIMESTEP * vy, heading + TIMESTEP * turn
            # A turn of h w is below 0.1 rad up to 50 rad/s, where these series are exact in float32; the servo's own
            # limit is 3 rad/s. Ten sines and cosines would cost more than everything else in the loop.
            angle = TIMESTEP * turn
            square = angle * angle
            d_cos, d_sin = 1.0 - square * (0.5 - square / 24.0), angle * (1.0 - square * (1.0 / 6.0 - square / 120.0))
            cos, sin = cos * d_cos - sin * d_sin, sin * d_cos + cos * d_sin
            if self._walls:
                x, vx, vy = _stop_at_wall(x, vx, vy, *wall_distance(cos, sin))
                y, vy, vx = _stop_at_wall(y, vy, vx, *wall_distance(sin, cos))
            return (x, y, heading, vx, vy, turn, cos, sin), None

        # A loop, not ten copies of its body: older XLA (jaxlib 0.9) fuses the copies into one kernel that recomputes
        # every substep for each of its uses, which takes for ever.
        carry, _ = jax.lax.scan(substep, (*state.qpos, *state.qvel, cos, sin), None, length=substeps)
        return PointState(qpos=jnp.stack(carry[:3]), qvel=jnp.stack(carry[3:6]))

    def acceleration(self, state: PointState, action: jax.Array) -> jax.Array:
        """Acceleration of the body origin in the body frame, ``float32[2]`` in m/s^2, when no wall is touched."""
        cos, sin = jnp.cos(state.qpos[2]), jnp.sin(state.qpos[2])
        vx, vy, turn = state.qvel
        forces = _forces(cos * vx + sin * vy, cos * vy - sin * vx, turn, clip_action(action))
        along, aside, _ = solve(forces, 0.0)
        return jnp.stack([along, aside])

    def step_and_acceleration(self, state: PointState, action: jax.Array) -> tuple[PointState, jax.Array]:
        """The robot one environment step later, and its acceleration then, still under the same ``action``."""
        after = self.step(state, action)
        return after, self.acceleration(after, action)
