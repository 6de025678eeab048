"""Text, trees and tuples, and what malformed or unsuitable formulas are told."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from t2tl_jax.ltl import (
    Formula,
    LTLError,
    LTLSyntaxError,
    NotCoSafeError,
    TooLargeError,
    from_tuple,
    negation_normal_form,
    parse,
    prop,
)
from t2tl_jax.ltl.formula import ARITY

NAMES = st.sampled_from(["a", "Red_Zone", "Gray", "Fa", "F", "until", "light on", 'say "hi"', "back\\slash", "X1", "é"])
BINARY = [op for op, arity in ARITY.items() if arity == 2]
UNARY = [op for op, arity in ARITY.items() if arity == 1]
ANY_FORMULA = st.recursive(
    st.builds(prop, NAMES) | st.sampled_from([Formula("True"), Formula("False")]),
    lambda inner: (
        st.builds(lambda op, x: Formula(op, (x,)), st.sampled_from(UNARY), inner)
        | st.builds(lambda op, x, y: Formula(op, (x, y)), st.sampled_from(BINARY), inner, inner)
    ),
    max_leaves=12,
)

MALFORMED = ["", "a U", "U a", "(a & b", "a & b)", "a b", "F", "a && & b", "a | | b", "()", "a ! b", "a @ b", "!"]
NOT_CO_SAFE = [
    "G a", "!(F a)", "a U (G b)", "!(a U b)", "(F a) -> b", "a R b", "a W b", "F(G a)", "G(F a)", "F a & G b", "X(G a)",
    "(a U b) <-> c", "!(F(a & F b))", "a -> G b", "(G a) U b", "!(a M b)", "F(a -> G b)",
]  # fmt: skip


@given(ANY_FORMULA)
def test_text_parses_back_to_an_equal_formula(formula):
    again = parse(str(formula), co_safe=False)
    assert again == formula and hash(again) == hash(formula) and again.size == formula.size


@given(ANY_FORMULA)
def test_tuples_round_trip(formula):
    assert from_tuple(formula.to_tuple()) == formula


@given(st.text(alphabet='ab()!&|-><XFGU "\\1\n', max_size=30))
def test_any_text_is_parsed_or_refused_cleanly(text):
    try:
        assert parse(str(parse(text))) == parse(text)
    except LTLError as error:
        assert str(error)


@pytest.mark.parametrize(
    ("text", "full"),
    [
        ("a | b U c & d", "a | ((b U c) & d)"),
        ("a U b U c", "a U (b U c)"),
        ("a U b M c U d", "a U (b M (c U d))"),
        ("a -> b -> c", "a -> (b -> c)"),
        ("a <-> b -> c | d", "a <-> (b -> (c | d))"),
        ("!a U X b", "(!a) U (X b)"),
        ("not a until eventually b and next c", "((!a) U (F b)) & (X c)"),
        ("a && b || c", "(a & b) | c"),
        ("a /\\ b \\/ ~c => d <=> e", "(((a & b) | !c) -> d) <-> e"),
        ("<>a", "F a"),
        ("Gray & Green & Foo & Fa_b & X1", '(("Gray" & "Green") & "Foo") & "Fa_b" & "X1"'),
        ("true U a | False", "(true U a) | false"),
        ("F\n\ta", "F a"),
    ],
)
def test_precedence_and_spellings(text, full):
    assert parse(text) == parse(full, co_safe=False)


def test_reserved_words_need_quotes():
    assert parse('F "F"').propositions() == ("F",)
    assert str(parse('F "F"')) == 'F "F"'


def test_formulas_are_immutable():
    with pytest.raises(AttributeError):
        parse("a").name = "b"


@pytest.mark.parametrize("text", MALFORMED)
def test_malformed_text_shows_a_caret_and_what_was_expected(text):
    with pytest.raises(LTLSyntaxError) as caught:
        parse(text)
    lines = str(caught.value).splitlines()
    assert lines[2].strip() == "^" and lines[3].startswith("expected ")
    assert lines[1][2:] == text


@pytest.mark.parametrize(
    ("text", "column"), [("a U", 3), ("(a & b", 0), ("a & b)", 5), ("a b", 2), ("a && & b", 5), ("a @ b", 2), ("()", 1)]
)
def test_the_caret_stands_under_the_place(text, column):
    with pytest.raises(LTLSyntaxError) as caught:
        parse(text)
    assert caught.value.position == column
    assert str(caught.value).splitlines()[2].index("^") == 2 + column


def test_only_the_faulty_line_is_shown():
    with pytest.raises(LTLSyntaxError) as caught:
        parse("F a &\n  b b\n & c")
    assert str(caught.value).splitlines()[1:3] == ["    b b", "      ^"]


@pytest.mark.parametrize("text", NOT_CO_SAFE)
def test_not_co_safe_names_the_subformula(text):
    with pytest.raises(NotCoSafeError, match="not co-safe: `") as caught:
        parse(text)
    assert str(caught.value).splitlines()[-1].strip() == "^"
    with pytest.raises(NotCoSafeError):
        negation_normal_form(parse(text, co_safe=False))


def test_not_co_safe_says_why():
    with pytest.raises(NotCoSafeError, match=r"`F b` in .*odd number of negations.*F becomes G"):
        parse("a & !(b | F b)")
    with pytest.raises(NotCoSafeError, match=r"`G b` in .*even number of negations.*infinite word"):
        parse("F(a -> G b)")


@pytest.mark.parametrize(
    "text",
    ["(" * 100_000, "!" * 100_000 + "a", "X " * 5_000 + "a", "(" * 100_000 + "a" + ")" * 100_000, "a & " * 20_000 + "a",
     " <-> ".join("abcdefghijkl" * 3), "a U " * 100_000 + "a"],
)  # fmt: skip
@pytest.mark.slow
def test_huge_formulas_are_refused(text):
    with pytest.raises(TooLargeError, match=r"MAX_(SIZE|DEPTH)"):
        negation_normal_form(parse(text))


@pytest.mark.parametrize(
    "value",
    [("until", "a"), ("xor", "a", "b"), (), 3, ("prop",), "", ("not", None), [["a"]]],
)
def test_bad_tuples_are_refused(value):
    with pytest.raises(LTLError):
        from_tuple(value)


def test_deep_tuples_are_refused():
    value = "a"
    for _ in range(5_000):
        value = ("next", value)
    with pytest.raises(TooLargeError):
        from_tuple(value)
