"""Families of tasks as data: chains of reach and avoid sets, what is made of them, and mixtures.

Each is a frozen dataclass that a configuration holds, so a new family is a few numbers and no code:

    Chains(depth=(1, 3), reach=(1, 2), avoid=(0, 2))
    Conjunction(Chains(depth=(1, 2), reach=(1, 1), avoid=(0, 1)), count=(2, 2))
    Mixture((Chains(), Named("Eventually_1_2_1_2")), weights=(0.8, 0.2))

A pair of numbers is a range, both ends of which can be drawn.
"""

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import combinations
from typing import TypeAlias

from t2tl_jax.ltl.errors import LTLError
from t2tl_jax.ltl.families import TaskFamily, make_sampler, name_family
from t2tl_jax.ltl.formula import Formula, eventually, prop, until
from t2tl_jax.ltl.parser import parse
from t2tl_jax.ltl.tasks import resolve_task
from t2tl_jax.registry import register_task_family

Range = tuple[int, int]
"""The least and the most of something."""

MAX_DEPTH = 50
"""Most pairs of a chain."""

MAX_SET = 50
"""Most propositions of a set to reach or to avoid."""

MAX_COUNT = 50
"""Most parts of a conjunction or disjunction."""

MAX_LISTED = 10_000
"""Most tasks of a list."""

MAX_MIXED = 100
"""Most families of a mixture."""

MAX_NESTING = 8
"""Most families of which one holds the next."""

MAX_FAMILIES = 1000
"""Most families of a tree."""

MAX_PAIRS = 1000
"""Most pairs that the chains of one task may have together."""

Goals: TypeAlias = Mapping[str, Formula]
"""What can be reached and avoided, by what it is called."""

_DRAWS = 1000
"""How often a chain is drawn whose sets leave nothing to avoid, before the ranges count as impossible."""


@dataclass(frozen=True)
class Link:
    """One part of a chain: reach one of some propositions, and touch none of others before that."""

    reach: frozenset[str]
    avoid: frozenset[str]


