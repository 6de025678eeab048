"""Where every letter leads from every row: decision diagrams as arrays, so that 2^24 letters need no more than few.

A diagram decides one proposition after the other, a higher index first, and ends in an outcome. No node occurs twice,
so that equal functions are one node. What an outcome is does not matter here: a row, or a row with what it pays.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE
from t2tl_jax.ltl.compiler.diagrams import LEAF, Diagrams


@dataclass(frozen=True, eq=False)
class Steps:
    """The outcome of every letter in every row. Node `k` of the first `outcomes` ones is the outcome `k`.

    Attributes:
        variable: int32 `[nodes]`, the proposition that a node decides, or `LEAF` for an outcome.
        low, high: int32 `[nodes]`, where that proposition is false and true; both earlier than the node itself.
        root: int32 `[rows]`, the node of every row.
        outcomes: how many there are.
        propositions: how many a letter has.
        alphabet: "every_subset" or "at_most_one"; with the latter all other propositions are false below `high`.
    """

    variable: np.ndarray
    low: np.ndarray
    high: np.ndarray
    root: np.ndarray
    outcomes: int
    propositions: int
    alphabet: str

    @property
    def num_letters(self) -> int:
        """Letters of the alphabet."""
        return self.propositions + 1 if self.alphabet == AT_MOST_ONE else 2**self.propositions

    @cached_property
    def zero(self) -> np.ndarray:
        """Per node, the outcome of the letter in which everything is false: int32 `[nodes]`."""
        zero = np.arange(len(self.variable), dtype=np.int32)
        while (inner := zero >= self.outcomes).any():
            zero[inner] = self.low[zero[inner]]
        return zero

    def outcome(self, row: int, letter: int) -> int:
        """Where a letter leads; walks down one diagram."""
        node = int(self.root[row])
        while (j := int(self.variable[node])) != LEAF:
            if self.alphabet == AT_MOST_ONE:
                true = letter == j + 1
                if letter > j + 1:
                    return int(self.zero[node])
            else:
                true = bool(letter >> j & 1)
            node = int((self.high if true else self.low)[node])
        return node

    def outcomes_of(self, row: int) -> list[int]:
        """The outcomes that some letter leads to, in their order."""
        return [int(node) for node in self.below([int(self.root[row])]) if node < self.outcomes]

    def reaches_more_than(self, row: int, most: int) -> bool:
        """Whether letters lead from a row to more outcomes than so many; without counting them all."""
        seen, stack, found = {int(self.root[row])}, [int(self.root[row])], 0
        while stack and found <= most:
            node = stack.pop()
            if node < self.outcomes:
                found += 1
                continue
            after = {int(self.low[node]), int(self.high[node])} - seen
            seen |= after
            stack += after
        return found > most

    def below(self, nodes: Iterable[int]) -> np.ndarray:
        """Every node that some of `nodes` lead to, themselves included, in their order."""
        stack = list(nodes)
        seen = set(stack)
        while stack:
            node = stack.pop()
            if node >= self.outcomes:
                for after in (int(self.low[node]), int(self.high[node])):
                    if after not in seen:
                        seen.add(after)
                        stack.append(after)
        return np.array(sorted(seen), np.int32)

    def over(self, places: Sequence[int], propositions: int) -> "Steps":
        """The same letters among more propositions: number `j` becomes `places[j]`, which rise with `j`."""
        place = np.array([*places, LEAF], np.int32)  # an outcome's variable is -1, the last entry
        return replace(self, variable=place[self.variable], propositions=propositions)

    def with_rows(self, rows: int) -> "Steps":
        """The same with more rows, each an outcome too; from those that are left over every letter leads to row 1."""
        more = rows - self.outcomes

        def moved(nodes: np.ndarray) -> np.ndarray:
            return np.where(nodes < self.outcomes, nodes, nodes + more).astype(np.int32)

        none = np.zeros(more, np.int32)
        return replace(
            self,
            variable=np.concatenate([none + LEAF, self.variable]),
            low=np.concatenate([none, moved(self.low)]),
            high=np.concatenate([none, moved(self.high)]),
            root=np.concatenate([moved(self.root), none + 1]),
            outcomes=rows,
        )

    def among(self, places: Sequence[int]) -> "Steps":
        """The opposite of `over`: only for rows that depend on no proposition but `places`, which rise."""
        place = np.full(self.propositions + 1, LEAF, np.int32)
        place[places] = np.arange(len(places))
        return replace(self, variable=place[self.variable], propositions=len(places))

    def read_by(self, rows: Iterable[int]) -> list[int]:
        """The propositions that the outcome of some letter in some of `rows` depends on, in rising order."""
        variables = np.unique(self.variable[self.below(int(self.root[row]) for row in rows)])
        return [int(j) for j in variables if j != LEAF]

    def dense(self, rows: Sequence[int] | None = None) -> np.ndarray:
        """All outcomes, int32 `[rows, letters]`, of all rows or of some: a column per letter.

        Every subset: column `sum(2**j for true j)`. At most one: column 0 for "none", `j + 1` for proposition `j`.
        """
        at = self.root if rows is None else self.root[list(rows)]
        if self.alphabet != AT_MOST_ONE:
            return self.expanded(at, self.propositions, 0)
        columns = []
        for j in reversed(range(self.propositions)):
            decides = self.variable[at] == j
            columns.append(np.where(decides, self.high[at], self.zero[at]))
            at = np.where(decides, self.low[at], at)
        return np.stack([at, *reversed(columns)], axis=-1)

    def expanded(self, nodes: np.ndarray, top: int, bottom: int) -> np.ndarray:
        """The nodes reached once the propositions below `top` and from `bottom` on are known: `[n, 2^(top-bottom)]`.

        Column `sum(2**(j - bottom) for true j)`. For the alphabet of every subset.
        """
        at = nodes.astype(np.int32)
        for j in reversed(range(bottom, top)):
            decides = self.variable[at] == j
            both = np.empty((*at.shape, 2), np.int32)
            both[..., 0] = np.where(decides, self.low[at], at)
            both[..., 1] = np.where(decides, self.high[at], at)
            at = both
        return at.reshape(len(nodes), 1 << top - bottom)


def from_diagrams(
    diagrams: Diagrams, roots: Sequence[int], leaves: Sequence[int], propositions: int, alphabet: str
) -> Steps:
    """The diagrams of some rows, and nothing else of what `diagrams` holds.

    Args:
        diagrams: in which equal functions are one node.
        roots: per row, its node.
        leaves: per outcome, the leaf that stands for it; all leaves below the roots are among them.
        propositions: how many a letter has.
        alphabet: that of `diagrams`.
    """
    seen, stack = set(leaves), list(dict.fromkeys(roots))
    low, high = diagrams.low, diagrams.high
    inner: list[int] = []
    while stack:
        node = stack.pop()
        if node not in seen:
            seen.add(node)
            inner.append(node)
            stack += (low[node], high[node])
    inner.sort()
    number = {node: place for place, node in enumerate((*leaves, *inner))}
    none = [0] * len(leaves)
    return Steps(
        variable=np.array([LEAF] * len(leaves) + [diagrams.variable[node] for node in inner], np.int32),
        low=np.array(none + [number[low[node]] for node in inner], np.int32),
        high=np.array(none + [number[high[node]] for node in inner], np.int32),
        root=np.array([number[root] for root in roots], np.int32),
        outcomes=len(leaves),
        propositions=propositions,
        alphabet=alphabet,
    )


class Folding:
    """Diagrams made bottom up from arrays, a proposition at a time.

    Args:
        outcomes: how many there are.
    """

    def __init__(self, outcomes: int) -> None:
        self.outcomes = outcomes
        self._size = outcomes
        self._parts = [np.stack([np.full(outcomes, LEAF), np.zeros(outcomes, int), np.zeros(outcomes, int)])]

    def node(self, j: int, low: np.ndarray, high: np.ndarray, same: np.ndarray) -> np.ndarray:
        """The nodes that decide proposition `j` between `low` and `high`, or `low` itself where `same` says so.

        Once for every `j`, lower ones first: equal pairs of one call become one node.
        """
        result = low.astype(np.int64)
        pairs, inverse = np.unique(result[~same] * self._size + high[~same], return_inverse=True)
        result[~same] = self._size + inverse
        self._parts.append(np.stack([np.full(len(pairs), j), *np.divmod(pairs, self._size)]))
        self._size += len(pairs)
        return result

    def steps(self, root: np.ndarray, propositions: int, alphabet: str) -> Steps:
        """The result, by the nodes of its rows."""
        variable, low, high = np.concatenate(self._parts, axis=1).astype(np.int32)
        return Steps(variable, low, high, root.astype(np.int32), self.outcomes, propositions, alphabet)


def from_dense(outcome: np.ndarray, outcomes: int, alphabet: str) -> Steps:
    """The diagrams of int `[rows, letters]`, the opposite of `Steps.dense`."""
    folding = Folding(outcomes)
    if alphabet == AT_MOST_ONE:
        zero = at = outcome[:, 0].astype(np.int64)
        for j in range(outcome.shape[1] - 1):
            at = folding.node(j, at, outcome[:, j + 1], outcome[:, j + 1] == zero)
        return folding.steps(at, outcome.shape[1] - 1, alphabet)
    propositions = outcome.shape[1].bit_length() - 1
    return folding.steps(folded(folding, outcome, propositions, 0)[:, 0], propositions, alphabet)


def folded(folding: Folding, at: np.ndarray, top: int, bottom: int) -> np.ndarray:
    """The opposite of `Steps.expanded`: from `[n, 2^(top-bottom)]` nodes to those that decide between them `[n, 1]`."""
    for j in range(bottom, top):
        low, high = at[:, 0::2], at[:, 1::2]
        at = folding.node(j, low.reshape(-1), high.reshape(-1), (low == high).reshape(-1)).reshape(low.shape)
    return at
