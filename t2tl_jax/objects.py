"""What an environment says about its observation: which numbers of it describe which object."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Objects:
    """Objects of one kind that stand one behind the other in an observation.

    What comes before the first and behind the last of them is the agent's own.

    Raises:
        ValueError: for numbers that cannot be.
    """

    first: int
    """Where the numbers of the first object begin."""
    size: int
    """Numbers of one object."""
    proposition: tuple[int, ...]
    """By object: the number of the proposition that it stands for."""
    place: int = 0
    """So many of an object's first numbers are where it is, seen from the agent; 0 if none of them says so."""

    def __post_init__(self) -> None:
        if self.first < 0 or self.size < 1 or not 0 <= self.place <= self.size or not self.proposition:
            raise ValueError(
                "objects are one or more, each of some numbers of the observation of which the first may say where it "
                f"is, got first={self.first}, size={self.size}, place={self.place} and {len(self.proposition)} objects"
            )
        if min(self.proposition) < 0:
            raise ValueError(f"propositions are counted from 0, got {min(self.proposition)}")

    @property
    def count(self) -> int:
        """How many objects there are."""
        return len(self.proposition)

    @property
    def end(self) -> int:
        """Where the numbers of the last object end."""
        return self.first + self.size * self.count
