"""The numbers of a WaterWorld: sizes, speeds, radii and maps, as a pytree that ``jax.vmap`` can run over."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

ARENA = 400.0
"""Side of the square arena of the original, in units of length."""

RADIUS = 15.0
"""Radius of the original's balls and of its agent, in units of length."""

SPEED = 30.0
"""Speed of the original's balls, and what one action adds to the agent's velocity, in units per second."""

VELOCITY_LIMIT = 90.0
"""Limit of the original's agent on each axis, in units per second."""

TIME_STEP = 0.1
"""Seconds of one step of the original."""


class Start(NamedTuple):
    """Where the bodies are at the start. The agent is at rest."""

    agent: jax.Array | np.ndarray
    """``[..., 2]``: position of the agent in units of length."""
    balls: jax.Array | np.ndarray
    """``[..., n, 2]``: positions of the balls in units of length."""
    directions: jax.Array | np.ndarray
    """``[..., n, 2]``: unit vectors along the velocities of the balls."""


@struct.dataclass
class WaterWorldParams:
    """Everything numeric about a WaterWorld; how many colours and balls there are is static instead.

    All fields are float32. They are arguments of ``reset`` and ``step``, so a batch of environments may mix them.
    """

    arena: jax.Array | np.ndarray
    """``[2]``: width and height in units of length; the origin is a corner."""
    time_step: jax.Array | np.ndarray
    """Seconds that one step takes."""
    ball_speed: jax.Array | np.ndarray
    """Speed of every ball in units per second, constant; also enters the scale of the observation."""
    increment: jax.Array | np.ndarray
    """Units per second that an action adds to the agent's velocity on its axis."""
    velocity_limit: jax.Array | np.ndarray
    """Largest velocity of the agent on each axis (a box, not a norm), in units per second."""
    agent_radius: jax.Array | np.ndarray
    """Radius of the agent in units of length."""
    ball_radius: jax.Array | np.ndarray
    """``[C]``: radius of the balls of each colour in units of length."""
    map_radius: jax.Array | np.ndarray
    """``[C]``: the least radius with which the balls of each colour are placed on a map that a reset draws, in units of
    length; larger balls are placed with their own."""
    starts: Start | None
    """With a leading axis ``[m]``: the maps that a reset chooses from; None to draw one by the rule of `maps`."""

    def radius_of_each_ball(self, balls_per_colour: int) -> jax.Array:
        """The colours' radii repeated for the balls of each colour: ``[n]``."""
        return _repeated(self.ball_radius, balls_per_colour)

    def map_radius_of_each_ball(self, balls_per_colour: int) -> jax.Array:
        """Radii with which a reset places the balls: ``[n]``."""
        return _repeated(jnp.maximum(self.ball_radius, self.map_radius), balls_per_colour)


def _repeated(radii: jax.Array | np.ndarray, balls_per_colour: int) -> jax.Array:
    return jnp.broadcast_to(jnp.asarray(radii)[:, None], (*radii.shape, balls_per_colour)).reshape(-1)
