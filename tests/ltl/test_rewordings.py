"""The same task in other words: what compiles to the same text, and what to another text of the same meaning."""

import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks, resolve_tasks, row_languages
from t2tl_jax.ltl.benchmark_tasks import COLOURS

SAME_TEXT = {
    "z1": "!(!(F(Green & (!Blue U Yellow))) | !(F Magenta))",
    "z2": "F Blue & (!Blue U (Green & F Yellow)) & (F Blue | F(Blue & Green))",
    "z3": "(F Blue | F Green) & F F Yellow & F Magenta & F(Blue | Green | Yellow)",
    "z4": "(!Magenta & !!!Yellow) U (Blue & F F Green)",
    "z5": "!Green U ((Blue | Magenta | Blue) & (!Green U Yellow))",
    "z6": "((!Green & !Blue) | (!Yellow U Magenta)) U Yellow",
}
"""A thing that is said twice, or negated twice, or that follows from the rest."""

OTHER_TEXT = {
    "z1": "F Magenta & F(Green & (!Blue U Yellow))",
    "z2": "(!Blue U (Green & F Yellow)) & F Blue",
    "z3": "F Magenta & F Yellow & F(Green | Blue)",
    "z4": "!(Yellow | Magenta) U (F Green & Blue)",
    "z5": "!Green U ((Blue & (!Green U Yellow)) | (Magenta & (!Green U Yellow)))",
    "z6": "(!(Blue | Green) | (!Yellow U Magenta)) U Yellow",
}
"""Operands that change places, and what is multiplied out."""


def compiled(text):
    """The table of a task in the open ZoneEnv."""
    return compile_tasks([text], COLOURS, "at_most_one")


def meaning(text):
    """Languages of all rows of a task."""
    (formula,) = resolve_tasks([text]).values()
    return row_languages([formula], COLOURS, "at_most_one")


@pytest.mark.parametrize(
    ("task", "reworded"), [*SAME_TEXT.items(), ("F(Blue & F Green)", "F Blue & F(Blue & F Green)")]
)
def test_redundant_words_compile_to_the_same_tokens(task, reworded):
    (formula,) = resolve_tasks([task]).values()
    plain, other = compiled(str(formula)), compiled(reworded)
    np.testing.assert_array_equal(plain.tokens, other.tokens)
    np.testing.assert_array_equal(plain.next_row, other.next_row)
    np.testing.assert_array_equal(plain.initial_row, other.initial_row)


@pytest.mark.parametrize(("task", "reworded"), OTHER_TEXT.items())
def test_operands_in_another_order_are_another_text_of_the_same_meaning(task, reworded):
    """So a code that reads text may read them otherwise."""
    (formula,) = resolve_tasks([task]).values()
    plain, other = compiled(str(formula)), compiled(reworded)
    first, second = (table.text(int(table.initial_row[0])) for table in (plain, other))
    assert first != second and meaning(str(formula)) == meaning(reworded)
