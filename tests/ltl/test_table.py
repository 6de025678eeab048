"""The task table: contents, rewriting identities, limits, and life inside jit."""

import contextlib
import random
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import (
    PAPER_TASKS,
    WATER_PROPOSITIONS,
    ZONE_PROPOSITIONS,
    LTLError,
    TooLargeError,
    UnknownPropositionError,
    UnknownTaskError,
    compile_tasks,
    named_task,
    parse,
    progress,
    resolve_task,
    sample,
)

AB = ("a", "b", "c")
IDENTITIES = """
X true = true; X false = false; F true = true; F false = false; a U true = true; a U false = false; false U a = a
true U a = F a; F F a = F a; a U a = a; a U (a U b) = a U b; (a U b) U b = a U b; F(a U b) = F b; a U F b = F b
X a & X b = X(a & b); X a | X b = X(a | b); (X a) U (X b) = X(a U b); F X a = X F a
F a | F b = F(a | b); (a U c) & (b U c) = (a & b) U c; (a U b) | (a U c) = a U (b | c)
b & (a U b) = b; b | (a U b) = a U b; (a U b) & F b = a U b; (a U b) | F b = F b; a & F a = a; a | F a = F a
a | X F a = F a; F a & X F a = X F a; b | (a & X(a U b)) = a U b; b & (a | X(a M b)) = a M b
F(a & F a) = F a; F(a & F b) & F b = F(a & F b); F(a & F b) | F b = F b; F(a & b) & F a = F(a & b)
(a | b) U b = a U b; !a U a = F a; a U (b & (a U b)) = a U b; a U (a & b) = b M a; a U (b | !a) = F(b | !a)
F a | !a = true; X a & X !a = false; (!b U (a & !b)) & (!a U (b & !a)) = false
(a & !b) U b = a U b; a | (a U b) = a | b; a U (b | (a U c)) = a U (b | c); (!a U b) | (!b U a) = F(a | b)
(a U (b & (a U c))) | (a U c) = a U c; !(a R b) = !a U !b; !(X a) = X !a; a M b = b U (a & b)
"""
PAIRS = [pair.strip() for line in IDENTITIES.strip().splitlines() for pair in line.split(";")]


@pytest.mark.parametrize("pair", PAIRS)
def test_both_sides_of_an_identity_are_one_row(pair):
    left, right = pair.split(" = ")
    table = compile_tasks([left, right], AB)
    assert table.initial_row[0] == table.initial_row[1]
    alone = [compile_tasks(side, AB) for side in (left, right)]
    lengths = [int(t.mask[t.initial_row[0]].sum()) for t in (*alone, table)]
    assert len(set(lengths)) == 1, "each side alone is shown as short as both together"


def test_different_tasks_are_different_rows():
    table = compile_tasks(["F a", "F b", "a U b", "X a", "true", "F a & !(G a)"], AB)
    assert len(set(table.initial_row.tolist())) == 6


def test_water_task_diminishes():
    table = compile_tasks(named_task("phi_water"), WATER_PROPOSITIONS)
    lengths = np.asarray(table.mask).sum(-1).tolist()
    assert lengths[2:] == [54, 43, 32, 21, 10] and lengths[:2] == [1, 1]
    row = table.initial_row[0]
    for goal, left in zip(WATER_PROPOSITIONS[:5], [43, 32, 21, 10, 1], strict=True):
        row = table.progress(row, table.letter(jnp.array([name == goal for name in WATER_PROPOSITIONS])))
        assert lengths[int(row)] == left
    assert row == 0 and table.reward(row) == 1


def test_contents():
    table = compile_tasks("F(Red & F Black)", ZONE_PROPOSITIONS, length=9)
    assert table.tokens.dtype == table.next_row.dtype == table.initial_row.dtype == jnp.int32
    assert table.mask.dtype == bool and table.verdict.dtype == jnp.int8 and table.letter_weights.dtype == jnp.int32
    assert table.tokens.shape == table.mask.shape == (4, 9)
    assert table.tokens[:2].tolist() == [[8] + [0] * 8, [9] + [0] * 8]
    assert table.tokens[2].tolist() == [5, 3, 12, 5, 10, 0, 0, 0, 0]
    assert table.mask.tolist() == (table.tokens != 0).tolist()
    assert table.letter_weights.tolist() == [1, 0, 2, 0]
    assert table.verdict.tolist() == [1, -1, 0, 0]
    assert table.next_row[:2].tolist() == [[0] * 4, [1] * 4]
    assert (table.num_rows, table.num_tasks, table.num_letters, table.vocabulary_size) == (4, 1, 4, 22)
    assert table.formula(2) == parse("F(Red & F Black)")
    assert "row 2 [open]   <- task 0" in table.describe()
    assert compile_tasks("F p12", [f"p{i}" for i in range(20)]).vocabulary_size == 30


