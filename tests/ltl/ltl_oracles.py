"""Slow, independent definitions of LTL to test against: nothing here uses the compiler, only the syntax tree."""

import random
from collections.abc import Callable, Sequence
from itertools import chain, combinations

from t2tl_jax.ltl import FALSE, TRUE, Formula, eventually, next_, prop, until

Letter = frozenset[str]


def letters_of(names: Sequence[str]) -> list[Letter]:
    """All subsets of the names."""
    subsets = chain.from_iterable(combinations(names, count) for count in range(len(names) + 1))
    return [frozenset(subset) for subset in subsets]


# ----- the definition of LTL, on ultimately periodic words -----


def holds(formula: Formula, prefix: Sequence[Letter], loop: Sequence[Letter]) -> bool:
    """Whether the infinite word `prefix loop loop ...` satisfies the formula, by the textbook semantics.

    Every subformula gets its truth value at each of the finitely many positions. Least fixpoints start from all
    false, greatest ones from all true; both are reached after as many backward passes as there are positions.
    """
    word = [*prefix, *loop]
    size = len(word)
    after = [*range(1, size), len(prefix)]

    def fixpoint(start: bool, rule: Callable[[int, bool], bool]) -> list[bool]:
        values = [start] * size
        while True:
            new = list(values)
            for i in reversed(range(size)):
                new[i] = rule(i, new[after[i]])
            if new == values:
                return values
            values = new

    def value(f: Formula) -> list[bool]:
        sub = [value(arg) for arg in f.args]
        match f.op:
            case "True" | "False":
                return [f.op == "True"] * size
            case "prop":
                return [f.name in letter for letter in word]
            case "not":
                return [not x for x in sub[0]]
            case "and":
                return [x and y for x, y in zip(*sub, strict=True)]
            case "or":
                return [x or y for x, y in zip(*sub, strict=True)]
            case "implies":
                return [not x or y for x, y in zip(*sub, strict=True)]
            case "iff":
                return [x == y for x, y in zip(*sub, strict=True)]
            case "next":
                return [sub[0][after[i]] for i in range(size)]
            case "eventually":
                return fixpoint(False, lambda i, later: sub[0][i] or later)
            case "always":
                return fixpoint(True, lambda i, later: sub[0][i] and later)
            case "until":
                return fixpoint(False, lambda i, later: sub[1][i] or (sub[0][i] and later))
            case "weak_until":
                return fixpoint(True, lambda i, later: sub[1][i] or (sub[0][i] and later))
            case "release":
                return fixpoint(True, lambda i, later: sub[1][i] and (sub[0][i] or later))
            case "strong_release":
                return fixpoint(False, lambda i, later: sub[1][i] and (sub[0][i] or later))
        raise AssertionError(f.op)

    return value(formula)[0]


# ----- derivatives as truth tables, exact verdicts by two fixpoints -----


class TooManyAtoms(Exception):
    """The truth tables would be too wide."""


def derivative_automaton(
    formula: Formula, letters: Sequence[Letter], max_atoms: int = 9
) -> tuple[list[list[int]], list[int]]:
    """States of progression up to boolean equivalence, from state 0 on, with exact verdicts.

    A state is a truth table (an int of 2**n bits) over the n temporal subformulas and propositions below.

    Args:
        formula: over `True False prop not and or next eventually until`; negations anywhere.
        letters: the alphabet.
        max_atoms: refuse wider tables.

    Returns:
        Per state the successors (one per letter), and per state the verdict +1, -1 or 0.
    """
    atoms = list(dict.fromkeys(f for f in formula.nodes() if f.op in ("prop", "next", "eventually", "until")))
    if len(atoms) > max_atoms:
        raise TooManyAtoms(len(atoms))
    width = 2 ** len(atoms)
    full = 2**width - 1
    mask = [sum(1 << row for row in range(width) if row >> i & 1) for i in range(len(atoms))]
    index = {atom: i for i, atom in enumerate(atoms)}

    def table(f: Formula, leaf: Callable[[Formula], int]) -> int:
        if f.op in ("True", "False"):
            return full if f.op == "True" else 0
        if f.op == "not":
            return full ^ table(f.args[0], leaf)
        if f.op == "and":
            return table(f.args[0], leaf) & table(f.args[1], leaf)
        if f.op == "or":
            return table(f.args[0], leaf) | table(f.args[1], leaf)
        return leaf(f)

    def standing(f: Formula) -> int:
        return table(f, lambda atom: mask[index[atom]])

    def progressed(f: Formula, letter: Letter) -> int:
        def leaf(atom: Formula) -> int:
            if atom.op == "prop":
                return full if atom.name in letter else 0
            if atom.op == "next":
                return standing(atom.args[0])
            last = progressed(atom.args[-1], letter)
            if atom.op == "eventually":
                return last | standing(atom)
            return last | (progressed(atom.args[0], letter) & standing(atom))

        return table(f, leaf)

    images = [[progressed(atom, letter) for atom in atoms] for letter in letters]

    def substitute(state: int, image: list[int]) -> int:
        memo: dict[tuple[int, int], int] = {}

        def go(truth: int, i: int) -> int:  # `truth` has 2**i rows, over atoms 0..i-1
            if truth == 0:
                return 0
            if truth == 2 ** (2**i) - 1:
                return full
            if (truth, i) not in memo:
                half = 2 ** (i - 1)
                low, high = truth & (2**half - 1), truth >> half
                memo[truth, i] = (go(high, i - 1) & image[i - 1]) | (go(low, i - 1) & ~image[i - 1])
            return memo[truth, i]

        return go(state, len(atoms))

    states = [standing(formula)]
    successors: list[list[int]] = []
    number = {states[0]: 0}
    for state in states:
        row = []
        for image in images:
            target = substitute(state, image)
            if target not in number:
                number[target] = len(states)
                states.append(target)
            row.append(number[target])
        successors.append(row)
    return successors, exact_verdicts(successors, [state == full for state in states])


def exact_verdicts(successors: list[list[int]], is_true: list[bool]) -> list[int]:
    """Good: the least set with true and everything all of whose successors are good. Bad: true is out of reach."""
    good, hopeful = list(is_true), list(is_true)
    changed = True
    while changed:
        changed = False
        for state, following in enumerate(successors):
            if not good[state] and all(good[t] for t in following):
                good[state] = changed = True
            if not hopeful[state] and any(hopeful[t] for t in following):
                hopeful[state] = changed = True
    return [1 if g else 0 if h else -1 for g, h in zip(good, hopeful, strict=True)]


# ----- random formulas and words -----


def random_formula(rng: random.Random, names: Sequence[str], depth: int) -> Formula:
    """A co-safe formula in negation normal form, of depth at most `depth`."""
    if depth == 0 or rng.random() < 0.12:
        leaf = prop(rng.choice(names))
        if depth > 0 and rng.random() < 0.4:
            return ~leaf
        return rng.choice((TRUE, FALSE)) if rng.random() < 0.04 else leaf
    kind = rng.choice(("and", "or", "next", "eventually", "until", "until"))
    left = random_formula(rng, names, depth - 1)
    if kind == "next":
        return next_(left)
    if kind == "eventually":
        return eventually(left)
    right = random_formula(rng, names, depth - 1)
    return left & right if kind == "and" else left | right if kind == "or" else until(left, right)


def random_letters(rng: random.Random, names: Sequence[str], count: int) -> list[Letter]:
    return [frozenset(name for name in names if rng.random() < 0.4) for _ in range(count)]
