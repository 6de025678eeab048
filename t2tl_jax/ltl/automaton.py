"""From formulas to a finite automaton in plain NumPy: closure under progression, exact verdicts, minimisation."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from t2tl_jax.ltl.budget import MAX_CELLS, MAX_PROPOSITIONS, MAX_ROWS, Budget
from t2tl_jax.ltl.core import Core
from t2tl_jax.ltl.diagrams import ALPHABETS, AT_MOST_ONE, EVERY_SUBSET, Diagrams
from t2tl_jax.ltl.display import Display, Tokens
from t2tl_jax.ltl.errors import LTLError, TooLargeError, UnknownPropositionError, nearest
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.minimise import merge, settle
from t2tl_jax.ltl.normal_form import negation_normal_form
from t2tl_jax.ltl.parser import parse
from t2tl_jax.ltl.states import Leaves, Progression
from t2tl_jax.ltl.tokens import decode


@dataclass(frozen=True)
class Automaton:
    """The minimal automaton of one or more tasks; row 0 is true and row 1 is false.

    Attributes:
        tokens: per row, the token ids of its shortest formula.
        next_row: int32 `[rows, letters]`, the row that each letter leads to.
        verdict: int8 `[rows]`, +1 true, -1 false, 0 open.
        initial_row: int32 `[tasks]`.
        letter_weights: int32 `[propositions]`, how a label vector becomes a letter; 0 for unused propositions.
        propositions: the environment's propositions, in its order.
        used: the propositions that the formulas use, in the environment's order.
        alphabet: "every_subset" or "at_most_one".
    """

    tokens: tuple[Tokens, ...]
    next_row: np.ndarray
    verdict: np.ndarray
    initial_row: np.ndarray
    letter_weights: np.ndarray
    propositions: tuple[str, ...]
    used: tuple[str, ...]
    alphabet: str

    def formula(self, row: int) -> Formula:
        """Return the formula that a row shows."""
        return decode(self.tokens[row], self.propositions)

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
) -> Automaton:
    """Compile tasks to one automaton; `compile_tasks` documents the arguments and errors."""
    tasks = [formulas] if isinstance(formulas, str | Formula) else list(formulas)
    normal = [negation_normal_form(parse(task) if isinstance(task, str) else task) for task in tasks]
    names, used = _check(normal, propositions, alphabet)
    core = Core([names[index] for index in used])
    budget = Budget(max_rows=max_rows)
    leaves = Leaves(diagrams := Diagrams(alphabet))

    # EXPLORE: each task with its own atoms, all in the same diagrams.
    diagram_of: dict[int, int] = {0: 0, 1: 1}
    owner: dict[int, Progression] = {}
    roots: list[tuple[int, int]] = []
    started: dict[int, int] = {}
    for formula in normal:
        number = core.add(formula)
        if number not in started:
            progression = Progression(core, number, leaves, budget)
            started[number] = progression.leaf_of(progression.root)
            _explore(progression, started[number], diagram_of, owner, leaves, budget)
        roots.append((number, started[number]))

    # MERGE: verdicts, then classes of states that no word tells apart.
    good, bad = settle({state: diagrams.leaves(node) for state, node in diagram_of.items()})
    classes = merge(diagrams, diagram_of, good, bad)
    representative: dict[int, int] = {}
    for state in diagram_of:
        representative.setdefault(classes[state], state)
    count = max(2, len(representative) + (0 not in representative) + (1 not in representative))
    budget.check_rows(count)

    # SHOW: the shortest member of each class.
    display = Display(core, used)
    shown: list[Tokens] = [display.tokens(1), display.tokens(0)] + [()] * (count - 2)
    candidates = [(classes[state], display.shortest(owner[state], leaves.state_of[state])) for state in owner]
    candidates += [(classes[state], number) for number, state in roots]
    for number_of_class, number in candidates:
        if number_of_class > 1:
            tokens = display.tokens(number)
            old = shown[number_of_class]
            if not old or (len(tokens), tokens) < (len(old), old):
                shown[number_of_class] = tokens

    # WRITE: class 0 (false) is row 1, class 1 (true) is row 0.
    letters = len(used) + 1 if alphabet == AT_MOST_ONE else 2 ** len(used)
    if letters * count > MAX_CELLS:
        hint = "" if alphabet == AT_MOST_ONE else f'; the alphabet "{AT_MOST_ONE}" needs {len(used) + 1} letters only'
        raise TooLargeError(
            f"{count:,} rows of {letters:,} letters ({len(used)} propositions used) are more than "
            f"{MAX_CELLS:,} entries (budget.MAX_CELLS){hint}"
        )
    row_of_leaf = np.zeros(len(diagrams.variable), np.int32)
    for state, number_of_class in classes.items():
        row_of_leaf[state] = _row(number_of_class)
    by_row = [0] * count
    for number_of_class, state in representative.items():
        by_row[_row(number_of_class)] = diagram_of[state]
    by_row[0], by_row[1] = 1, 0
    row_of_leaf[1], row_of_leaf[0] = 0, 1
    verdict = np.zeros(count, np.int8)
    verdict[0], verdict[1] = 1, -1
    weights = np.zeros(len(names), np.int32)
    weights[used] = [j + 1 if alphabet == AT_MOST_ONE else 2**j for j in range(len(used))]
    return Automaton(
        tokens=tuple(shown),
        next_row=row_of_leaf[diagrams.table(by_row, len(used))],
        verdict=verdict,
        initial_row=np.array([_row(classes[state]) for _, state in roots], np.int32),
        letter_weights=weights,
        propositions=names,
        used=tuple(names[index] for index in used),
        alphabet=alphabet,
    )


def _explore(
    progression: Progression,
    start: int,
    diagram_of: dict[int, int],
    owner: dict[int, Progression],
    leaves: Leaves,
    budget: Budget,
) -> None:
    """Add every state that progression reaches from `start`, breadth first."""
    queue = [start]
    for state in queue:
        if state in diagram_of:
            continue
        owner[state] = progression
        diagram_of[state] = progression.successors(leaves.state_of[state])
        queue.extend(sorted(leaves.diagrams.leaves(diagram_of[state]) - diagram_of.keys()))
        budget.check_states(len(diagram_of))


def _row(number_of_class: int) -> int:
    return (1, 0)[number_of_class] if number_of_class < 2 else number_of_class


def _check(formulas: list[Formula], propositions: Sequence[str], alphabet: str) -> tuple[tuple[str, ...], list[int]]:
    """Check names and alphabet; return the environment's propositions and the indices of those used."""
    if isinstance(propositions, str):
        raise LTLError(f"propositions is a sequence of names, got the string {propositions!r}")
    names = tuple(propositions)
    if len(set(names)) < len(names):
        raise LTLError(f"the environment names a proposition twice: {', '.join(names)}")
    if alphabet not in ALPHABETS:
        raise LTLError(
            f"unknown alphabet {alphabet!r}; known: {', '.join(ALPHABETS)}{nearest(str(alphabet), ALPHABETS)}"
        )
    if not formulas:
        raise LTLError("a table needs at least one task, got none")
    mentioned = dict.fromkeys(name for formula in formulas for name in formula.propositions())
    for name in mentioned:
        if name not in names:
            raise unknown_proposition(name, names)
    if len(mentioned) > MAX_PROPOSITIONS or (alphabet == EVERY_SUBSET and 2 ** len(mentioned) > MAX_CELLS // 3):
        raise TooLargeError(
            f"the tasks use {len(mentioned)} propositions; the limit is {MAX_PROPOSITIONS} (budget.MAX_PROPOSITIONS), and "
            f'with "{EVERY_SUBSET}" each doubles the letters (budget.MAX_CELLS): where the environment makes at most one '
            f'true at a time, use the alphabet "{AT_MOST_ONE}"'
        )
    return names, [index for index, name in enumerate(names) if name in mentioned]


def unknown_proposition(name: str, known: Sequence[str]) -> UnknownPropositionError:
    """Return the error for a proposition that is not among the known ones."""
    listed = ", ".join(known) if known else "none"
    return UnknownPropositionError(f'unknown proposition "{name}"; known: {listed}{nearest(name, known)}')
