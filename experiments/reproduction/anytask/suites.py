"""The tasks that agents are tested on which were trained on others: lists of them, and the world each list is for."""

from dataclasses import dataclass
from typing import Literal

from envs.zones import OPEN_6, OPEN_8, OPEN_10
from experiments.reproduction.anytask import water_chains
from t2tl_jax.env import EnvConfig

EPISODES = 500
"""Of every seed, policy and task; where each task has a map of its own, `ON_OWN_MAP` for each."""

ON_OWN_MAP = 10


@dataclass(frozen=True)
class Suite:
    """Some tasks, and how they are played."""

    name: str
    """What the stored results call it."""
    tasks: tuple[str, ...]
    """Names and formulas; of a list with maps, the name of the list."""
    manner: Literal["each", "together", "maps"] = "each"
    """Each by itself; all of them in turns, with one report for all; or those of DeepLTL's list, each on its map."""
    env: EnvConfig | None = None
    """Another world than that of the training."""
    limit: int | None = None
    """Another time limit than that of the training, in steps."""
    exchanged: bool = False
    """Whether rows of a task show each other's texts, which an agent that reads them does not survive."""


ZONE_Z = ("z1", "z2", "z3", "z4", "z5", "z6")
ZONE_HARD = ("g1", "g2", "g3", "g4", "long", "j8", "j10", "s7", "s8")
ZONE_DEEP = ("reach_4", "reach_8", "reach_12", "avoid_3", "avoid_4", "avoid_5", "avoid_6")
ZONE_WIDE = (
    "s8",
    "F(Blue & F Green) & F(Yellow & F Magenta) & F(Green & F Blue)",
    "(!Blue U Green) & (!Yellow U Magenta) & F(Green & F Yellow)",
)
ZONE_NEW = ("z6", "long", "j10")
SIX = ("six_1", "six_2", "six_3")

ZONES = Suite("zones", tuple(dict.fromkeys((*ZONE_Z, *ZONE_HARD, *ZONE_DEEP, *ZONE_WIDE))))
ZONE_MAPS = Suite("zones with their maps", ("zones",), "maps")
MORE_COLOURS = (
    Suite("six colours", SIX, env=OPEN_6),
    Suite("eight colours", SIX, env=OPEN_8),
    Suite("ten colours", SIX, env=OPEN_10),
)
EXCHANGED = Suite("texts exchanged", ZONE_Z, exchanged=True)

READ_ALONE = Suite("read alone", ZONES.tasks)
"""For agents of the world of a single state: a step is a choice of a proposition, so that all there is to it is
reading."""

LETTERS = Suite("letters", (*(f"letters_{n}" for n in range(1, 6)), "letters_avoid_6"))
LETTERS_LONG = Suite("letters, 150 moves", ("letters_reach_12",), limit=150)
LETTER_MAPS = Suite("letters with their maps", ("letters",), "maps")
FLAT = Suite("flat", tuple(f"flat_{n}" for n in range(1, 6)))
WATER = Suite("water", ("phi_water",))
WATER_CHAINS = Suite("water chains", water_chains.CHAINS)
UNTIL = Suite("Until_1_2_1_1", ("Until_1_2_1_1",), "together")
WALLS = Suite("walls", ("phi_zone", "phi_zone_prime", "phi_safe"))
