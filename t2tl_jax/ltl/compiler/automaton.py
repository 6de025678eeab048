"""From formulas to a finite automaton in plain NumPy: closure under progression, exact verdicts, minimisation."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE, EVERY_SUBSET, check_names, letter_weights
from t2tl_jax.ltl.compiler.budget import Budget, Limits
from t2tl_jax.ltl.compiler.core import Core
from t2tl_jax.ltl.compiler.diagrams import Diagrams
from t2tl_jax.ltl.compiler.display import Display, Tokens
from t2tl_jax.ltl.compiler.minimise import Merged, merge, settle
from t2tl_jax.ltl.compiler.normal_form import negation_normal_form
from t2tl_jax.ltl.compiler.states import EXACT, PAPER, PROGRESSIONS, Leaves, Progression, State
from t2tl_jax.ltl.compiler.steps import Steps
from t2tl_jax.ltl.errors import LTLError, TooLargeError, nearest, no_formulas, unknown_proposition
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.parser import parse
from t2tl_jax.ltl.tokens import decode

MAX_LISTED = 2**26
"""Most entries of `Automaton.next_row`."""


def stride(rows: int) -> int:
    """What to multiply the number of a reward with before adding a row: the least power of two with room for rows."""
    return 1 << (rows - 1).bit_length()


@dataclass(frozen=True, eq=False)
class Automaton:
    """The automaton of one or more tasks; row 0 is true and row 1 is false. That of formulas is minimal.

    Attributes:
        tokens: per row, the token ids of its shortest formula; none for a state of a reward machine.
        steps: where each letter leads from every row. The outcomes are the rows; for reward machines, the row number
            `outcome % stride` with the reward `pays[outcome // stride]`.
        verdict: int8 `[rows]`, +1 true, -1 false, 0 open.
        initial_row: int32 `[tasks]`.
        letter_weights: int32 `[propositions]`, how a label vector becomes a letter; 0 for unused propositions.
        propositions: the environment's propositions, in its order.
        used: the propositions that the formulas use, in the environment's order.
        alphabet: "every_subset" or "at_most_one".
        states: per row, the name of the reward machine's state; empty when the rows are formulas.
        pays: float32 `[rewards]`, what the transitions of reward machines pay, 0 first; None for formulas.
    """

    tokens: tuple[Tokens, ...]
    steps: Steps
    verdict: np.ndarray
    initial_row: np.ndarray
    letter_weights: np.ndarray
    propositions: tuple[str, ...]
    used: tuple[str, ...]
    alphabet: str
    states: tuple[str, ...] = ()
    pays: np.ndarray | None = None

    @property
    def stride(self) -> int:
        """See `steps`."""
        return stride(len(self.verdict))

    @cached_property
    def next_row(self) -> np.ndarray:
        """The row that each letter leads to: int32 `[rows, letters]`.

        Raises:
            TooLargeError: for so many letters that a person could not want them all; see `steps`.
        """
        return self._dense % self.stride

    @cached_property
    def rewards(self) -> np.ndarray | None:
        """What each transition of reward machines pays: float32 `[rows, letters]`; None for formulas."""
        return None if self.pays is None else self.pays[self._dense // self.stride]

    @cached_property
    def _dense(self) -> np.ndarray:
        rows, letters = len(self.verdict), self.steps.num_letters
        if rows * letters > MAX_LISTED:
            raise TooLargeError(
                f"{rows:,} rows of {letters:,} letters cannot be written out; ask for single letters with follow(), or "
                "for what a row hangs on with the diagrams in steps"
            )
        return self.steps.dense()

    def every_letter(self) -> Steps:
        """`steps` among the letters of all the environment's propositions, used or not."""
        return self.steps.over([self.propositions.index(name) for name in self.used], len(self.propositions))

    def follow(self, row: int, letter: int) -> tuple[int, float]:
        """Return the row that a letter leads to, and what a reward machine pays for it, else 0."""
        kind, following = divmod(self.steps.outcome(row, letter), self.stride)
        return following, 0.0 if self.pays is None else float(self.pays[kind])

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
    limits: Limits | None = None,
    progression: str = EXACT,
) -> Automaton:
    """Compile tasks to one automaton; `compile_tasks` documents the arguments and errors."""
    if progression not in PROGRESSIONS:
        raise LTLError(
            f"unknown progression {progression!r}; known: {', '.join(PROGRESSIONS)}"
            f"{nearest(str(progression), PROGRESSIONS)}"
        )
    tasks = [formulas] if isinstance(formulas, str | Formula) or not isinstance(formulas, Iterable) else list(formulas)
    for task in tasks:
        if not isinstance(task, str | Formula):
            raise LTLError(f"tasks are formulas, as text or parsed, got {task!r:.100}")
    normal = [negation_normal_form(parse(task) if isinstance(task, str) else task) for task in tasks]
    limits = Limits() if limits is None else limits
    names, used = check_names(normal, propositions, alphabet, limits)
    budget = Budget(limits, len(tasks))
    core = Core([names[index] for index in used])
    roots = [core.add(formula) for formula in normal]

    explored = _explore(core, roots, alphabet, budget, progression == PAPER)
    merged = merge(explored.diagrams, explored.diagram_of, *settle(explored.diagrams, explored.diagram_of))
    budget.check_rows(merged.count)
    shown = _shortest_formulas(Display(core, used), roots, explored, merged.classes)
    budget.check_tokens(max(len(tokens) for tokens in shown.values()))
    row_of_class = _order_rows([merged.classes[state] for state in explored.start.values()], merged, shown)
    return Automaton(
        tokens=tuple(shown[number] for number in sorted(row_of_class, key=lambda number: row_of_class[number])),
        steps=_steps(merged, row_of_class, len(used), alphabet),
        verdict=np.array([1, -1] + [0] * (merged.count - 2), np.int8),
        initial_row=np.array([row_of_class[merged.classes[explored.start[root]]] for root in roots], np.int32),
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
    seen: set[int] = set()  # nodes whose leaves are in the queue
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
            queue.extend(diagrams.leaves(node, seen))
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


def _order_rows(starts: list[int], merged: Merged, shown: dict[int, Tokens]) -> dict[int, int]:
    """Return per class its row: true, false, then breadth first from the tasks, longer formulas first."""
    rows = {1: 0, 0: 1}
    seen = {0, 1}  # nodes whose classes are in the queue, or rows
    queue = list(starts)
    for number in queue:
        if number in rows:
            continue
        rows[number] = len(rows)
        following, stack = [], [merged.root[number]]
        while stack:
            node = stack.pop()
            if node in seen:
                continue
            seen.add(node)
            if node < merged.count:
                following.append(node)
            else:
                stack += (merged.low[node], merged.high[node])
        queue.extend(sorted(following, key=lambda other: (-len(shown[other]), shown[other])))
    return rows


def _steps(merged: Merged, row_of_class: dict[int, int], propositions: int, alphabet: str) -> Steps:
    """The diagrams of the classes with rows for outcomes."""
    node = np.arange(len(merged.variable), dtype=np.int32)
    node[list(row_of_class)] = list(row_of_class.values())
    root = np.empty(merged.count, np.int32)
    root[node[: merged.count]] = node[merged.root]
    low, high = (node[np.array(branch, np.int32)] for branch in (merged.low, merged.high))
    return Steps(np.array(merged.variable, np.int32), low, high, root, merged.count, propositions, alphabet)
