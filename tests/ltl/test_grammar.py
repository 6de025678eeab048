"""Random formulas by a grammar: what they are made of, that they are tasks, and that their shapes are many."""

import random

import pytest

from t2tl_jax.ltl import (
    Chains,
    Grammar,
    LTLError,
    Mixture,
    compile_pool,
    compile_tasks,
    is_family,
    make_sampler,
    parse,
    sample,
)
from t2tl_jax.ltl.co_safety import find_offence

NAMES = ("a", "b", "c", "d")


def drawn(family, count=300, names=NAMES):
    rng = random.Random(3)
    return [family.draw(rng, names) for _ in range(count)]


def temporal(formula):
    """How many eventuallys and untils there are, each where it stands."""
    own = formula.op in ("eventually", "until")
    return own + sum(temporal(part) for part in formula.args if not isinstance(part, str))


@pytest.mark.parametrize("operators", [(1, 1), (2, 4), (6, 6)])
def test_formulas_are_co_safe_have_as_many_operators_as_asked_for_and_can_be_read_again(operators):
    for formula in drawn(Grammar(operators)):
        assert find_offence(formula) is None
        assert operators[0] <= temporal(formula) <= operators[1]
        assert parse(str(formula)) == formula
        assert set(formula.propositions()) <= set(NAMES)


def test_every_number_of_operators_and_every_rule_of_the_grammar_comes():
    formulas = drawn(Grammar((1, 3)), 600)
    assert set(map(temporal, formulas)) == {1, 2, 3}
    assert {"eventually", "until", "and", "or"} <= {formula.op for formula in formulas}
    untils = [node for formula in formulas for node in formula.nodes() if node.op == "until"]
    assert {"not", "or"} == {until.args[0].op for until in untils}  # !state, or state -> task
    goals = [node.args[-1] for formula in formulas for node in formula.nodes() if node.op in ("eventually", "until")]
    assert {"prop", "and", "or", "until"} <= {goal.op for goal in goals}
    either = [sorted(map(temporal, goal.args)) for goal in goals if goal.op == "or"]
    assert any(least == 0 < most for least, most in either)  # state | goal, where task | task has some on both sides


def test_states_are_as_large_as_asked_for_and_no_larger_than_there_are_propositions():
    for size in (1, 2, 3):
        for formula in drawn(Grammar((1, 1), (size, size))):
            assert len(formula.args[-1].propositions()) == size
    assert max(len(formula.args[-1].propositions()) for formula in drawn(Grammar((1, 1), (1, 9)))) == len(NAMES)
    with pytest.raises(LTLError, match="at least 3 propositions, got 2"):
        make_sampler(Grammar(state=(3, 3)), ("a", "b"))


def test_nothing_is_asked_for_at_the_first_step():
    """A first step at which no proposition is true decides nothing: a robot could do nothing about that."""
    open_ones = 0
    for formula in drawn(Grammar(), 100):
        table = compile_tasks([formula], NAMES, "at_most_one")
        start = int(table.initial_row[0])
        if table.verdict[start] == 0:
            open_ones += 1
            assert table.verdict[int(table.next_row[start, 0])] == 0, str(formula)
    assert open_ones > 80


def test_a_grammar_is_a_family_like_others():
    assert is_family("grammar") and is_family(Grammar())
    assert sample("grammar", NAMES, 5) == sample(Grammar(), NAMES, 5)
    assert str(Grammar()) == "grammar"
    pool = compile_pool(Mixture((Chains(), Grammar())), NAMES, "at_most_one", 1, size=32, rows=256, length=48)
    assert pool.num_tasks == 32


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"operators": (0, 3)}, "operators is a range of at least 1, the smaller number first, got 0 to 3"),
        ({"operators": (3, 2)}, "got 3 to 2"),
        ({"operators": (1, 51)}, "operators is a range up to 50 at most, got 1 to 51"),
        ({"state": (0, 1)}, "state is a range"),
    ],
)
def test_ranges_that_cannot_be_are_refused(given, said):
    with pytest.raises(LTLError, match=said):
        Grammar(**given)
