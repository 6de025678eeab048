"""Exact verdicts by two fixpoints, and merging of states that no word tells apart (Moore's refinement).

Both go over the nodes of the diagrams and not over the letters, of which there may be very many more.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from t2tl_jax.ltl.compiler.diagrams import LEAF, Diagrams


@dataclass(frozen=True)
class Merged:
    """Classes of states that agree on the verdict after every word, and where letters lead between them.

    Attributes:
        classes: per state (a leaf), its class: 0 for false, 1 for true, others numbered from 2 in order of the states.
        count: how many classes there are.
        variable, low, high: diagrams without a node twice; the first `count` nodes are the classes.
        root: per class, its node.
    """

    classes: dict[int, int]
    count: int
    variable: list[int]
    low: list[int]
    high: list[int]
    root: list[int]


def settle(diagrams: Diagrams, diagram_of: dict[int, int]) -> tuple[set[int], dict[int, int]]:
    """Decide which states are already true or false.

    A co-safe formula holds exactly when a finite prefix progresses it to true. So a state is *false* when true cannot
    be reached from it, and *true* when it belongs to the least set that holds the state true and every state whose
    successors are all in the set.

    Args:
        diagrams: holds the diagrams.
        diagram_of: per state (a leaf), its diagram of successors; leaf 1 is true.

    Returns:
        The true states; and per state that is not false, the fewest letters that lead to leaf 1.
    """
    parents: dict[int, list[int]] = defaultdict(list)
    states: dict[int, list[int]] = defaultdict(list)
    for state, root in diagram_of.items():
        states[root].append(state)
    for node in _inner(diagrams, diagram_of):
        parents[diagrams.low[node]].append(node)
        parents[diagrams.high[node]].append(node)
    return _good(parents, states), _distances(parents, states)


def _distances(parents: dict[int, list[int]], states: dict[int, list[int]]) -> dict[int, int]:
    distance, seen, front = {1: 0}, {1}, [1]
    while front:
        stack, steps, front = front, distance[front[0]] + 1, []
        while stack:
            node = stack.pop()
            for state in states.get(node, ()):
                if state not in distance:
                    distance[state] = steps
                    front.append(state)
            for parent in parents.get(node, ()):
                if parent not in seen:
                    seen.add(parent)
                    stack.append(parent)
    return distance


def _good(parents: dict[int, list[int]], states: dict[int, list[int]]) -> set[int]:
    good, half, stack = {1}, set(), [1]
    while stack:
        node = stack.pop()
        for state in states.get(node, ()):
            if state not in good:
                good.add(state)
                stack.append(state)
        for parent in parents.get(node, ()):
            if parent in half:  # both branches are good
                stack.append(parent)
            half.add(parent)
    return good


def merge(diagrams: Diagrams, diagram_of: dict[int, int], good: set[int], distance: dict[int, int]) -> Merged:
    """Find the classes of states that agree on the verdict after every word.

    Args:
        diagrams: holds the diagrams.
        diagram_of: per state (a leaf), its diagram of successors.
        good, distance: of `settle`.
    """
    open_states = [state for state in diagram_of if state not in good and state in distance]
    # The distance to true is the same for states of one class, and tells most others apart at once.
    by_distance: dict[int, int] = {}
    classes = {state: int(state in good) for state in diagram_of}
    classes |= {state: by_distance.setdefault(distance[state], 2 + len(by_distance)) for state in open_states}
    count = 2 + len(by_distance)

    inner = _inner(diagrams, diagram_of)
    place = {node: number for number, node in enumerate((*classes, *inner))}
    edges = [(diagrams.variable[x], place[diagrams.low[x]], place[diagrams.high[x]]) for x in inner]
    roots = [place[diagram_of[state]] for state in open_states]
    while True:
        diagrams.budget.spend(5 * len(place))
        variable, low, high, relabelled = _relabelled(edges, classes.values(), count, diagrams.at_most_one)
        signatures: dict[tuple[int, int], int] = {}
        for state, root in zip(open_states, roots, strict=True):
            # The old class is part of the signature: refinement only splits.
            classes[state] = signatures.setdefault((classes[state], relabelled[root]), len(signatures) + 2)
        if len(signatures) + 2 == count:
            return Merged(classes, count, variable, low, high, [0, 1, *(root for _, root in signatures)])
        count = len(signatures) + 2


def _relabelled(
    edges: list[tuple[int, int, int]], labels: Iterable[int], count: int, at_most_one: bool
) -> tuple[list[int], list[int], list[int], list[int]]:
    """Diagrams whose leaves are the labels 0 to count - 1 instead, and per old node, the new one."""
    variable, low, high, zero = [LEAF] * count, [0] * count, [0] * count, list(range(count))
    nodes: dict[tuple[int, int, int], int] = {}
    new = list(labels)
    for decided, old_low, old_high in edges:
        below, above = new[old_low], new[old_high]
        if above == (zero[below] if at_most_one else below):
            new.append(below)
            continue
        number = nodes.setdefault((decided, below, above), len(variable))
        if number == len(variable):
            variable.append(decided)
            low.append(below)
            high.append(above)
            zero.append(zero[below])
        new.append(number)
    return variable, low, high, new


def _inner(diagrams: Diagrams, diagram_of: dict[int, int]) -> list[int]:
    """All nodes of the diagrams but leaves; what a node leads to comes before it."""
    seen: set[int] = set()
    for root in diagram_of.values():
        diagrams.leaves(root, seen)
    return sorted(node for node in seen if diagrams.variable[node] != LEAF)
