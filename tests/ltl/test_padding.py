"""Padded tables: equal shapes for any formulas, the same meaning, and nothing in the rows that are left over."""

import jax
import numpy as np
import pytest

from t2tl_jax.ltl import ZONE_PROPOSITIONS, TooLargeError, compile_tasks
from t2tl_jax.ltl.compiler.automaton import build
from t2tl_jax.ltl.padding import padded

FORMULAS = ["F(White & F Black)", "!Yellow U (Red & X White)"]


@pytest.mark.parametrize("alphabet", ["at_most_one", "every_subset"])
def test_a_padded_table_progresses_like_the_one_that_fits(alphabet):
    table = padded(build(FORMULAS, ZONE_PROPOSITIONS, alphabet), 32, 24)
    fitting = compile_tasks(FORMULAS, ZONE_PROPOSITIONS, alphabet)
    used = fitting.num_rows
    labels = np.arange(4) == np.arange(-1, 4)[:, None]
    if alphabet == "every_subset":
        labels = np.arange(16)[:, None] >> np.arange(4) & 1 > 0
    for row in range(used):
        np.testing.assert_array_equal(
            table.progress(row, table.letter(labels)), fitting.progress(row, fitting.letter(labels))
        )
        assert table.text(row) == fitting.text(row)
    np.testing.assert_array_equal(table.initial_row, fitting.initial_row)
    np.testing.assert_array_equal(table.verdict[:used], fitting.verdict)
    assert (table.verdict[used:] == -1).all() and table.text(31) == "false"
    assert (np.asarray(table.next_row) < used).all()


def test_shapes_are_equal_whatever_propositions_are_used():
    one, other = (padded(build([text], ZONE_PROPOSITIONS, "at_most_one"), 16, 16) for text in ("F Red", FORMULAS[0]))
    assert jax.tree.structure(one) == jax.tree.structure(other)
    assert jax.tree.map(lambda x: (x.shape, x.dtype), one) == jax.tree.map(lambda x: (x.shape, x.dtype), other)


@pytest.mark.parametrize("room", [(3, 24), (32, 4)])
def test_what_does_not_fit_is_refused(room):
    with pytest.raises(TooLargeError, match=r"have 4 rows of up to 5 tokens, .* room for"):
        padded(build(FORMULAS[:1], ZONE_PROPOSITIONS, "at_most_one"), *room)
