"""What distinguishes one LetterWorld from another."""

from dataclasses import dataclass
from typing import Literal

from t2tl_jax import checks
from t2tl_jax.env import EnvConfig

EPISODE_LENGTH = 75
"""Published limit of an episode, in moves. Applied outside: the environment itself never ends."""

LETTERS = ("a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l")
"""The published letters."""


@dataclass(frozen=True)
class LetterWorldConfig(EnvConfig):
    """Grid and letters."""

    size: int = 7
    """Cells along each side."""
    letters: tuple[str, ...] = LETTERS
    """The letters, which are the propositions."""
    copies: int = 2
    """Cells of a map that hold each letter."""
    layout: Literal["random", "by_seed"] = "random"
    """Every episode has a map of the pool of its seed, as in DeepLTL; or every seed of a run has one map, on which it
    is evaluated too, as in LTL2Action. The pools of different seeds are different, and evaluation has its own."""
    pool_size: int = 1024
    """How many random maps a pool holds."""
    pool_seed: int = 0
    """With another number all maps are other ones, whatever the seed of a run."""

    def __post_init__(self) -> None:
        if self.layout not in ("random", "by_seed"):
            raise ValueError(f"layout is {self.layout!r}; it must be 'random' or 'by_seed'")
        if self.size < 3:
            raise ValueError(f"size is {self.size}; a grid needs at least 3 cells along each side")
        if not self.letters or len(set(self.letters)) < len(self.letters) or len(self.letters) > 127:
            raise ValueError(f"letters are {self.letters}; they must be 1 to 127 different names")
        if self.copies < 1:
            raise ValueError(f"copies is {self.copies}; every letter needs at least one cell")
        if self.num_taken >= self.size**2 - 1:
            raise ValueError(
                f"{len(self.letters)} letters x {self.copies} copies need {self.num_taken} cells; a grid of "
                f"{self.size} x {self.size} has {self.size**2 - 1} beside the start, and some of them must stay empty"
            )
        if self.pool_size < 1:
            raise ValueError(f"pool_size is {self.pool_size}; a pool needs at least one map")
        checks.pool("pool_size", self.pool_size if self.layout == "random" else 1, self.size**2)
        if self.pool_seed < 0:
            raise ValueError(f"pool_seed is {self.pool_seed}; it must not be negative")

    @property
    def num_taken(self) -> int:
        """Cells of a map that hold a letter."""
        return self.copies * len(self.letters)
