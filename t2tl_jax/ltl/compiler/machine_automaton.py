"""From reward machines to the automaton that all of them share, in plain NumPy."""

from collections.abc import Iterable, Sequence

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import EVERY_SUBSET, check_names, letter_weights
from t2tl_jax.ltl.compiler.automaton import Automaton, stride
from t2tl_jax.ltl.compiler.budget import Budget, Limits
from t2tl_jax.ltl.compiler.diagrams import Diagrams
from t2tl_jax.ltl.compiler.steps import from_diagrams
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.reward_machine import DONE, FAIL, STAY, RewardMachine
from t2tl_jax.ltl.tokens import OPERATOR_ID


def build_machines(
    machines: RewardMachine | Iterable[RewardMachine],
    propositions: Sequence[str],
    alphabet: str = EVERY_SUBSET,
    *,
    limits: Limits | None = None,
) -> Automaton:
    """Write reward machines out as one automaton; `compile_reward_machines` documents arguments, rows and errors."""
    tasks = [machines] if isinstance(machines, RewardMachine) else list(machines)
    for machine in tasks:
        machine.check_propositions(propositions)
    guards = [transition.guard for machine in tasks for transition in machine.transitions]
    limits = Limits() if limits is None else limits
    names, used = check_names(guards, propositions, alphabet, limits)
    budget = Budget(limits, len(tasks))
    first_row = [2]
    for machine in tasks:
        first_row.append(first_row[-1] + len(machine.states))
    num_rows = first_row.pop()
    budget.check_rows(num_rows)

    pays = _rewards(tasks)
    guarded = _Guarded(Diagrams(alphabet, budget), [names[index] for index in used], num_rows, pays)
    roots = [guarded.leaves[0], guarded.leaves[1]]
    for machine, first in zip(tasks, first_row, strict=True):
        roots += guarded.rows_of(machine, first)
    return Automaton(
        tokens=((OPERATOR_ID["True"],), (OPERATOR_ID["False"],), *[()] * (num_rows - 2)),
        steps=from_diagrams(guarded.diagrams, roots, guarded.leaves, len(used), alphabet),
        verdict=np.array([1, -1] + [0] * (num_rows - 2), np.int8),
        initial_row=np.array(
            [first + machine.states.index(machine.start) for machine, first in zip(tasks, first_row, strict=True)],
            np.int32,
        ),
        letter_weights=letter_weights(len(names), used, alphabet),
        propositions=names,
        used=tuple(names[index] for index in used),
        alphabet=alphabet,
        states=(DONE, FAIL, *[f"{machine.name}.{state}" for machine in tasks for state in machine.states]),
        pays=np.array(pays, np.float32),
    )


def _rewards(machines: list[RewardMachine]) -> list[float]:
    """What the transitions pay, each number once; 0 first, as what is over pays it."""
    paid = {machine.otherwise_reward for machine in machines}
    paid |= {transition.reward for machine in machines for transition in machine.transitions}
    return [0.0, *sorted(paid - {0.0})]


class _Guarded:
    """Diagrams of guards, and of the outcomes that lines with guards lead to."""

    def __init__(self, diagrams: Diagrams, used: list[str], num_rows: int, pays: list[float]) -> None:
        self.diagrams, self._stride = diagrams, stride(num_rows)
        self.leaves = [
            diagrams.leaf() for _ in range(self._stride * len(pays))
        ]  # of the outcomes; the first, of guards
        self._false, self._true = self.leaves[:2]
        self._kind = {reward: kind for kind, reward in enumerate(pays)}
        self._place = {name: index for index, name in enumerate(used)}

    def rows_of(self, machine: RewardMachine, first: int) -> list[int]:
        """The diagram of each state of a machine whose rows begin at `first`."""
        row_of = {DONE: 0, FAIL: 1} | {state: first + index for index, state in enumerate(machine.states)}
        found = []
        for state in machine.states:
            stays = row_of[state] if machine.otherwise == STAY else row_of[machine.otherwise]
            node = self._outcome(stays, machine.otherwise_reward)
            for line in reversed(machine.lines_of(state)):  # the first whose guard holds is taken
                node = self._choose(self._guard(line.guard), self._outcome(row_of[line.target], line.reward), node, {})
            found.append(node)
        return found

    def _outcome(self, row: int, reward: float) -> int:
        return self.leaves[row + self._stride * self._kind[reward]]

    def _guard(self, guard: Formula) -> int:
        """The diagram of a formula without temporal operators, which ends in the leaf of true or of false."""
        false, true = self._false, self._true
        if guard.op == "prop":
            return self.diagrams.node(self._place[guard.name], false, true)
        if not guard.args:
            return true if guard.op == "True" else false
        first, *others = (self._guard(arg) for arg in guard.args)
        if guard.op == "not":
            return self._choose(first, false, true, {})
        second = others[0]
        if guard.op == "and":
            return self._choose(first, second, false, {})
        if guard.op == "or":
            return self._choose(first, true, second, {})
        if guard.op == "implies":
            return self._choose(first, second, true, {})
        assert guard.op == "iff"
        return self._choose(first, second, self._choose(second, false, true, {}), {})

    def _choose(self, guard: int, then: int, otherwise: int, memo: dict[tuple[int, int, int], int]) -> int:
        """The diagram that is `then` where the guard holds, and `otherwise` elsewhere."""
        if guard == self._true or then == otherwise:
            return then
        if guard == self._false:
            return otherwise
        key = (guard, then, otherwise)
        result = memo.get(key)
        if result is None:
            diagrams = self.diagrams
            diagrams.budget.spend(20)
            top = max(diagrams.variable[node] for node in key)
            (g0, g1), (a0, a1), (b0, b1) = (self._branches(node, top) for node in key)
            below = self._choose(g0, a0, b0, memo)
            result = memo[key] = diagrams.node(top, below, self._choose(g1, a1, b1, memo))
        return result

    def _branches(self, node: int, variable: int) -> tuple[int, int]:
        if self.diagrams.variable[node] == variable:
            return self.diagrams.low[node], self.diagrams.high[node]
        return node, self.diagrams.high_without(node)
