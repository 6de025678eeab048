"""Readable guards: sets of letters as a few cubes (`Red & !Black`), not as 2^P lines."""

from collections.abc import Collection

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE, EVERY_SUBSET
from t2tl_jax.ltl.compiler.automaton import Automaton
from t2tl_jax.ltl.compiler.budget import Budget
from t2tl_jax.ltl.compiler.diagrams import Diagrams
from t2tl_jax.ltl.compiler.steps import Steps
from t2tl_jax.ltl.formula import quote

Cube = tuple[tuple[int, bool], ...]
"""Propositions (indices into `used`) with the value that each must have; the others are free."""

MAX_CUBES = 1000
"""Most cubes of one guard; nobody reads more."""


class TooManyCubes(Exception):
    """A guard would have more than `MAX_CUBES`."""


def guard(automaton: Automaton, row: int, outcomes: Collection[int]) -> str:
    """Return a formula over propositions that holds in exactly the letters that lead from a row to some outcomes.

    "" for none; a remark in words for a formula that would be too long to read.
    """
    names = [quote(name) for name in automaton.used]
    if set(automaton.steps.outcomes_of(row)) <= set(outcomes):
        return "true"
    if automaton.alphabet == AT_MOST_ONE:
        # "otherwise": none of the used propositions is true.
        taken = [outcome in outcomes for outcome in automaton.steps.dense([row])[0].tolist()]
        words = [name for name, is_taken in zip(names, taken[1:], strict=True) if is_taken]
        return " | ".join(words + ["otherwise"] * taken[0])
    try:
        cubes = cover(automaton.steps, row, outcomes)
    except TooManyCubes:
        return f"(in letters that take more than {MAX_CUBES:,} conjunctions to describe)"
    return " | ".join(
        " & ".join(names[index] if value else f"!{names[index]}" for index, value in sorted(cube)) for cube in cubes
    )


def cover(steps: Steps, row: int, outcomes: Collection[int]) -> list[Cube]:
    """Return cubes whose union is exactly the letters that lead from a row to some outcomes, none of them superfluous
    (Minato-Morreale). For the alphabet of every subset.

    Raises:
        TooManyCubes: for more than anybody would read.
    """
    sets = _Sets()
    node_of: dict[int, int] = {}
    for node in steps.below([int(steps.root[row])]).tolist():
        if node < steps.outcomes:
            node_of[node] = sets.TRUE if node in outcomes else sets.FALSE
        else:
            low, high = node_of[int(steps.low[node])], node_of[int(steps.high[node])]
            node_of[node] = sets.diagrams.node(int(steps.variable[node]), low, high)
    letters = node_of[int(steps.root[row])]
    return sets.cover(letters, letters)[0]


class _Sets:
    """Sets of letters as diagrams."""

    FALSE, TRUE = 0, 1

    def __init__(self) -> None:
        self.diagrams = Diagrams(EVERY_SUBSET, Budget())
        assert (self.diagrams.leaf(), self.diagrams.leaf()) == (self.FALSE, self.TRUE)
        self._unions: dict[tuple[int, int], int] = {}
        self._differences: dict[tuple[int, int], int] = {}
        self._covers: dict[tuple[int, int], tuple[list[Cube], int]] = {}

    def cover(self, must: int, may: int) -> tuple[list[Cube], int]:
        """Cover every letter of `must` by cubes inside `may`; return them and what they cover."""
        if must == self.FALSE:
            return [], self.FALSE
        if may == self.TRUE:
            return [()], self.TRUE
        key = (must, may)
        if key not in self._covers:
            variable, ((must0, must1), (may0, may1)) = self._halves(must, may)
            # Cubes that need the proposition false, then true, then the rest that holds for both values.
            cubes0, covered0 = self.cover(self._minus(must0, may1), may0)
            cubes1, covered1 = self.cover(self._minus(must1, may0), may1)
            rest = self._or(self._minus(must0, covered0), self._minus(must1, covered1))
            both, covered = self.cover(rest, self._minus(may0, self._minus(may0, may1)))
            cubes = [(*cube, (variable, True)) for cube in cubes1] + [(*cube, (variable, False)) for cube in cubes0]
            if len(cubes) + len(both) > MAX_CUBES:
                raise TooManyCubes
            node = self.diagrams.node(variable, self._or(covered0, covered), self._or(covered1, covered))
            self._covers[key] = cubes + both, node
        return self._covers[key]

    def _or(self, a: int, b: int) -> int:
        if self.TRUE in (a, b):
            return self.TRUE
        if a == b or self.FALSE in (a, b):
            return max(a, b)
        if (a, b) not in self._unions:
            variable, ((a0, a1), (b0, b1)) = self._halves(a, b)
            self._unions[a, b] = self.diagrams.node(variable, self._or(a0, b0), self._or(a1, b1))
        return self._unions[a, b]

    def _minus(self, a: int, b: int) -> int:
        if a in (b, self.FALSE) or b == self.TRUE:
            return self.FALSE
        if b == self.FALSE:
            return a
        if (a, b) not in self._differences:
            variable, ((a0, a1), (b0, b1)) = self._halves(a, b)
            self._differences[a, b] = self.diagrams.node(variable, self._minus(a0, b0), self._minus(a1, b1))
        return self._differences[a, b]

    def _halves(self, *nodes: int) -> tuple[int, list[tuple[int, int]]]:
        """The highest proposition that some of the sets decide, and each of them without and with it."""
        diagrams = self.diagrams
        top = max(diagrams.variable[node] for node in nodes)
        return top, [(diagrams.low[x], diagrams.high[x]) if diagrams.variable[x] == top else (x, x) for x in nodes]
