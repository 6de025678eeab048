"""What distinguishes one ZoneEnv from another."""

from dataclasses import dataclass
from typing import Literal

from envs.zones import layouts
from t2tl_jax.env import EnvConfig

EPISODE_LENGTH = 1000
"""Published limit of an episode, in environment steps. Applied outside: the environment itself never ends."""


@dataclass(frozen=True)
class ZoneConfig(EnvConfig):
    """Physics and maps."""

    physics: Literal["mjx", "closed_form"] = "mjx"
    """MuJoCo MJX, the reference, or the same motion in closed form, which differs only in contact with a wall."""
    layout: Literal["fixed", "random"] = "fixed"
    """The published map ``Zones-25-v1``, or random maps: every episode has one of the pool of its seed. The pools of
    different seeds are different, and evaluation has pools of its own."""
    colours: str = ""
    """One letter per disc of random maps (J W B G R Y C M); empty means ``JJRRWWYY``. The fixed map has its own."""
    pool_size: int = 1024
    """How many random maps a pool holds."""
    pool_seed: int = 0
    """With another number all pools are other ones, whatever the seed of a run."""

    def __post_init__(self) -> None:
        if self.physics not in ("mjx", "closed_form"):
            raise ValueError(f"physics is {self.physics!r}; it must be 'mjx' or 'closed_form'")
        if self.layout not in ("fixed", "random"):
            raise ValueError(f"layout is {self.layout!r}; it must be 'fixed' or 'random'")
        if self.layout == "fixed" and self.colours not in ("", layouts.FIXED_COLOURS):
            raise ValueError(
                f"colours={self.colours!r} needs layout='random': the fixed map has {layouts.FIXED_COLOURS}"
            )
        if self.pool_size < 1:
            raise ValueError(f"pool_size is {self.pool_size}; a pool needs at least one map")
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
