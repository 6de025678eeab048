"""The diagrams of the rows of many automata in one, as long as there is room for them in arrays of a given shape."""

from collections.abc import Iterable, Sequence

from t2tl_jax.ltl.compiler.budget import Budget, Limits
from t2tl_jax.ltl.compiler.diagrams import LEAF, Diagrams
from t2tl_jax.ltl.compiler.steps import Steps, from_diagrams


class Forest:
    """Where letters lead from the rows of a table that is filled bit by bit; row 0 is true, all others begin as false.

    Args:
        alphabet: "every_subset" or "at_most_one".
        cuts: where letters are cut into parts, see `parts.py`.
        room: nodes of each part, those of the first being the rows.
    """

    def __init__(self, alphabet: str, cuts: Sequence[int], room: Sequence[int]) -> None:
        self._diagrams = Diagrams(alphabet, Budget(Limits(max_work=2**62)))  # of what was compiled within its own
        self._alphabet, self._cuts, self._room = alphabet, cuts, room
        self._leaves = [self._diagrams.leaf() for _ in range(room[0])]
        self._roots = [self._leaves[0], *[self._leaves[1]] * (room[0] - 1)]
        self._open: list[set[int]] = [set() for _ in cuts[1:-1]]

    def add(self, steps: Steps, rows: Sequence[int], fresh: Sequence[int]) -> bool:
        """Take in some rows of an automaton, or leave everything as it is where there is no room for their letters.

        Args:
            steps: of the automaton, over all propositions.
            rows: per row of the automaton, that of the table.
            fresh: the rows of the automaton to take in.

        Returns:
            Whether there was room.
        """
        diagrams = self._diagrams
        nodes = [self._leaves[row] for row in rows]
        edges = zip(steps.variable.tolist(), steps.low.tolist(), steps.high.tolist(), strict=True)
        for j, low, high in list(edges)[steps.outcomes :]:  # what a node leads to comes before it
            nodes.append(diagrams.node(j, nodes[low], nodes[high]))
        roots = {rows[row]: nodes[steps.root[row]] for row in fresh}
        is_open = []
        for cut, known, room in zip(self._cuts[1:-1], self._open, self._room[1:], strict=True):
            is_open.append(known | self._crossing(roots.values(), cut))
            if len(is_open[-1]) > room:
                return False
        self._open = is_open
        for row, root in roots.items():
            self._roots[row] = root
        return True

    def steps(self) -> Steps:
        """Of all rows."""
        return from_diagrams(self._diagrams, self._roots, self._leaves, self._cuts[0], self._alphabet)

    def _crossing(self, roots: Iterable[int], cut: int) -> set[int]:
        """The nodes that are open where the propositions from `cut` on are known."""
        found, seen, stack = set(), set(), list(roots)
        while stack:
            node = stack.pop()
            if node in seen or self._diagrams.variable[node] == LEAF:
                continue
            seen.add(node)
            if self._diagrams.variable[node] < cut:
                found.add(node)
            else:
                stack += (self._diagrams.low[node], self._diagrams.high[node])
        return found