def test_rows_are_shared_and_order_of_tasks_does_not_change_what_they_show():
    table = compile_tasks(["F(a & F b)", "F b", "F b"], AB)
    assert table.num_rows == 4
    assert table.initial_row[1] == table.initial_row[2]
    tasks = [sample("Eventually_1_3_1_2", "abcde", seed) for seed in range(6)]
    forward, backward = compile_tasks(tasks, tuple("abcde")), compile_tasks(tasks[::-1], tuple("abcde"))
    assert {str(forward.formula(r)) for r in range(forward.num_rows)} == {
        str(backward.formula(r)) for r in range(backward.num_rows)
    }


def test_progress_rules():
    assert progress(parse("X a"), set()) == parse("a")
    assert progress(parse("X X a"), {"a"}) == parse("X a")
    assert progress(parse("F(a & F b)"), {"a"}) == parse("F b")
    assert progress(parse("a U b"), {"a"}) == parse("a U b")
    assert progress(parse("a U b"), {"b", "other"}) == parse("true")
    assert progress(parse("a U b"), ()) == parse("false")
    assert progress(parse("!(G a)"), {"a"}) == parse("F !a")
    assert progress(parse("a M b"), {"b"}) == parse("b U (a & b)")


def test_progress_agrees_with_the_table():
    rng = random.Random(1)
    for seed in range(20):
        formula = sample("Eventually_1_3_1_2", "abcd", seed)
        table = compile_tasks(formula, tuple("abcd")).automaton()
        row = int(table.initial_row[0])
        for _ in range(6):
            label = {name for name in "abcd" if rng.random() < 0.4}
            formula, row = progress(formula, label), int(table.next_row[row, table.letter(label)])
            both = compile_tasks([formula, table.formula(row)], tuple("abcd"))
            assert both.initial_row[0] == both.initial_row[1]


@pytest.mark.slow
def test_at_most_one_alphabet_agrees_on_its_letters():
    for name, text in PAPER_TASKS.items():
        names = WATER_PROPOSITIONS if "water" in name else ZONE_PROPOSITIONS
        full, single = compile_tasks(text, names), compile_tasks(text, names, "at_most_one")
        rows = [int(table.initial_row[0]) for table in (full, single)]
        labels = jnp.arange(len(names)) == np.random.default_rng(0).integers(-1, len(names), (60, 1))
        after = [np.asarray(table.next_row) for table in (full, single)]
        for letters in zip(*(table.letter(labels).tolist() for table in (full, single)), strict=True):
            rows = [table[row, letter] for table, row, letter in zip(after, rows, letters, strict=True)]
            assert full.formula(int(rows[0])) == single.formula(int(rows[1]))


def test_two_true_propositions_where_at_most_one_is_expected():
    table = compile_tasks("F a & F c", AB, "at_most_one")
    assert table.num_letters == 3
    assert table.letter(jnp.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 0]], bool)).tolist() == [0, 1, 2, 0]


# ----- errors -----


def test_unknown_proposition_lists_the_known_and_the_nearest():
    with pytest.raises(UnknownPropositionError, match=r'"Yelow"; known: Black, White, Red, Yellow; .* "Yellow"\?'):
        compile_tasks("F Yelow", ZONE_PROPOSITIONS)


def test_limits_say_what_was_reached_and_which_to_raise():
    with pytest.raises(TooLargeError, match=r"needs 17 rows; the limit is max_rows=16: raise it"):
        compile_tasks("F a & F b & F c & F d", tuple("abcd"), max_rows=16)
    with pytest.raises(TooLargeError, match=r"reached \d+ distinct formulas .* raise max_rows"):
        compile_tasks("F(a & X X X X X X X X b)", AB, max_rows=10)
    with pytest.raises(TooLargeError, match=r"at_most_one"):
        compile_tasks(" & ".join(f"F p{i}" for i in range(40)), [f"p{i}" for i in range(40)])
    with pytest.raises(TooLargeError, match=r"longest row has 5 tokens .* length=4"):
        compile_tasks("F(a & F b)", AB, length=4)


