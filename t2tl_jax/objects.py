"""What an environment says about its observation: which numbers of it describe which object."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Objects:
    """The objects of one kind in an observation; the other numbers are the agent's own.

    Raises:
        ValueError: for numbers that cannot be.
    """

    numbers: tuple[tuple[int, ...], ...]
    """By object: which numbers of the observation are its own, of every object as many and in the same order."""
    proposition: tuple[int, ...]
    """By object: the number of the proposition that it stands for."""
    place: int = 0
    """So many of an object's first numbers are where it is, seen from the agent; 0 if none of them says so."""

    def __post_init__(self) -> None:
        sizes, every = {len(own) for own in self.numbers}, [number for own in self.numbers for number in own]
        if not self.numbers or len(self.numbers) != len(self.proposition):
            raise ValueError(
                "objects are one or more, and each stands for a proposition, got "
                f"{len(self.numbers)} objects and {len(self.proposition)} propositions"
            )
        if len(sizes) > 1 or not every or not 0 <= self.place <= min(sizes):
            raise ValueError(
                "objects have one or more numbers, all as many, of which the first may say where they are, got sizes "
                f"{', '.join(map(str, sorted(sizes)))} and place={self.place}"
            )
        if len(set(every)) < len(every) or min(every) < 0 or min(self.proposition) < 0:
            raise ValueError(
                "every number of an observation belongs to one object at most; these and propositions are counted from "
                f"0, got numbers={self.numbers} and proposition={self.proposition}"
            )

    @classmethod
    def blocks(cls, starts: Sequence[int], size: int, proposition: Sequence[int], place: int = 0) -> "Objects":
        """Objects whose numbers stand side by side: `size` of them from each of the `starts` on."""
        return cls(tuple(tuple(range(start, start + size)) for start in starts), tuple(proposition), place)
