"""What distinguishes one FlatWorld from another, and the one published map."""

from dataclasses import dataclass

from t2tl_jax import checks
from t2tl_jax.env import EnvConfig

EPISODE_LENGTH = 500
"""Published limit of an episode, in steps. Applied outside: the environment itself knows no time."""

EDGE = 2.0
"""Half the side of the square that the agent must not leave."""

STEP = 0.08
"""How far one action moves the agent."""

REGIONS = (
    ("Red", -1.4, 0.55, 0.4),
    ("Magenta", -1.1, 1.1, 0.5),
    ("Yellow", -1.0, -1.2, 0.3),
    ("Orange", -1.53, -0.5, 0.32),
    ("Blue", 0.1, 0.0, 0.8),
    ("Red", 0.5, -1.3, 0.35),
    ("Green", 0.7, 0.7, 0.5),
    ("Green", 1.5, -0.75, 0.4),
    ("Aqua", 0.8, 0.2, 0.3),
)
"""The discs of the published map: colour, x and y of the centre, radius."""

COLOURS = tuple(sorted({colour for colour, *_ in REGIONS}))
"""The propositions, in the published order."""

LETTERS = (
    *COLOURS,
    *("Magenta & Red", "Blue & Green", "Aqua & Green", "Aqua & Blue", "Aqua & Blue & Green"),
)
"""What holds at once somewhere: of the 127 sets of colours these twelve."""


@dataclass(frozen=True)
class FlatWorldConfig(EnvConfig):
    """Where episodes start; the map is always the published one."""

    pool_size: int = 4096
    """How many starts the pool of a seed holds, uniform outside all discs; every episode has one of them. The pools of
    different seeds are different, and evaluation has pools of its own."""
    pool_seed: int = 0
    """With another number all pools are other ones, whatever the seed of a run."""

    def __post_init__(self) -> None:
        if self.pool_size < 1:
            raise ValueError(f"pool_size is {self.pool_size}; a pool needs at least one start")
        checks.pool("pool_size", self.pool_size, 8)
        if self.pool_seed < 0:
            raise ValueError(f"pool_seed is {self.pool_seed}; it must not be negative")
