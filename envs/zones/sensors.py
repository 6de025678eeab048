"""What the Point robot senses: four body sensors, a lidar per colour, the discs it stands in, the edge of the arena."""

import jax
import jax.numpy as jnp

from envs.zones.layouts import ZONE_RADIUS
from envs.zones.point_robot import EDGE, GRAVITY, PointState

LIDAR_BINS = 16
"""Directions of one lidar; bin 0 begins straight ahead, bins follow counter-clockwise."""

BODY_SENSORS = ("accelerometer", "gyro", "magnetometer", "velocimeter")
"""The parts of `body_sensors`, three numbers each."""

EDGE_SENSORS = 4
"""Numbers of `edge_sensor`."""

MAGNETIC_FIELD = 0.5
"""Strength of the world's magnetic field, which points along -y."""


def body_sensors(state: PointState, acceleration: jax.Array) -> jax.Array:
    """Accelerometer, gyro, magnetometer and velocimeter, three body axes each: ``float32[12]``.

    Args:
        state: motion of the robot.
        acceleration: ``float32[2]``, that of the body origin in the body frame, in m/s^2.
    """
    cos, sin = jnp.cos(state.qpos[2]), jnp.sin(state.qpos[2])
    vx, vy, turn = state.qvel
    zero = jnp.zeros_like(turn)
    return jnp.stack(
        [
            *(acceleration[0], acceleration[1], jnp.full_like(turn, GRAVITY)),
            *(zero, zero, turn),
            *(-MAGNETIC_FIELD * sin, -MAGNETIC_FIELD * cos, zero),
            *(cos * vx + sin * vy, cos * vy - sin * vx, zero),
        ]
    )


def lidar(
    qpos: jax.Array,
    zones: jax.Array,
    groups: tuple[tuple[int, ...], ...],
    gain: float = 1.0,
    reach: float = 0.0,
) -> jax.Array:
    """Lidar of each colour: ``float32[len(groups) * 16]``.

    A disc at distance d whose centre lies in bin b shows exp(-gain d) there; with a limited reach max(0, 1 - d / reach)
    instead. Its neighbours show the share of it by which the direction has moved towards them across the bin, so that
    readings are continuous in the direction. That is a trapezoid around the bin's centre: 1 up to half a bin away, 0
    from one and a half bins on. A bin shows the largest reading among the discs of its colour.

    Args:
        qpos: ``float32[3]`` position and heading.
        zones: ``float32[n, 2]`` disc centres.
        groups: indices of the discs of each colour, in the order of the blocks.
        gain: of the exponential, per metre.
        reach: metres at which a disc is out of sight; 0 for the exponential, which has no such distance.
    """
    cos, sin = jnp.cos(qpos[2]), jnp.sin(qpos[2])
    offset = zones - qpos[:2]
    ahead = cos * offset[:, 0] + sin * offset[:, 1]
    left = cos * offset[:, 1] - sin * offset[:, 0]
    distance = jnp.sqrt(ahead * ahead + left * left)
    strength = jnp.maximum(1.0 - distance / reach, 0.0) if reach else jnp.exp(-gain * distance)
    direction = jnp.arctan2(left, ahead) * (LIDAR_BINS / (2.0 * jnp.pi))  # in bins
    centres = jnp.arange(LIDAR_BINS, dtype=jnp.float32) + 0.5
    apart = direction[:, None] - centres
    apart = jnp.abs(apart - LIDAR_BINS * jnp.round(apart * (1.0 / LIDAR_BINS)))
    readings = strength[:, None] * jnp.clip(1.5 - apart, 0.0, 1.0)
    # Static slices instead of a gather or a segment-max: XLA fuses them into one elementwise kernel.
    return jnp.concatenate([_maximum([readings[i] for i in group]) for group in groups])


def inside(
    qpos: jax.Array, zones: jax.Array, groups: tuple[tuple[int, ...], ...], radius: float = ZONE_RADIUS
) -> jax.Array:
    """Whether the body origin is within `radius`, inclusive, of a disc's centre, per group: ``bool[len(groups)]``."""
    offset = zones - qpos[:2]
    within = jnp.sum(offset * offset, axis=-1) <= radius * radius
    return jnp.stack([_maximum([within[i] for i in group]) for group in groups])


def edge_sensor(position: jax.Array) -> jax.Array:
    """How near each side of the open arena is, exp(-distance), in the world's order +x, -y, -x, +y: ``float32[4]``.

    Args:
        position: ``float32[2]`` in metres.
    """
    x, y = position
    return jnp.exp(-jnp.abs(jnp.stack([x - EDGE, y + EDGE, x + EDGE, y - EDGE])))


def _maximum(arrays: list[jax.Array]) -> jax.Array:
    """Elementwise maximum of at least one array; of booleans, their disjunction."""
    largest = arrays[0]
    for array in arrays[1:]:
        largest = jnp.maximum(largest, array)
    return largest