@pytest.mark.parametrize(
    "arguments", [("F a", "abc"), ([], AB), ("F a", ("a", "a")), ("F a", AB, "at_most_two")], ids=str
)
def test_bad_arguments_are_refused(arguments):
    with pytest.raises(LTLError):
        compile_tasks(*arguments)


@pytest.mark.parametrize(
    "text",
    [
        "X " * 199 + "a",
        "F(" * 99 + "a" + " & X b)" * 99,
        "(" * 99 + "a" + " U b) | X c" * 99,
        " U X ".join("abc" * 33),
        "!(" + " R ".join("abc" * 30) + ")",
    ],
    ids=range(5),
)
def test_deep_formulas_end_in_a_table_or_a_clean_error(text):
    with contextlib.suppress(TooLargeError):
        assert compile_tasks(text, AB).num_rows >= 2


# ----- tasks by name -----


def test_paper_tasks():
    assert str(named_task("phi_zone")) == "F(Red & F(Black & F Yellow))"
    assert named_task("phi_water") == named_task("phi_water_5_3")
    assert "phi_water_6_3" not in PAPER_TASKS and "phi_water_4_1" in PAPER_TASKS
    for name in PAPER_TASKS:
        names = WATER_PROPOSITIONS if "water" in name else ZONE_PROPOSITIONS
        assert set(named_task(name).propositions()) <= set(names)
    assert resolve_task(" phi_safe ") == named_task("phi_safe") and resolve_task("F a") == parse("F a")
    for wrong in (named_task, resolve_task):
        with pytest.raises(UnknownTaskError, match=r'did you mean "phi_zone"\?'):
            wrong("phi_zome")


# ----- inside jit -----


@pytest.fixture
def table():
    return compile_tasks(["!a U (b & F c)", "F(a & X b)"], AB)


def walk(table, labels):
    def step(row, label):
        row = table.progress(row, table.letter(label))
        return row, table.reward(row)

    return jax.lax.scan(step, table.initial_row[0], labels)


def test_jit_vmap_and_scan_agree_with_plain_calls(table):
    labels = jax.random.bernoulli(jax.random.key(0), 0.4, (16, 10, 3))
    rows, rewards = jax.jit(jax.vmap(walk, in_axes=(None, 0)))(table, labels)
    assert rows.dtype == jnp.int32 and rewards.dtype == jnp.float32 and rewards.shape == (16, 10)
    automaton = table.automaton()
    for word, row in zip(np.asarray(labels), rows.tolist(), strict=True):
        expected = int(automaton.initial_row[0])
        for label in word:
            letter = automaton.letter([name for name, on in zip(AB, label, strict=True) if on])
            expected = int(automaton.next_row[expected, letter])
        assert row == expected


def test_tables_of_equal_shape_share_one_program():
    traces = 0

    @jax.jit
    def first(table):
        nonlocal traces
        traces += 1
        return table.next_row[table.initial_row]

    for text in ("F(a & F b)", "F(b & F a)", "F(a & F c)"):
        first(compile_tasks(text, AB))
    assert traces == 1


def test_donated_and_sharded(table):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the CPU backend may not use a donated buffer
        copy = jax.tree.map(jnp.copy, table)
        donated = jax.jit(lambda t: t.replace(initial_row=t.initial_row + 0), donate_argnums=0)(copy)
    assert jax.tree.all(jax.tree.map(lambda x, y: (x == y).all(), donated, table))
    mesh = jax.make_mesh((1,), ("seed",))
    placed = jax.device_put(table, jax.NamedSharding(mesh, jax.sharding.PartitionSpec()))
    labels = jnp.ones((4, 3), bool)
    assert jax.jit(walk)(placed, labels)[0] == walk(table, labels)[0]


def test_tables_can_be_stacked(table):
    both = jax.tree.map(lambda *x: jnp.stack(x), table, table)
    assert both.num_rows == table.num_rows and both.num_tasks == 2
    labels = jnp.zeros((2, 5, 3), bool)
    assert jax.vmap(walk)(both, labels)[0].shape == (2,)
