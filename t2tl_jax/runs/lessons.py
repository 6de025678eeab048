"""Which stage of a curriculum every pool of a training is drawn from: by the success in the tasks of earlier pools.

A pool lasts for a period. When a period is over, what ended in it decides about the pool after the next one; so the
next pool can be made while the device trains, and no iteration waits. Success in a task is that of all seeds together:
they share one table, and so one stage.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from t2tl_jax.ltl.curriculum import Curriculum
from t2tl_jax.training.types import TaskTotals


@dataclass(frozen=True)
class Lesson:
    """What a pool is drawn from."""

    stage: int = 0
    """Number of the stage."""
    success: tuple[tuple[str, float], ...] = ()
    """The last success rate in each task of the stage, where the stage remembers them."""


class Lessons:
    """The lessons of a training that are decided, and the counts that decide about the next one."""

    def __init__(self, curriculum: Curriculum, period: int, size: int, state: Mapping[str, Any] | None = None) -> None:
        """Begin, or go on from a `state`.

        Args:
            curriculum: the stages and the rule.
            period: iterations that a pool lasts.
            size: tasks of a pool.
            state: what `state` returned.
        """
        self._curriculum, self._period = curriculum, period
        self._lessons = {0: Lesson(), 1: Lesson()}
        self._counts = np.zeros((2, 2, size), np.int64)  # episodes and successes; this pool's and the one's before
        self.success: float | None = None
        """Mean success over the distinct tasks that ended in the last period; None before any has."""
        if state is not None:
            self._lessons = {int(number): _lesson(stored) for number, stored in state["lessons"].items()}
            self._counts = np.array(state["counts"], np.int64).reshape(2, 2, size)
            self.success = state["success"]

    def of(self, number: int) -> Lesson:
        """The lesson of a pool that is decided: the present one, the one before, or the next one."""
        return self._lessons[number]

    def knows(self, number: int) -> bool:
        """Whether the lesson of a pool is decided."""
        return number in self._lessons

    def add(self, iteration: int, totals: TaskTotals, names: Sequence[Sequence[str]]) -> None:
        """Take in an iteration, in their order; the last one of a period decides.

        Args:
            iteration: counted from 1.
            totals: int[seeds, 2, size] each, see there.
            names: of the tasks of the present pool, and of those of the pool before, if there was one.
        """
        self._counts += np.stack([np.asarray(totals.episodes), np.asarray(totals.successes)]).sum(axis=1)
        if iteration % self._period == 0:
            self._decide(iteration // self._period - 1, names)

    def columns(self, number: int, seeds: int) -> dict[str, np.ndarray]:
        """What the metrics say of an iteration of a pool: its stage, and the success so far; float[seeds] each."""
        success = np.nan if self.success is None else self.success
        return {"stage": np.full(seeds, float(self.of(number).stage)), "task_success": np.full(seeds, success)}

    def state(self) -> dict[str, Any]:
        """All that has to be known to go on, for JSON."""
        return {
            "lessons": {str(n): {"stage": of.stage, "success": dict(of.success)} for n, of in self._lessons.items()},
            "counts": self._counts.reshape(-1).tolist(),
            "success": self.success,
        }

    def _decide(self, present: int, names: Sequence[Sequence[str]]) -> None:
        """Period number `present` is over."""
        lesson = self._lessons[present + 1]
        ended: dict[str, np.ndarray] = {}
        drawn: set[str] = set()
        for age, tasks in enumerate(names):
            if self._lessons[present - age].stage == lesson.stage:
                drawn |= set(tasks)
                for place, name in enumerate(tasks):
                    ended[name] = ended.get(name, 0) + self._counts[:, age, place]
        success = {name: float(won / count) for name, (count, won) in ended.items() if count}
        self.success = sum(success.values()) / len(success) if success else self.success
        stage = self._curriculum.stages[lesson.stage]
        known = dict(lesson.success) | success if stage.remembers else success
        after = self._curriculum.next_stage(lesson.stage, known, sorted(drawn | known.keys()))
        kept = tuple(sorted(known.items())) if stage.remembers and after == lesson.stage else ()
        self._lessons = {
            number: of for number, of in self._lessons.items() if number >= present
        } | {present + 2: Lesson(after, kept)}  # fmt: skip
        self._counts[:] = 0


def _lesson(stored: Mapping[str, Any]) -> Lesson:
    return Lesson(stored["stage"], tuple(sorted(stored["success"].items())))
