"""Decision diagrams: functions from letters to leaves, shared node by node.

A diagram decides one proposition after the other (a higher index first) and ends in a leaf. Equal functions are the
same node, so comparing two functions is comparing two numbers.

Two alphabets, one program. When every subset of the propositions is a letter, a node whose branches agree is left
out. When at most one proposition is true at a time, every other proposition is false below a `high` branch, so such a
branch is always a leaf, and a node is left out when `high` is what its `low` branch gives for "all false".
"""

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE
from t2tl_jax.ltl.compiler.budget import Budget

LEAF = -1
"""The `variable` of a leaf."""


class Diagrams:
    """A growing set of nodes.

    Attributes:
        variable: per node, the proposition it decides, or `LEAF`.
        low, high: per node, the branches where that proposition is false and true (0 for a leaf).
        zero: per node, the leaf of the letter in which everything is false.
    """

    def __init__(self, alphabet: str, budget: Budget) -> None:
        self.budget = budget
        self.at_most_one = alphabet == AT_MOST_ONE
        self.variable: list[int] = []
        self.low: list[int] = []
        self.high: list[int] = []
        self.zero: list[int] = []
        self._nodes: dict[tuple[int, int, int], int] = {}

    def leaf(self) -> int:
        """Return a new leaf."""
        number = len(self.variable)
        self.variable.append(LEAF)
        self.low.append(0)
        self.high.append(0)
        self.zero.append(number)
        return number

    def node(self, variable: int, low: int, high: int) -> int:
        """Return the function that is `high` where the proposition is true and `low` elsewhere."""
        if high == (self.zero[low] if self.at_most_one else low):
            return low
        key = (variable, low, high)
        number = self._nodes.get(key)
        if number is None:
            number = self._nodes[key] = len(self.variable)
            self.variable.append(variable)
            self.low.append(low)
            self.high.append(high)
            self.zero.append(self.zero[low])
        return number

    def high_without(self, node: int) -> int:
        """Return the `high` branch that a diagram implies for a proposition it does not decide."""
        return self.zero[node] if self.at_most_one else node

    def leaves(self, node: int, seen: set[int] | None = None) -> list[int]:
        """Return the leaves that some letter reaches, in their order.

        Args:
            node: where to begin.
            seen: nodes that are passed over with everything below them; all that are met are added.
        """
        seen = set() if seen is None else seen
        found, stack = [], [node]
        while stack:
            node = stack.pop()
            if node in seen:
                continue
            seen.add(node)
            self.budget.spend(5)
            if self.variable[node] == LEAF:
                found.append(node)
            else:
                stack += (self.low[node], self.high[node])
        return sorted(found)

    def relabel(self, node: int, new_leaf: dict[int, int], memo: dict[int, int]) -> int:
        """Return the diagram with each leaf replaced; `memo` belongs to one `new_leaf`."""
        result = memo.get(node)
        if result is None:
            self.budget.spend(5)
            variable = self.variable[node]
            if variable == LEAF:
                result = new_leaf[node]
            else:
                low = self.relabel(self.low[node], new_leaf, memo)
                result = self.node(variable, low, self.relabel(self.high[node], new_leaf, memo))
            memo[node] = result
        return result
