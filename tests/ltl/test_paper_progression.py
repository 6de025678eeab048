"""The last case of the paper's definition 2, which drops a satisfied proposition: what changes and what breaks."""

import numpy as np
import pytest

from t2tl_jax.ltl import (
    PAPER_TASKS,
    WATER_PROPOSITIONS,
    ZONE_PROPOSITIONS,
    LTLError,
    compile_named,
    compile_tasks,
    named_task,
    progress,
)
from tests.ltl.ltl_oracles import holds

WORD = [frozenset({name}) for name in ("Black", "Yellow", "Black", "White")]


def verdicts(table, word):
    row, found = int(table.initial_row[0]), []
    for label in word:
        row = int(table.next_row[row, int(table.letter(np.array([name in label for name in table.propositions])))])
        found.append(int(table.verdict[row]))
    return found


@pytest.mark.parametrize("alphabet", ["at_most_one", "every_subset"])
def test_a_satisfied_proposition_is_dropped_with_its_until(alphabet):
    """Of the 9 tokens of `phi_zone_prime` 4 are left; the usual rules keep the whole task as a second chance."""
    tables = [compile_named("phi_zone_prime", ZONE_PROPOSITIONS, alphabet, progression=p) for p in ("exact", "paper")]
    assert [np.asarray(table.mask).sum(axis=1).tolist() for table in tables] == [[1, 1, 9, 14, 4], [1, 1, 9, 4]]
    assert tables[1].text(3) == "!Yellow U White"
    rest = [str(progress(named_task("phi_zone_prime"), {"Black"}, p)) for p in ("exact", "paper")]
    assert rest == [tables[0].text(3), tables[1].text(3)]


def test_it_contradicts_theorem_1():
    """Theorem 1: a word satisfies a formula exactly when what follows satisfies the progressed one. This word does."""
    task = named_task("phi_zone_prime")
    assert holds(task, WORD, [frozenset()])
    assert holds(progress(task, WORD[0]), WORD[1:], [frozenset()])
    assert not holds(progress(task, WORD[0], "paper"), WORD[1:], [frozenset()])
    exact, paper = (
        compile_named("phi_zone_prime", ZONE_PROPOSITIONS, "at_most_one", progression=p) for p in ("exact", "paper")
    )
    assert verdicts(exact, WORD) == [0, 0, 0, 1]
    assert verdicts(paper, WORD) == [0, -1, -1, -1]


@pytest.mark.parametrize("name", [name for name in PAPER_TASKS if name != "phi_zone_prime"])
def test_tasks_with_one_guard_for_all_goals_stay_as_they_are(name):
    names = WATER_PROPOSITIONS if "water" in name else ZONE_PROPOSITIONS
    exact, paper = (compile_named(name, names, progression=p) for p in ("exact", "paper"))
    np.testing.assert_array_equal(exact.tokens, paper.tokens)
    np.testing.assert_array_equal(exact.next_row, paper.next_row)


@pytest.mark.parametrize(
    ("formula", "label", "rest"),
    [
        ("F(a & F b)", {"a"}, "F b"),
        ("!c U (a & X b)", {"a"}, "b"),  # the usual rule: b | !c U (a & X b)
        ("!c U (a & X b)", {"c", "a"}, "b"),
        ("!c U (a & b)", {"a"}, "!c U (a & b)"),  # a alone leaves nothing: not both at once
        ("!c U X b", set(), "b | !c U X b"),  # nothing was satisfied yet
        ("!c U (!d & X b)", set(), "b | !c U (!d & X b)"),  # nor by a negation
        ("F(a & X b) & F d", {"a"}, "b & F d"),
    ],
)
def test_what_is_dropped(formula, label, rest):
    names = ("a", "b", "c", "d")
    table = compile_tasks([formula, rest], names, progression="paper")
    letter = int(table.letter(np.array([name in label for name in names])))
    assert int(table.next_row[int(table.initial_row[0]), letter]) == int(table.initial_row[1])


def test_unknown_rules_are_refused():
    with pytest.raises(LTLError, match=r"unknown progression 'papr'; known: exact, paper.*paper"):
        compile_tasks("F a", ("a",), progression="papr")
    with pytest.raises(LTLError, match="unknown progression"):
        progress(named_task("phi_zone"), set(), "printed")
    with pytest.raises(LTLError, match="rm_t1 is a reward machine; leave it at exact"):
        compile_named("rm_t1", tuple("abcdef"), progression="paper")
