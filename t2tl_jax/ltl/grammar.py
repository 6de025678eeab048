"""Random formulas of many shapes: wider than chains and what is made of them.

An encoder that reads text reads well what is written like the formulas it learned from. Chains are always written in
one way; here the parts of formulas are put together by a small grammar:

    task      ::= F goal | condition U goal | task & task | task | task
    goal      ::= state | state & task | task | (state | goal)
    condition ::= !state | state -> task
    state     ::= p | p | q | ...
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

from t2tl_jax.ltl.families import TaskFamily, name_family
from t2tl_jax.ltl.family_trees import MAX_SET, Range, check_ranges
from t2tl_jax.ltl.formula import Formula, eventually, prop, until
from t2tl_jax.registry import register_task_family

MAX_OPERATORS = 50
"""Most eventuallys and untils of a formula."""

GROWS = 0.35
"""How often a state that may have one more proposition has it."""


@dataclass(frozen=True)
class Grammar(TaskFamily):
    """Formulas by the grammar above; how many eventuallys and untils there are is drawn first, uniformly.

    A first step at which no proposition is true decides nothing: a robot could do nothing about that. Some formulas
    cannot become true, such as `F(a & (!a U b))` where one proposition holds at a time; pools leave out what is false
    from the start.
    """

    operators: Range = (1, 5)
    """Eventuallys and untils of a formula, together."""
    state: Range = (1, 3)
    """Propositions of a state, as far as there are so many: one of them is to hold, or none of them."""

    def __post_init__(self) -> None:
        check_ranges(self, operators=(1, MAX_OPERATORS), state=(1, MAX_SET))

    def least(self) -> int:
        """As many propositions as the smallest state has."""
        return self.state[0]

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw one task."""
        return self._task(rng, names, rng.randint(*self.operators))

    def _task(self, rng: random.Random, names: Sequence[str], count: int) -> Formula:
        """A task of `count` eventuallys and untils."""
        kind = rng.random()
        if count > 1 and kind < 0.35:
            first = rng.randint(1, count - 1)
            left, right = self._task(rng, names, first), self._task(rng, names, count - first)
            return left & right if kind < 0.25 else left | right
        inside = count - 1
        if rng.random() < 0.4:
            return eventually(self._goal(rng, names, inside))
        if inside and rng.random() < 0.25:
            first = rng.randint(1, inside)
            condition = ~self._state(rng, names) | self._task(rng, names, first)  # state -> task
            return until(condition, self._goal(rng, names, inside - first))
        return until(~self._state(rng, names), self._goal(rng, names, inside))

    def _goal(self, rng: random.Random, names: Sequence[str], count: int) -> Formula:
        """What an eventually or an until waits for, with `count` of them in it."""
        state, kind = self._state(rng, names), rng.random()
        if not count:
            return state
        if kind < 0.75:
            return state & self._task(rng, names, count)
        return state | self._goal(rng, names, count) if kind < 0.85 else self._task(rng, names, count)

    def _state(self, rng: random.Random, names: Sequence[str]) -> Formula:
        size, most = self.state[0], max(self.state[0], min(self.state[1], len(names)))
        while size < most and rng.random() < GROWS:
            size += 1
        return reduce(Formula.__or__, [prop(name) for name in sorted(rng.sample(names, size), key=names.index)])


register_task_family("grammar", Grammar)
name_family("grammar", Grammar())
