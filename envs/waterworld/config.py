"""What distinguishes one WaterWorld from another, and what the two published ones are."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from envs.waterworld.params import ARENA, RADIUS, SPEED, TIME_STEP, VELOCITY_LIMIT
from t2tl_jax import checks
from t2tl_jax.env import EnvConfig

EPISODE_LENGTH = 600
"""Published limit of an episode, in environment steps. Applied outside: the environment itself never ends."""

COLOURS = ("Yellow", "Purple", "Magenta", "Orange", "Gray", "Pink", "Green", "Blue")
"""Colours of T2TL's world, in the order of balls and propositions."""

LETTERS = ("a", "b", "c", "d", "e", "f")
"""Colours of the original world under their names there: red, green, blue, yellow, cyan, magenta."""


@dataclass(frozen=True)
class WaterWorldConfig(EnvConfig):
    """What distinguishes one WaterWorld from another. The unit of length is a 400th of the original arena."""

    colours: tuple[str, ...] = COLOURS
    """Names of the colours, which are the propositions; the balls of a colour follow each other in this order."""
    balls_per_colour: int = 2
    """How many balls each colour has."""
    layout: Literal["fixed", "by_seed", "random"] = "fixed"
    """Every episode starts on the numbered map, on the map whose number is the seed of the run, or on one drawn from a
    pool. By seed, the seeds 1,2,3,4 of one run train on the maps 1 to 4 side by side. The pools of different seeds are
    different, and evaluation has pools of its own."""
    map_number: int = 1
    """Which map, if fixed: what the original draws from this seed. Its experiments use 1 to 10 (with six colours)."""
    pool_size: int = 1024
    """Maps of a random pool; with 0 every episode has a map of its own, drawn on the device, which costs more. By seed,
    the maps that there are: 0 to pool_size - 1."""
    events: Literal["onset", "level"] = "onset"
    """A colour is true in the step in which contact with a ball of it begins, or as long as it lasts."""
    delay: Literal[0, 1] = 0
    """Steps by which labels come late: 0, or 1 as in the original."""
    radii: tuple[float, ...] = ()
    """Radius of each colour's balls; empty means 15 for all."""
    map_radii: tuple[float, ...] = ()
    """Maps are drawn as if each colour's balls had at least this radius; empty means their own. Worlds that differ in
    `radii` alone have the same maps if all of them draw for the largest ones."""
    agent_radius: float = RADIUS
    """Radius of the agent."""
    arena: tuple[float, float] = (ARENA, ARENA)
    """Width and height."""
    ball_speed: float = SPEED
    """Speed of the balls, in units per second."""
    increment: float = SPEED
    """What an action adds to the velocity on its axis, in units per second."""
    velocity_limit: float = VELOCITY_LIMIT
    """Largest velocity of the agent on each axis, in units per second."""
    time_step: float = TIME_STEP
    """Seconds that one step takes."""

    def __post_init__(self) -> None:
        if self.layout not in ("fixed", "by_seed", "random"):
            raise ValueError(f"layout is {self.layout!r}; it must be 'fixed', 'by_seed' or 'random'")
        if self.layout == "by_seed" and not self.pool_size:
            raise ValueError("layout='by_seed' takes its maps from the pool; pool_size must be larger than every seed")
        if self.events not in ("onset", "level"):
            raise ValueError(f"events is {self.events!r}; it must be 'onset' or 'level'")
        if self.delay not in (0, 1):
            raise ValueError(f"delay is {self.delay!r}; it must be 0 or 1")
        if not self.colours or len(set(self.colours)) < len(self.colours):
            raise ValueError(f"colours are {self.colours}; they must be one or more different names")
        if self.balls_per_colour < 1:
            raise ValueError(f"balls_per_colour is {self.balls_per_colour}; every colour needs at least one ball")
        if self.map_number < 0:
            raise ValueError(f"map_number is {self.map_number}; maps are numbered from 0")
        if self.pool_size < 0:
            raise ValueError(f"pool_size is {self.pool_size}; it must be 0 (no pool) or more")
        balls = self.balls_per_colour * len(self.colours)
        checks.pool("pool_size", self.pool_size if self.layout == "random" else 1, 8 * (1 + 2 * balls))
        if len(self.radius_of_each_colour) != len(self.colours):
            raise ValueError(f"radii has {len(self.radii)} entries for {len(self.colours)} colours")
        if self.map_radii and len(self.map_radii) != len(self.colours):
            raise ValueError(f"map_radii has {len(self.map_radii)} entries for {len(self.colours)} colours")
        lengths = (*self.radius_of_each_colour, *self.map_radii, self.agent_radius, *self.arena, self.time_step)
        if min(lengths) <= 0 or not np.isfinite(lengths).all():
            raise ValueError("radii, map_radii, arena and time_step must be positive and finite")
        speeds = (self.ball_speed, self.increment, self.velocity_limit)
        if min(speeds) < 0 or self.ball_speed + self.velocity_limit <= 0 or not np.isfinite(speeds).all():
            raise ValueError("ball_speed, increment and velocity_limit must not be negative, and finite")
        if self.velocity_limit == 0:
            raise ValueError("velocity_limit is 0; the observation is scaled by it, so it must be positive")
        if 2 * max(*self.map_radius_of_each_colour, self.agent_radius) >= min(self.arena):
            raise ValueError(f"the largest body does not fit into an arena of {self.arena[0]:g} x {self.arena[1]:g}")

    @property
    def radius_of_each_colour(self) -> tuple[float, ...]:
        """Radius of each colour's balls, in units of length."""
        return self.radii or (RADIUS,) * len(self.colours)

    @property
    def map_radius_of_each_colour(self) -> tuple[float, ...]:
        """Radius with which each colour's balls are placed, in units of length: never less than their own."""
        own = self.radius_of_each_colour
        return tuple(map(max, own, self.map_radii or own))
