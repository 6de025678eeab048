"""Verdicts and state counts: the recorded cases, the definition of LTL on lasso words, and exact derivatives."""

import json
import random
from pathlib import Path

import numpy as np
import pytest

from t2tl_jax.ltl import Automaton, Formula, from_tuple, parse
from t2tl_jax.ltl.compiler.automaton import build
from tests.ltl import ltl_oracles as oracle

CASES = [json.loads(line) for line in (Path(__file__).parent / "ltl_cases.jsonl").read_text().splitlines()]
NAMES = ("a", "b", "c")
VERDICT = {1: True, -1: False, 0: None}


def reachable(automaton: Automaton) -> list[int]:
    """Rows that some word leads to from task 0."""
    rows = [int(automaton.initial_row[0])]
    for row in rows:
        rows += [t for t in np.unique(automaton.next_row[row]).tolist() if t not in rows]
    return rows


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_recorded_case(case):
    automaton = build(case["formula"], case["props"])
    assert len(reachable(automaton)) == case["n_states"]
    assert len(reachable(build(case["formula"], case["props"], "at_most_one"))) == case["n_states_one_hot"]
    rows = reachable(automaton)
    assert (0 in rows, 1 in rows) == (case["has_true"], case["has_false"])
    assert VERDICT[int(automaton.verdict[rows[0]])] == case["initial"]
    for word, verdicts in zip(case["words"], case["verdicts"], strict=True):
        row, seen = automaton.initial_row[0], []
        for label in word:
            row = automaton.next_row[row, automaton.letter(label)]
            seen.append(VERDICT[int(automaton.verdict[row])])
        assert seen == verdicts
    # The recorded negation normal form is the same task.
    both = build([case["formula"], from_tuple(case["tuple"])], case["props"])
    assert both.initial_row[0] == both.initial_row[1]


def test_there_are_sixty_cases():
    assert len(CASES) == 60


def assert_rows_certified(formula: Formula, automaton: Automaton, rng: random.Random) -> None:
    """Check each reachable row against the definition: true and false rows on random continuations; open rows by one
    continuation that satisfies the formula and one that violates it, so that no verdict is late."""
    letters = oracle.letters_of(automaton.used)
    number = [automaton.letter(letter) for letter in letters]
    step = {row: [int(automaton.next_row[row, n]) for n in number] for row in reachable(automaton)}
    start = int(automaton.initial_row[0])
    queue = [start]
    path: dict[int, list[oracle.Letter]] = {start: []}
    for row in queue:
        for letter, target in zip(letters, step[row], strict=True):
            if target not in path:
                path[target] = [*path[row], letter]
                queue.append(target)
    for row in queue:
        if row in (0, 1):
            for _ in range(5):
                ending = oracle.random_letters(rng, automaton.used, 3), oracle.random_letters(rng, automaton.used, 2)
                assert oracle.holds(formula, [*path[row], *ending[0]], ending[1]) == (row == 0)
            continue
        assert oracle.holds(formula, [*path[row], *_path_to_true(row, step, letters)], [letters[0]])
        stem, loop = _lasso_without_true(row, step, letters)
        assert not oracle.holds(formula, [*path[row], *stem], loop)


def _path_to_true(row: int, step: dict[int, list[int]], letters: list[oracle.Letter]) -> list[oracle.Letter]:
    """A shortest word that leads to row 0; an open row has one."""
    path: dict[int, list[oracle.Letter]] = {row: []}
    queue = [row]
    for here in queue:
        if here == 0:
            return path[here]
        for letter, target in zip(letters, step[here], strict=True):
            if target not in path:
                path[target] = [*path[here], letter]
                queue.append(target)
    raise AssertionError(f"row {row} is open, but no word makes it true")


def _lasso_without_true(row: int, step: dict[int, list[int]], letters: list[oracle.Letter]) -> tuple[list, list]:
    """A word that stays outside row 0 for ever; a row that is not true has one."""
    # Rows from which row 0 can be avoided: the greatest set that can always step inside itself.
    avoiding = {r for r in step if r != 0}
    while True:
        smaller = {r for r in avoiding if any(t in avoiding for t in step[r])}
        if smaller == avoiding:
            break
        avoiding = smaller
    assert row in avoiding, f"row {row} is open, but every word makes it true"
    word, visited = [], [row]
    while True:
        # Take the last letter that stays inside: any will do.
        letter, target = [(x, t) for x, t in zip(letters, step[visited[-1]], strict=True) if t in avoiding][-1]
        word.append(letter)
        if target in visited:
            first = visited.index(target)
            return word[:first], word[first:]
        visited.append(target)


