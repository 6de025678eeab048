"""Progression of one task: its states, and for each state the diagram of the state that follows each letter.

Every progressed formula is a boolean combination of *atoms*: temporal subformulas of the task, and literals. A state is
its disjunctive normal form: a set of terms, a term being an int with one bit per atom. Terms are closed under
implication between atoms (`F(a & F b)` brings `F b` along), so that "and" is bitwise or, and a term absorbs every term
that contains its bits.
"""

from t2tl_jax.ltl.compiler.budget import Budget
from t2tl_jax.ltl.compiler.core import AND, EVENTUALLY, LITERAL, NEXT, OR, UNTIL, Core
from t2tl_jax.ltl.compiler.diagrams import LEAF, Diagrams

State = frozenset[int]
"""Terms of a disjunction."""

EXACT, PAPER = "exact", "paper"
PROGRESSIONS = (EXACT, PAPER)
"""The usual rules, or the same with the last case of the paper's definition 2; see `Progression`."""

TRUE_STATE: State = frozenset((0,))
FALSE_STATE: State = frozenset()


class Leaves:
    """The leaves of all tasks of one compilation; leaf 0 is false and leaf 1 is true for all of them."""

    def __init__(self, diagrams: Diagrams) -> None:
        self.diagrams = diagrams
        self.state_of: dict[int, State] = {diagrams.leaf(): FALSE_STATE, diagrams.leaf(): TRUE_STATE}


