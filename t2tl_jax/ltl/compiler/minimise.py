"""Exact verdicts by two fixpoints, and merging of states that no word tells apart (Moore's refinement)."""

from t2tl_jax.ltl.compiler.diagrams import Diagrams


def settle(successors: dict[int, frozenset[int]]) -> tuple[set[int], set[int]]:
    """Decide which states are already true or false.

    A co-safe formula holds exactly when a finite prefix progresses it to true. So a state is *false* when true cannot
    be reached from it, and *true* when it belongs to the least set that holds the state true and every state whose
    successors are all in the set.

    Args:
        successors: per state (a leaf), the states that some letter leads to; leaf 1 is true.

    Returns:
        The true states and the false states.
    """
    predecessors: dict[int, list[int]] = {}
    for state, following in successors.items():
        for target in following:
            predecessors.setdefault(target, []).append(state)
    hopeful, stack = {1}, [1]
    while stack:
        for state in predecessors.get(stack.pop(), ()):
            if state not in hopeful:
                hopeful.add(state)
                stack.append(state)
    good, stack = {1}, [1]
    undecided = {state: len(following) for state, following in successors.items()}
    while stack:
        for state in predecessors.get(stack.pop(), ()):
            if state not in good:
                undecided[state] -= 1
                if undecided[state] == 0:
                    good.add(state)
                    stack.append(state)
    return good, {state for state in successors if state not in hopeful}


def merge(diagrams: Diagrams, diagram_of: dict[int, int], good: set[int], bad: set[int]) -> dict[int, int]:
    """Find the classes of states that agree on the verdict after every word.

    Args:
        diagrams: holds the diagrams; nodes are added.
        diagram_of: per state (a leaf), its diagram of successors.
        good: the states that are true.
        bad: the states that are false.

    Returns:
        Per state, its class: 0 for false, 1 for true, others numbered from 2 in order of `diagram_of`.
    """
    open_states = [state for state in diagram_of if state not in good and state not in bad]
    classes = dict.fromkeys(bad, 0) | dict.fromkeys(good, 1) | dict.fromkeys(open_states, 2)
    count = min(1, len(open_states))
    leaf_of_class = [0, 1]
    while True:
        while len(leaf_of_class) < count + 2:
            leaf_of_class.append(diagrams.leaf())
        new_leaf = {state: leaf_of_class[number] for state, number in classes.items()}
        new_leaf[0], new_leaf[1] = 0, 1
        memo: dict[int, int] = {}
        signatures: dict[tuple[int, int], int] = {}
        for state in open_states:
            # The old class is part of the signature: refinement only splits.
            key = (classes[state], diagrams.relabel(diagram_of[state], new_leaf, memo))
            classes[state] = signatures.setdefault(key, len(signatures) + 2)
        if len(signatures) == count:
            return classes
        count = len(signatures)