def assert_equals_derivatives(formula: Formula, automaton: Automaton) -> int:
    """Walk the compiled rows and the truth-table derivatives together; return the number of pairs met."""
    letters = oracle.letters_of(automaton.used)
    successors, verdicts = oracle.derivative_automaton(formula, letters)
    number = [automaton.letter(letter) for letter in letters]
    pairs = [(int(automaton.initial_row[0]), 0)]
    seen = set(pairs)
    for row, state in pairs:
        assert automaton.verdict[row] == verdicts[state]
        for n, target in zip(number, successors[state], strict=True):
            pair = (int(automaton.next_row[row, n]), target)
            if pair not in seen:
                seen.add(pair)
                pairs.append(pair)
    return len(pairs)


@pytest.mark.slow
def test_three_hundred_random_formulas_are_exact():
    """Depth up to 8: every reachable row certified by words; where truth tables are feasible, all verdicts compared."""
    rng = random.Random(2023)
    compared = 0
    for index in range(300):
        formula = oracle.random_formula(rng, NAMES[: 2 + index % 2], 1 + index % 8)
        automaton = build(formula, NAMES)
        assert_rows_certified(formula, automaton, rng)
        try:
            assert_equals_derivatives(formula, automaton)
            compared += 1
        except oracle.TooManyAtoms:
            continue
    assert compared > 150


def test_random_formulas_agree_with_ltl_on_random_lassos():
    """A lasso satisfies the formula exactly when the table reaches the true row on it."""
    rng = random.Random(5)
    for index in range(150):
        formula = oracle.random_formula(rng, NAMES, 1 + index % 6)
        automaton = build(formula, NAMES)
        for _ in range(12):
            stem, loop = (oracle.random_letters(rng, NAMES, rng.randint(k, 3)) for k in (0, 1))
            row, rounds = int(automaton.initial_row[0]), len(automaton.verdict) + 1
            for letter in [*stem, *(loop * rounds)]:
                row = int(automaton.next_row[row, automaton.letter(letter)])
            assert oracle.holds(formula, stem, loop) == (row == 0), (formula, stem, loop)


def test_every_row_shows_a_formula_equal_to_the_row():
    """Compiling what a row shows gives the row again, and progression of the text agrees with the table."""
    rng = random.Random(8)
    for index in range(60):
        formula = oracle.random_formula(rng, NAMES, 1 + index % 6)
        automaton = build(formula, NAMES)
        shown = [automaton.formula(row) for row in range(len(automaton.verdict))]
        again = build([formula, *shown], NAMES)
        assert len(set(again.initial_row[1:].tolist())) == len(shown)
        assert again.initial_row[0] == again.initial_row[1 + int(automaton.initial_row[0])]
        assert [again.formula(row) for row in again.initial_row[1:]] == shown


def test_minimal_rows_match_a_naive_partition():
    rng = random.Random(13)
    for _ in range(60):
        formula = oracle.random_formula(rng, NAMES[:2], 4)
        automaton = build(formula, NAMES)
        try:
            successors, verdicts = oracle.derivative_automaton(formula, oracle.letters_of(automaton.used))
        except oracle.TooManyAtoms:
            continue
        block = list(verdicts)
        while True:
            keys = [(b, *(block[t] for t in row)) if b == 0 or b > 1 else (b,) for b, row in zip(block, successors)]  # noqa: B905
            names = {key: index + 2 for index, key in enumerate(dict.fromkeys(keys))}
            new = [key[0] if key in ((1,), (-1,)) else names[key] for key in keys]
            if len(set(new)) == len(set(block)):
                break
            block = new
        assert len(reachable(automaton)) == len(set(block))


@pytest.mark.parametrize("mutation", ["verdict", "next_row"])
def test_the_oracles_notice_a_wrong_table(mutation):
    """The checks above can fail: one changed entry is found."""
    formula = parse("!a U (b & X F c)")
    automaton = build(formula, NAMES)
    row = int(automaton.initial_row[0])
    if mutation == "verdict":
        automaton.verdict[row] = -1
    else:
        automaton.next_row[row, automaton.letter({"a"})] = row
    with pytest.raises(AssertionError):
        assert_equals_derivatives(formula, automaton)