class Progression:
    """The atoms, states and diagrams of one task.

    With `drops`, progression is the paper's with the last case of its definition 2: a satisfied proposition is dropped.
    We read it so: when a letter satisfies a proposition that `g` asks for now, and leaves something of `g` to be done,
    `f U g` becomes that rest alone. The usual rule keeps `f U g` as a second chance: `prog(g) | (prog(f) & (f U g))`.
    The paper's own theorem 1 (a word satisfies a formula exactly when its rest satisfies the progressed one) needs the
    second chance, so that the two contradict each other.

    Attributes:
        atoms: the core number of each atom.
        closure: per atom, the bits of all atoms that it implies, its own included.
        redundant_with: per atom, the bits of the atoms that make it superfluous in a term.
        root: the state that the task starts in.
    """

    def __init__(self, core: Core, root: int, leaves: Leaves, budget: Budget, drops: bool = False) -> None:
        self.core, self.diagrams, self.budget, self.drops = core, leaves.diagrams, budget, drops
        self._state_of_leaf = leaves.state_of
        self._leaf_of_state: dict[State, int] = {FALSE_STATE: 0, TRUE_STATE: 1}
        self._memo: dict[tuple[bool, int, int], int] = {}
        self._diagram_of: dict[int, int] = {0: 0, 1: 1}
        self._collect_atoms(root)
        self._state_of_core: dict[int, State] = {0: FALSE_STATE, 1: TRUE_STATE}
        self.root = self.state_of(root)

    def _collect_atoms(self, root: int) -> None:
        core = self.core
        numbers: dict[int, int] = {}
        seen: set[tuple[int, bool]] = set()
        # Literals are atoms where a state may hold them: at the top, or below X. Elsewhere they are decided at once.
        stack = [(root, True)]
        while stack:
            number, in_state = stack.pop()
            if number <= 1 or (number, in_state) in seen:
                continue
            seen.add((number, in_state))
            kind, args = core.kind[number], core.args[number]
            if kind in (AND, OR):
                stack.extend((arg, in_state) for arg in args)
            elif kind == LITERAL:
                if in_state:
                    numbers.setdefault(number, len(numbers))
            else:
                numbers.setdefault(number, len(numbers))
                stack.extend((arg, kind == NEXT) for arg in args)
        self.atoms = list(numbers)
        self._bit = {number: 1 << index for number, index in numbers.items()}
        implies = core.implies
        self.closure = [sum([self._bit[b] for b in self.atoms if implies(a, b)]) for a in self.atoms]
        self.redundant_with = []
        for j, bits_j in enumerate(self.closure):
            bits = 0
            for i, bits_i in enumerate(self.closure):
                # Of atoms that imply each other, the first stays.
                if i != j and bits_i >> j & 1 and (i < j or not bits_j >> i & 1):
                    bits |= 1 << i
            self.redundant_with.append(bits)
        self._contradictions = [
            self._bit[a] | self._bit[b]
            for a in self.atoms
            if core.kind[a] == LITERAL and core.args[a][1]
            for b in [core.literal(core.args[a][0], False)]
            if b in self._bit
        ]

    # ----- states -----

    def state_of(self, number: int) -> State:
        """Return the state of a boolean combination of atoms."""
        state = self._state_of_core.get(number)
        if state is None:
            kind, args = self.core.kind[number], self.core.args[number]
            if kind in (AND, OR):
                state = self.state_of(args[0])
                for arg in args[1:]:
                    state = self._combine(kind == AND, state, self.state_of(arg))
            else:
                bit = self._bit[number]
                state = frozenset((self.closure[bit.bit_length() - 1],))
            self._state_of_core[number] = state
        return state

    def _combine(self, is_and: bool, a: State, b: State) -> State:
        if is_and:
            self.budget.spend(10 + 2 * len(a) * len(b))
            terms = {x | y for x in a for y in b}
            for pair in self._contradictions:
                terms = {x for x in terms if x & pair != pair}
        else:
            self.budget.spend(10 + len(a) + len(b))
            terms = set(a | b)
        if len(terms) < 2:
            return frozenset(terms)
        if len(terms) > self.budget.max_terms:
            # Absorption is quadratic: refuse before paying for it.
            self.budget.check_terms(len(terms))
        kept: list[int] = []
        for term in sorted(terms, key=int.bit_count):
            for weaker in kept:
                if term & weaker == weaker:
                    break
            else:
                kept.append(term)
        self.budget.spend(len(kept) * len(terms) // 2)
        return frozenset(kept)

    def irredundant(self, term: int) -> int:
        """Return the term without the atoms that its other atoms imply."""
        result = rest = term
        while rest:
            low = rest & -rest
            if term & self.redundant_with[low.bit_length() - 1]:
                result ^= low
            rest ^= low
        return result

    # ----- progression -----

    def successors(self, state: State) -> int:
        """Return the diagram from letters to the states that follow `state`."""
        result = 0
        for term in sorted(state):
            node = 1
            rest = self.irredundant(term)
            while rest:
                low = rest & -rest
                rest ^= low
                node = self._apply(True, node, self._diagram(self.atoms[low.bit_length() - 1]))
            result = self._apply(False, result, node)
        return result

    def _diagram(self, number: int) -> int:
        """Return the one-step expansion of a formula: `F x` is `x | X F x`, `x U y` is `y | (x & X(x U y))`."""
        node = self._diagram_of.get(number)
        if node is not None:
            return node
        kind, args = self.core.kind[number], self.core.args[number]
        if kind == LITERAL:
            proposition, positive = args
            node = self.diagrams.node(proposition, 1 - positive, positive)
        elif kind in (AND, OR):
            node = self._diagram(args[0])
            for arg in args[1:]:
                node = self._apply(kind == AND, node, self._diagram(arg))
        elif kind == NEXT:
            node = self.leaf_of(self.state_of(args[0]))
        elif kind == EVENTUALLY:
            node = self._fulfil(args[0], self.leaf_of(self.state_of(number)))
        else:
            assert kind == UNTIL
            stays = self._apply(True, self._diagram(args[0]), self.leaf_of(self.state_of(number)))
            node = self._fulfil(args[1], stays)
        self._diagram_of[number] = node
        return node

    def _fulfil(self, right: int, stays: int) -> int:
        """Return the diagram of `prog(right) | stays`; with `drops`, without `stays` where `right` has begun."""
        now = self._diagram(right)
        if self.drops:
            not_begun = 1
            for proposition in self._asked_now(right):
                not_begun = self._apply(True, not_begun, self.diagrams.node(proposition, 1, 0))
            is_false = dict.fromkeys(self.diagrams.leaves(now), 0) | {0: 1}
            may_stay = self._apply(False, not_begun, self.diagrams.relabel(now, is_false, {}))
            stays = self._apply(True, stays, may_stay)
        return self._apply(False, now, stays)

    def _asked_now(self, number: int) -> list[int]:
        """Return the propositions that a formula asks for in the present: positive, below no temporal operator."""
        kind, args = self.core.kind[number], self.core.args[number]
        if kind in (AND, OR):
            return sorted({proposition for arg in args for proposition in self._asked_now(arg)})
        return [args[0]] if kind == LITERAL and args[1] else []

    def leaf_of(self, state: State) -> int:
        """Return the leaf that stands for a state of this task."""
        leaf = self._leaf_of_state.get(state)
        if leaf is None:
            leaf = self._leaf_of_state[state] = self.diagrams.leaf()
            self._state_of_leaf[leaf] = state
        return leaf

    def _apply(self, is_and: bool, a: int, b: int) -> int:
        """Combine two diagrams letter by letter with "and" or "or"."""
        if a == b:
            return a
        if a > b:
            a, b = b, a
        if a == 0:  # false
            return 0 if is_and else b
        if a == 1:  # true
            return b if is_and else 1
        key = (is_and, a, b)
        result = self._memo.get(key)
        if result is not None:
            return result
        self.budget.spend(20)
        diagrams = self.diagrams
        variable_a, variable_b = diagrams.variable[a], diagrams.variable[b]
        top = max(variable_a, variable_b)
        if top == LEAF:
            result = self.leaf_of(self._combine(is_and, self._state_of_leaf[a], self._state_of_leaf[b]))
        else:
            if variable_a == top:
                low_a, high_a = diagrams.low[a], diagrams.high[a]
            else:
                low_a, high_a = a, diagrams.high_without(a)
            if variable_b == top:
                low_b, high_b = diagrams.low[b], diagrams.high[b]
            else:
                low_b, high_b = b, diagrams.high_without(b)
            low = self._apply(is_and, low_a, low_b)
            result = diagrams.node(top, low, self._apply(is_and, high_a, high_b))
        self._memo[key] = result
        return result
