"""A curriculum: families of tasks one after another, and the rule by which the next one begins.

This is the rule only, on the host: success by task goes in, the stage to train on comes out. The rest is done by
`runs/lessons.py`.
"""

import math
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from t2tl_jax import checks
from t2tl_jax.ltl.errors import LTLError
from t2tl_jax.ltl.families import TaskFamily, name_family
from t2tl_jax.ltl.family_trees import Chains
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.registry import register_task_family

Over = Literal["mean", "least"]
"""Which number stands for the success in several tasks: their mean, or that of the worst."""


@dataclass(frozen=True)
class Stage:
    """A family, and how well it is to be mastered before the next one."""

    family: TaskFamily = field(default_factory=Chains)
    """What is drawn."""
    advance: float = 0.9
    """The next stage begins when success over the tasks is at least this."""
    over: Over = "mean"
    """Which success: the mean over the distinct tasks, each counted once, or that of the worst of them."""
    temperature: float = 0.0
    """Tasks are drawn in proportion to exp(-success / temperature): the smaller, the more those that fail. 0 for as
    the family draws them; others only where its tasks can be listed, of which there are `MAX_LISTED` at most."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.advance <= 1.0:
            raise LTLError(f"advance is a success rate from 0 to 1, got {self.advance}")
        if self.over not in ("mean", "least"):
            raise LTLError(f'over is "mean" or "least", got {self.over!r}')
        checks.not_negative(self, "temperature")

    @property
    def remembers(self) -> bool:
        """Whether the last success in every task counts, however long ago it was."""
        return self.temperature > 0 or self.over == "least"

    def is_mastered(self, success: Mapping[str, float], tasks: Sequence[str] = ()) -> bool:
        """Whether the rule is met by success rates by task, of the tasks that ended lately; not without any.

        Args:
            success: by task.
            tasks: all that are drawn, where they can be listed. The worst of them is one that never ended, if there is
                one; the mean is over those that ended.
        """
        if not success or (self.over == "least" and not success.keys() >= set(tasks)):
            return False
        rates = success.values()
        return (min(rates) if self.over == "least" else sum(rates) / len(success)) >= self.advance

    def weights(self, tasks: Sequence[str], success: Mapping[str, float]) -> list[float]:
        """How likely each of some tasks is to be drawn: sums to 1, all equal before any task has ended.

        A task that never ended counts as one that always fails.
        """
        if not self.temperature:
            return [1 / len(tasks) for _ in tasks]
        rates = [success.get(task, 0.0) for task in tasks]
        worst = min(
            rates, default=0.0
        )  # its weight is 1 before the division, so that they are not all too small for a float
        failing = [math.exp((worst - rate) / self.temperature) for rate in rates]
        total = sum(failing)
        return [weight / total for weight in failing]


@dataclass(frozen=True)
class Curriculum(TaskFamily):
    """Stages in their order. The last one goes on to the end of the training, and is what the family draws."""

    stages: tuple[Stage, ...] = (Stage(),)
    """The families with their rules."""

    def __post_init__(self) -> None:
        if not self.stages:
            raise LTLError("a curriculum needs at least one stage")
        if any(isinstance(stage.family, Curriculum) for stage in self.stages):
            raise LTLError("a stage of a curriculum is drawn from a family that is no curriculum itself")

    def least(self) -> int:
        """As many propositions as any stage needs."""
        return max(stage.family.least() for stage in self.stages)

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw a task of the last stage, for which the others prepare."""
        return self.stages[-1].family.draw(rng, names)

    def every(self, names: Sequence[str]) -> Iterator[Formula] | None:
        """Those of the last stage."""
        return self.stages[-1].family.every(names)

    def next_stage(self, stage: int, success: Mapping[str, float], tasks: Sequence[str] = ()) -> int:
        """The stage after `stage`, or `stage` itself while it is not mastered or is the last.

        Args:
            stage: the present one, from 0.
            success: by task, the success rate of those of its tasks that ended lately; each task counts once.
            tasks: all tasks of the stage, where they can be listed: see `Stage.is_mastered`.

        Raises:
            LTLError: for a stage that does not exist.
        """
        if not 0 <= stage < len(self.stages):
            raise LTLError(f"there is no stage {stage}: the curriculum has stages 0 to {len(self.stages) - 1}")
        last = len(self.stages) - 1
        return stage + (stage < last and self.stages[stage].is_mastered(success, tasks))


ONE, NONE = (1, 1), (0, 0)
DEEPLTL_ZONES = Curriculum(
    (
        Stage(Chains(ONE, ONE, NONE), 0.8, "least", 0.5),
        Stage(Chains((2, 2), ONE, NONE, repeat=False), 0.95, "mean", 0.5),
        Stage(Chains(ONE, ONE, ONE), 0.95, "mean", 0.5),
        Stage(Chains((2, 2), ONE, ONE, repeat=False), 0.9, "mean", 0.5),
        Stage(Chains(ONE, (1, 2), (0, 2)), 0.9),
        Stage(Chains((2, 2), (1, 2), (1, 2)), 0.9),
        Stage(Chains((3, 3), (1, 2), (0, 3)), 0.9),
    )
)
"""DeepLTL's curriculum for four colours, without its tasks of staying inside a disc, which are no co-safe formulas."""

register_task_family("curriculum", Curriculum)
name_family("deepltl_zones", DEEPLTL_ZONES)
