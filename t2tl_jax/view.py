"""How an environment looks from above: coloured discs between four walls, and an agent."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from flax import struct


@struct.dataclass
class Scene:
    """What there is to see of one state, in the environment's unit of length; episodes have a leading axis."""

    discs: jax.Array | np.ndarray
    """``float32[n, 2]``: centres."""
    radii: jax.Array | np.ndarray
    """``float32[n]``: radius of each disc."""
    agent: jax.Array | np.ndarray
    """``float32[2]``: centre of the agent."""
    heading: jax.Array | np.ndarray
    """``float32[2]``: where the agent looks or moves, at most of length 1; drawn as its nose."""


@dataclass(frozen=True)
class View:
    """What an animation has to know about an environment."""

    scene: Callable[[Any, Any], Scene]
    """From a pipeline state of the environment and its parameters to what is drawn; pure."""
    low: tuple[float, float]
    """Inner corner of the walls at the bottom left."""
    high: tuple[float, float]
    """Inner corner of the walls at the top right."""
    colours: tuple[str, ...]
    """Name of each disc's colour."""
    agent_radius: float
    """How large the agent is."""
    agent_colour: tuple[int, int, int]
    """How the agent is filled: red, green, blue from 0 to 255."""
    seconds_per_step: float
    """Time between two states; 0 where a step takes no time."""
    texts: tuple[str, ...] = ()
    """What stands in each disc; empty for nothing."""
    joined: bool = False
    """Whether opposite walls are one, so that the agent can leave at one and enter at the other."""
    frame_ms: int = 60
    """How long a state is shown, in milliseconds."""
