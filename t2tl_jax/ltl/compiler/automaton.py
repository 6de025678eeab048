"""From formulas to a finite automaton in plain NumPy: closure under progression, exact verdicts, minimisation."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE, EVERY_SUBSET, check_cells, check_names, letter_weights
from t2tl_jax.ltl.compiler.budget import MAX_ROWS, MAX_WORK, MORE_WORK_PER_TASK, Budget
from t2tl_jax.ltl.compiler.core import Core
from t2tl_jax.ltl.compiler.diagrams import Diagrams
from t2tl_jax.ltl.compiler.display import Display, Tokens
from t2tl_jax.ltl.compiler.minimise import merge, settle
from t2tl_jax.ltl.compiler.normal_form import negation_normal_form
from t2tl_jax.ltl.compiler.states import EXACT, PAPER, PROGRESSIONS, Leaves, Progression, State
from t2tl_jax.ltl.errors import LTLError, nearest, no_formulas, unknown_proposition
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.parser import parse
from t2tl_jax.ltl.tokens import decode


@dataclass(frozen=True, eq=False)
class Automaton:
    """The automaton of one or more tasks; row 0 is true and row 1 is false. That of formulas is minimal.

    Attributes:
        tokens: per row, the token ids of its shortest formula; none for a state of a reward machine.
        next_row: int32 `[rows, letters]`, the row that each letter leads to.
        verdict: int8 `[rows]`, +1 true, -1 false, 0 open.
        initial_row: int32 `[tasks]`.
        letter_weights: int32 `[propositions]`, how a label vector becomes a letter; 0 for unused propositions.
        propositions: the environment's propositions, in its order.
        used: the propositions that the formulas use, in the environment's order.
        alphabet: "every_subset" or "at_most_one".
        states: per row, the name of the reward machine's state; empty when the rows are formulas.
        rewards: float32 `[rows, letters]`, what each transition of a reward machine pays; None for formulas.
    """

    tokens: tuple[Tokens, ...]
    next_row: np.ndarray
    verdict: np.ndarray
    initial_row: np.ndarray
    letter_weights: np.ndarray
    propositions: tuple[str, ...]
    used: tuple[str, ...]
    alphabet: str
    states: tuple[str, ...] = ()
    rewards: np.ndarray | None = None

    def formula(self, row: int) -> Formula:
        """Return the formula that a row shows; LTLError when the rows are states of reward machines."""
        if self.states:
            raise no_formulas()
        return decode(self.tokens[row], self.propositions)

    def text(self, row: int) -> str:
        """Return what a row shows: its formula, or the name of its state."""
        return self.states[row] if self.states else str(self.formula(row))

    def letter(self, label: Iterable[str]) -> int:
        """Return the letter in which exactly the propositions of `label` are true."""
        known = set(self.propositions)
        weights = [0]
        for name in set(label):
            if name not in known:
                raise unknown_proposition(name, self.propositions)
            weights.append(int(self.letter_weights[self.propositions.index(name)]))
        return max(weights) if self.alphabet == AT_MOST_ONE else sum(weights)


def build(
    formulas: str | Formula | Iterable[str | Formula],
    propositions: Sequence[str],
    alphabet: str = EVERY_SUBSET,
    *,
    max_rows: int = MAX_ROWS,
    progression: str = EXACT,
) -> Automaton:
    """Compile tasks to one automaton; `compile_tasks` documents the arguments and errors."""
    if progression not in PROGRESSIONS:
        raise LTLError(
            f"unknown progression {progression!r}; known: {', '.join(PROGRESSIONS)}"
            f"{nearest(str(progression), PROGRESSIONS)}"
        )
    tasks = [formulas] if isinstance(formulas, str | Formula) else list(formulas)
    normal = [negation_normal_form(parse(task) if isinstance(task, str) else task) for task in tasks]
    names, used = check_names(normal, propositions, alphabet)
    budget = Budget(max_rows=max_rows, max_work=MAX_WORK + MORE_WORK_PER_TASK * len(tasks))
    core = Core([names[index] for index in used])
    roots = [core.add(formula) for formula in normal]

    explored = _explore(core, roots, alphabet, budget, progression == PAPER)
    diagrams, diagram_of = explored.diagrams, explored.diagram_of
    good, bad = settle({state: diagrams.leaves(node) for state, node in diagram_of.items()})
    classes = merge(diagrams, diagram_of, good, bad)
    budget.check_rows(max(classes.values()) + 1)

    shown = _shortest_formulas(Display(core, used), roots, explored, classes)
    budget.check_tokens(max(len(tokens) for tokens in shown.values()))
    row_of_class = _order_rows(explored, classes, shown)
    diagram_of_row = [1, 0] + [0] * (len(row_of_class) - 2)
    row_of_leaf = np.zeros(len(diagrams.variable), np.int32)
    for state, number in classes.items():
        row_of_leaf[state] = row_of_class[number]
        if number > 1:
            diagram_of_row[row_of_class[number]] = diagram_of[state]
    check_cells(len(row_of_class), len(used), alphabet)
    return Automaton(
        tokens=tuple(shown[number] for number in sorted(row_of_class, key=lambda number: row_of_class[number])),
        next_row=row_of_leaf[diagrams.table(diagram_of_row, len(used))],
        verdict=np.array([1, -1] + [0] * (len(row_of_class) - 2), np.int8),
        initial_row=np.array([row_of_class[classes[explored.start[root]]] for root in roots], np.int32),
        letter_weights=letter_weights(len(names), used, alphabet),
        propositions=names,
        used=tuple(names[index] for index in used),
        alphabet=alphabet,
    )


@dataclass(frozen=True)
class _Explored:
    """All states that progression reaches. A state is the leaf that stands for it in the diagrams."""

    diagrams: Diagrams
    terms: dict[int, State]
    diagram_of: dict[int, int]
    """Per state, the diagram of its successors."""
    owner: dict[int, Progression]
    """Per state other than true and false, the task whose atoms its terms speak of."""
    start: dict[int, int]
    """Per task (a core number), its first state."""


def _explore(core: Core, roots: list[int], alphabet: str, budget: Budget, drops: bool) -> _Explored:
    """Close the tasks under progression, breadth first; each task has its own atoms, all share the diagrams."""
    diagrams = Diagrams(alphabet, budget)
    leaves = Leaves(diagrams)
    explored = _Explored(diagrams, leaves.state_of, {0: 0, 1: 1}, {}, {})
    for root in dict.fromkeys(roots):
        progression = Progression(core, root, leaves, budget, drops)
        queue = [progression.leaf_of(progression.root)]
        explored.start[root] = queue[0]
        for state in queue:
            if state in explored.diagram_of:
                continue
            explored.owner[state] = progression
            node = progression.successors(explored.terms[state])
            explored.diagram_of[state] = node
            queue.extend(sorted(s for s in diagrams.leaves(node) if s not in explored.diagram_of))
            budget.check_states(len(explored.diagram_of))
    return explored


def _shortest_formulas(
    display: Display, roots: list[int], explored: _Explored, classes: dict[int, int]
) -> dict[int, Tokens]:
    """Return per class the token ids of its shortest member; the tasks as written are candidates too."""
    shown = {0: display.tokens(0), 1: display.tokens(1)}
    candidates = [
        (classes[state], display.shortest(progression, explored.terms[state]))
        for state, progression in explored.owner.items()
        if classes[state] > 1
    ]
    candidates += [(classes[explored.start[root]], root) for root in roots]
    for number, formula in candidates:
        tokens = display.tokens(formula)
        old = shown.get(number)
        if old is None or (len(tokens), tokens) < (len(old), old):
            shown[number] = tokens
    return shown


def _order_rows(explored: _Explored, classes: dict[int, int], shown: dict[int, Tokens]) -> dict[int, int]:
    """Return per class its row: true, false, then breadth first from the tasks, longer formulas first."""
    member: dict[int, int] = {}
    for state in explored.diagram_of:
        member.setdefault(classes[state], state)
    rows = {1: 0, 0: 1}
    queue = [classes[state] for state in explored.start.values()]
    for number in queue:
        if number in rows and number > 1:
            continue
        rows.setdefault(number, len(rows))
        following = {classes[s] for s in explored.diagrams.leaves(explored.diagram_of[member[number]])}
        queue.extend(
            sorted((n for n in following if n not in rows), key=lambda other: (-len(shown[other]), shown[other]))
        )
    return rows
