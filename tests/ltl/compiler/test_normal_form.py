"""Negation normal form: its shape, and that it means the same."""

import random

import pytest

from t2tl_jax.ltl import negation_normal_form, parse
from tests.ltl import ltl_oracles as oracle


@pytest.mark.parametrize(
    ("text", "normal"),
    [
        ("!(G a)", "F !a"),
        ("!(X a)", "X !a"),
        ("!!(F a)", "F a"),
        ("a -> F b", "!a | F b"),
        ("!(a R b)", "!a U !b"),
        ("!(a W b)", "!b U (!a & !b)"),
        ("a M b", "b U (a & b)"),
        ("X a <-> b", "(X a & b) | (X !a & !b)"),
    ],
)
def test_negation_normal_form(text, normal):
    assert negation_normal_form(parse(text)) == parse(normal)


def test_negation_normal_form_keeps_the_meaning():
    rng = random.Random(3)
    for text in ["!(a W b)", "!(G(a -> b))", "a M (b M !a)", "!(a R (b W a))", "(X a <-> b) U (a <-> !b)"]:
        formula = parse(text)
        for _ in range(50):
            stem, loop = (oracle.random_letters(rng, ("a", "b"), n) for n in (2, 2))
            assert oracle.holds(formula, stem, loop) == oracle.holds(negation_normal_form(formula), stem, loop)
