"""What distinguishes one ZoneEnv from another."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from envs.zones import layouts
from t2tl_jax import checks
from t2tl_jax.env import EnvConfig
from t2tl_jax.errors import unknown

EPISODE_LENGTH = 1000
"""Published limit of an episode, in environment steps. Applied outside: the environment itself knows no time."""


@dataclass(frozen=True)
class ZoneConfig(EnvConfig):
    """Physics, arena, senses and maps. The defaults are T2TL's and LTL2Action's; DeepLTL's are `OPEN`."""

    physics: Literal["mjx", "closed_form"] = "mjx"
    """MuJoCo MJX, the reference, or the same motion in closed form, which differs only in contact with a wall."""
    layout: Literal["fixed", "random"] = "fixed"
    """The published map ``Zones-25-v1``, or random maps: every episode has one of the pool of its seed. The pools of
    different seeds are different, and evaluation has pools of its own."""
    arena: Literal["walled", "open"] = "walled"
    """Walled: four walls stop the robot at 2.4 m, and it does not sense them. Open: nothing stops it; who goes 3.3 m
    along x or y ends the episode with reward -1, four numbers more tell how near that is (all zero in the first
    observation, as published), and the observation is in the order of its parts' names."""
    radius: float = layouts.ZONE_RADIUS
    """Radius of the discs in metres."""
    keepout: float = layouts.ZONE_KEEPOUT
    """Metres that a disc of a random map keeps from the edge of the square in which discs lie, and adds to its distance
    from others; no less than the radius."""
    lidar_gain: float = 1.0
    """A disc d metres away reads exp(-lidar_gain d)."""
    lidar_range: float = 0.0
    """If positive, a disc reads 1 - d / lidar_range instead, and nothing from there on (published: 1.2); 0 means
    without limit."""
    colours: str = ""
    """One letter per disc of random maps (J W B G R Y C M O P L T); empty means ``JJRRWWYY``. The fixed map has its
    own."""
    pool_size: int = 1024
    """How many random maps a pool holds."""
    pool_seed: int = 0
    """With another number all pools are other ones, whatever the seed of a run."""

    def __post_init__(self) -> None:
        if self.physics not in ("mjx", "closed_form"):
            raise ValueError(f"physics is {self.physics!r}; it must be 'mjx' or 'closed_form'")
        if self.layout not in ("fixed", "random"):
            raise ValueError(f"layout is {self.layout!r}; it must be 'fixed' or 'random'")
        if self.arena not in ("walled", "open"):
            raise ValueError(f"arena is {self.arena!r}; it must be 'walled' or 'open'")
        for name in ("radius", "keepout", "lidar_gain"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive and finite")
        if not 0 <= self.lidar_range < np.inf:
            raise ValueError(f"lidar_range is {self.lidar_range}; it must be positive and finite, or 0 for no limit")
        if self.layout == "fixed":
            layouts.check_disjoint(np.array(layouts.FIXED_ZONES), self.radius)
        elif not self.radius <= self.keepout < layouts.ARENA:
            raise ValueError(
                f"keepout is {self.keepout:g}; it must be no less than the radius, {self.radius:g}, or discs could "
                f"overlap, and less than {layouts.ARENA:g}"
            )
        if self.layout == "fixed" and self.colours not in ("", layouts.FIXED_COLOURS):
            raise ValueError(
                f"colours={self.colours!r} needs layout='random': the fixed map has {layouts.FIXED_COLOURS}"
            )
        if self.pool_size < 1:
            raise ValueError(f"pool_size is {self.pool_size}; a pool needs at least one map")
        if self.layout == "random":
            checks.pool("pool_size", self.pool_size, 8 * (1 + len(self.colour_of_each_disc)))
        if self.pool_seed < 0:
            raise ValueError(f"pool_seed is {self.pool_seed}; it must not be negative")
        unknown = sorted(set(self.colours) - set(layouts.COLOURS))
        if unknown:
            raise ValueError(f"unknown colours {', '.join(unknown)}; known are {', '.join(layouts.COLOURS)}")

    @property
    def colour_of_each_disc(self) -> str:
        """The letters of the discs, in the order of the map."""
        if self.layout == "fixed":
            return layouts.FIXED_COLOURS
        return self.colours or layouts.RANDOM_COLOURS

    def with_colours(self, names: Collection[str]) -> "ZoneConfig":
        """The same with more discs: of each of these colours as many as of the colour that has fewest so far.

        Colours that are there already stay as they are. The arena and the size of the discs do not change, so that they
        lie closer; whether there is room for all of them, `ZoneEnv` finds out.

        Args:
            names: propositions, such as ``("Red", "White")``; their order makes no difference.

        Raises:
            ValueError: for a name that is no colour of a disc, or for other colours than its own on the fixed map.
        """
        for name in names:
            if name not in layouts.COLOURS.values():
                raise unknown("colour", name, layouts.COLOURS.values())
        discs = self.colour_of_each_disc
        more = [letter for letter, name in layouts.COLOURS.items() if name in names and letter not in discs]
        if not more:
            return self
        if self.layout == "fixed":
            raise ValueError(
                f"the fixed map has no discs of other colours than its own, got {', '.join(names)}; use layout='random'"
            )
        each = min(Counter(discs).values())
        return replace(self, colours=discs + "".join(letter * each for letter in more))


OPEN = ZoneConfig(layout="random", arena="open", radius=0.4, lidar_gain=0.5, colours="GGYYBBMM")
"""DeepLTL's world, ``PointLtl2-v0``: four colours."""

OPEN_6 = replace(OPEN, colours="GGYYBBMMCCRR")
"""The same with six colours: level 3 of GenZ-LTL."""

OPEN_8 = replace(OPEN, colours="GGYYBBMMCCRROOPP", keepout=0.45)
"""Eight colours: level 4."""

OPEN_10 = replace(OPEN, colours="GGYYBBMMCCRROOPPLLTT", keepout=0.4, radius=0.35)
"""Ten colours: level 5, whose discs are smaller (read in SpecRLBench, by the same authors)."""