@dataclass(frozen=True)
class Chains(TaskFamily):
    """Reach one of a set while avoiding another set, then the next pair of sets: DeepLTL's tasks, as formulas.

    `!(c | d) U (a & F b)` is the chain of ({a}, avoiding {c, d}), ({b}, avoiding nothing). A set to avoid holds nothing
    of the set to reach, nor of the one reached before, in which the robot still is. Depth, then the sizes and members
    of each pair are drawn uniformly; a set to avoid is no larger than what is left for it.
    """

    depth: Range = (1, 2)
    """Pairs of a chain."""
    reach: Range = (1, 2)
    """Propositions of which one is to be reached."""
    avoid: Range = (0, 2)
    """Propositions to be avoided meanwhile."""
    repeat: bool = True
    """Whether a set to reach may share propositions with the one before."""
    goals: tuple[str, ...] = ()
    """What sets to reach and to avoid are made of, where that is not every proposition by itself: formulas of a state
    such as 'Blue & Green', which are read as they stand. A set to avoid then has no proposition in common with what is
    reached."""

    def __post_init__(self) -> None:
        check_ranges(self, depth=(1, MAX_DEPTH), reach=(1, MAX_SET), avoid=(0, MAX_SET))
        _check_most("the goals of chains", len(self.goals), "MAX_SET", MAX_SET)
        for name, goal in self._goals(()).items():
            temporal = next((node.op for node in goal.nodes() if node.op not in ("prop", "and", "or", "not")), None)
            if temporal is not None:
                raise LTLError(f"a goal of chains is a formula of one state, such as 'Blue & Green', got {name!r}")

    def least(self) -> int:
        """As many propositions as the smallest sets of two neighbours need; goals bring their own."""
        if self.goals:
            return 1
        apart = self.depth[1] > 1 and not self.repeat
        return self.reach[0] * (2 if apart else 1) + self.avoid[0]

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw a chain; one that has not enough left to avoid is drawn again."""
        goals = self._goals(names)
        for _ in range(_DRAWS):
            chain = self._chain(rng, goals)
            if chain is not None:
                return chain_formula(chain, goals)
        raise LTLError(f"{self!r} leaves too few of {', '.join(names)} to avoid; make the sets smaller")

    def every(self, names: Sequence[str]) -> Iterator[Formula]:
        """Every chain, the shortest first."""
        goals = self._goals(names)
        for depth in range(self.depth[0], self.depth[1] + 1):
            for chain in self._chains(goals, depth):
                yield chain_formula(chain, goals)

    def _goals(self, names: Sequence[str]) -> dict[str, Formula]:
        """What can be reached and avoided, by what it is called."""
        return {goal: parse(goal) for goal in self.goals} if self.goals else {name: prop(name) for name in names}

    def _chain(self, rng: random.Random, names: Goals) -> list[Link] | None:
        chain: list[Link] = []
        for _ in range(rng.randint(*self.depth)):
            before = chain[-1].reach if chain else frozenset()
            goals = [name for name in names if self.repeat or name not in before]
            if len(goals) < self.reach[0]:
                return None
            reach = frozenset(rng.sample(goals, rng.randint(self.reach[0], min(self.reach[1], len(goals)))))
            left = _apart(names, reach | before)
            if len(left) < self.avoid[0]:
                return None
            avoid = frozenset(rng.sample(left, rng.randint(self.avoid[0], min(self.avoid[1], len(left)))))
            chain.append(Link(reach, avoid))
        return chain

    def _chains(self, names: Goals, depth: int, before: frozenset[str] = frozenset()) -> Iterator[list[Link]]:
        if depth == 0:
            yield []
            return
        for reach in _subsets([name for name in names if self.repeat or name not in before], self.reach):
            for avoid in _subsets(_apart(names, reach | before), self.avoid):
                for rest in self._chains(names, depth - 1, reach):
                    yield [Link(reach, avoid), *rest]


@dataclass(frozen=True)
class _Several(TaskFamily):
    of: TaskFamily = field(default_factory=lambda: Chains(reach=(1, 1), avoid=(0, 1)))
    """What the parts are drawn from."""
    count: Range = (2, 2)
    """Parts, each drawn by itself."""

    def __post_init__(self) -> None:
        check_ranges(self, count=(1, MAX_COUNT))
        _check_tree(self)

    def least(self) -> int:
        """As many propositions as a part needs."""
        return self.of.least()

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw the parts and join them."""
        return self._joined([self.of.draw(rng, names) for _ in range(rng.randint(*self.count))])

    def every(self, names: Sequence[str]) -> Iterator[Formula] | None:
        """Every choice of different parts, in one order; None if the parts can only be drawn."""
        return None if self.of.every(names) is None else self._every(names)

    def _every(self, names: Sequence[str]) -> Iterator[Formula]:
        for count in range(self.count[0], self.count[1] + 1):
            before: list[Formula] = []  # no longer than what was asked for, however many parts there are
            for part in self.of.every(names) or ():
                for others in combinations(before, count - 1):
                    yield self._joined((*others, part))
                if count > 1:
                    before.append(part)

    def _joined(self, parts: Sequence[Formula]) -> Formula:
        raise NotImplementedError


@dataclass(frozen=True)
class Conjunction(_Several):
    """Several tasks of a family, all of them to be carried out, in any order."""

    def _joined(self, parts: Sequence[Formula]) -> Formula:
        return reduce(Formula.__and__, parts)


@dataclass(frozen=True)
class Disjunction(_Several):
    """Several tasks of a family, one of which is to be carried out."""

    def _joined(self, parts: Sequence[Formula]) -> Formula:
        return reduce(Formula.__or__, parts)


@dataclass(frozen=True)
class Named(TaskFamily):
    """A family by its name, such as those of LTL2Action, as a part of others."""

    name: str = "Until_1_2_1_1"
    """As `make_sampler` takes it."""

    def least(self) -> int:
        """Nothing by itself: `make_sampler` says what the name needs."""
        return 0

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw one task."""
        return make_sampler(self.name, names)(rng)


@dataclass(frozen=True)
class Listed(TaskFamily):
    """Tasks that are written down, each as likely as the others."""

    tasks: tuple[str, ...] = ()
    """Formulas, or names of tasks."""

    def __post_init__(self) -> None:
        if not self.tasks:
            raise LTLError("a list of tasks needs at least one, such as 'F a'")
        _check_most("a list of tasks", len(self.tasks), "MAX_LISTED", MAX_LISTED)

    def least(self) -> int:
        """Nothing by itself: the formulas say which propositions they need."""
        return 0

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw one of them."""
        return resolve_task(rng.choice(self.tasks))

    def every(self, names: Sequence[str]) -> Iterator[Formula]:
        """All of them, in their order."""
        return map(resolve_task, self.tasks)


