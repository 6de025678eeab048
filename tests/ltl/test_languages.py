"""Equal languages, however a formula is written and whatever else stands in its table."""

import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.ltl.languages import languages

PROPOSITIONS = ("a", "b", "c")


def of_tasks(*formulas, alphabet="at_most_one"):
    """The language of each formula, all of them in one table in which every proposition has its letter."""
    table = compile_tasks([*formulas, "F(a & F(b & F c))"], PROPOSITIONS, alphabet)
    return languages(np.asarray(table.next_row), np.asarray(table.verdict), np.asarray(table.initial_row))[:-1]


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        ("F(a & F b)", "F(F b & a)", True),
        ("F a", "true U a", True),
        ("F(a | b)", "F a | F b", True),
        ("F(a & F b)", "F(b & F a)", False),
        ("F a", "F b", False),
        ("!b U a", "F a", False),
        ("F a & F b", "F(a & F b) | F(b & F a)", True),
    ],
)
def test_languages_are_equal_exactly_if_meanings_are(one, other, equal):
    (first,), (second,) = of_tasks(one), of_tasks(other)  # in two tables
    assert (first == second) == equal
    assert (len(set(of_tasks(one, other))) == 1) == equal  # in one


def test_the_alphabet_counts():
    """Where a and b never hold together, nothing satisfies F(a & b)."""
    impossible, false = of_tasks("F(a & b)", "false")
    assert impossible == false
    possible, false = of_tasks("F(a & b)", "false", alphabet="every_subset")
    assert possible != false


def test_rows_that_mean_the_same_count_once():
    """As in a pool, where a row keeps the words of the formula that brought it."""
    next_row = np.array([[0, 0], [1, 1], [0, 3], [0, 2], [0, 4]])
    verdict = np.array([1, -1, 0, 0, 0])
    assert len(set(languages(next_row, verdict, [2, 3, 4]))) == 1