@dataclass(frozen=True)
class Mixture(TaskFamily):
    """A task of one of several families."""

    parts: tuple[TaskFamily, ...] = field(default_factory=lambda: (Chains(),))
    """The families."""
    weights: tuple[float, ...] = ()
    """How often each is drawn from, relative to the others; empty for equally often."""

    def __post_init__(self) -> None:
        if not self.parts:
            raise LTLError("a mixture needs at least one family")
        _check_most("the families of a mixture", len(self.parts), "MAX_MIXED", MAX_MIXED)
        if self.weights and (len(self.weights) != len(self.parts) or not all(w > 0 for w in self.weights)):
            raise LTLError(
                f"a mixture of {len(self.parts)} families needs as many weights, each above 0, got {self.weights}"
            )
        _check_tree(self)

    def least(self) -> int:
        """As many propositions as any of the families needs."""
        return max(part.least() for part in self.parts)

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw a family, then a task of it."""
        (part,) = rng.choices(self.parts, self.weights or None)
        return part.draw(rng, names)

    def every(self, names: Sequence[str]) -> Iterator[Formula] | None:
        """Those of every family; None if one of them can only be drawn from."""
        found = [part.every(names) for part in self.parts]
        known = [tasks for tasks in found if tasks is not None]
        return (task for tasks in known for task in tasks) if len(known) == len(found) else None


def chain_formula(chain: Sequence[Link], names: Goals) -> Formula:
    """Return `!avoid U (reach & ...)` of a chain that is not empty, its goals in the order of `names`."""
    task: Formula | None = None
    for link in reversed(chain):
        goal = _any(link.reach, names)
        goal = goal if task is None else goal & task
        task = until(~_any(link.avoid, names), goal) if link.avoid else eventually(goal)
    assert task is not None
    return task


def _any(chosen: frozenset[str], names: Goals) -> Formula:
    return reduce(Formula.__or__, [goal for name, goal in names.items() if name in chosen])


def _apart(names: Goals, chosen: frozenset[str]) -> list[str]:
    """The goals that have no proposition in common with the chosen ones."""
    taken = {name for goal in chosen for name in names[goal].propositions()}
    return [name for name, goal in names.items() if taken.isdisjoint(goal.propositions())]


def _subsets(names: Sequence[str], sizes: Range) -> Iterator[frozenset[str]]:
    return (frozenset(chosen) for size in range(sizes[0], sizes[1] + 1) for chosen in combinations(names, size))


def check_ranges(family: TaskFamily, **bounds: Range) -> None:
    """Raise an ``LTLError`` for a field of a family that is no range within its bounds, both of which it may reach."""
    for name, (lowest, highest) in bounds.items():
        low, high = getattr(family, name)
        if not lowest <= low <= high:
            raise LTLError(f"{name} is a range of at least {lowest}, the smaller number first, got {low} to {high}")
        if high > highest:
            raise LTLError(f"{name} is a range up to {highest} at most, got {low} to {high}")


def _check_most(what: str, number: int, name: str, limit: int) -> None:
    if number > limit:
        raise LTLError(f"{what}: {number:,}; the limit is {limit:,} (family_trees.{name})")


def _check_tree(family: TaskFamily) -> None:
    """The limits on a whole tree; those inside it were checked before, so no tree that is walked through is large."""
    _check_most("families inside each other", _nesting(family), "MAX_NESTING", MAX_NESTING)
    _check_most("families of a tree", _families(family), "MAX_FAMILIES", MAX_FAMILIES)
    _check_most("pairs of reach and avoid sets in one task", _pairs(family), "MAX_PAIRS", MAX_PAIRS)


def _inside(family: TaskFamily) -> tuple[TaskFamily, ...]:
    if isinstance(family, Mixture):
        return family.parts
    return (family.of,) if isinstance(family, _Several) else ()


def _nesting(family: TaskFamily) -> int:
    return 1 + max(map(_nesting, _inside(family)), default=0)


def _families(family: TaskFamily) -> int:
    return 1 + sum(map(_families, _inside(family)))


def _pairs(family: TaskFamily) -> int:
    """The most pairs of reach and avoid sets that a task can have; other tasks count as one."""
    if isinstance(family, Chains):
        return family.depth[1]
    most = max(map(_pairs, _inside(family)), default=1)
    return most * family.count[1] if isinstance(family, _Several) else most


for _name, _kind in {"chains": Chains, "conjunction": Conjunction, "disjunction": Disjunction}.items():
    register_task_family(_name, _kind)
    name_family(_name, _kind())
register_task_family("family", Named)
register_task_family("listed", Listed)
register_task_family("mixture", Mixture)
