"""Letters over many propositions: looked up in parts, with the results of one array and of the definition of LTL."""

import random
import time
import tracemalloc
from functools import partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents.shaping import potential
from t2tl_jax.ltl import (
    ZONE_PROPOSITIONS,
    Limits,
    Listed,
    TooLargeError,
    compile_named,
    compile_pool,
    compile_reward_machines,
    compile_tasks,
    languages,
    lookup,
    parse,
    parse_machine,
    renaming,
)
from t2tl_jax.ltl.ahead import distance_to_true, nearest_to_true
from t2tl_jax.ltl.compiler import parts
from t2tl_jax.ltl.compiler.automaton import build
from t2tl_jax.ltl.padding import needed_nodes, padded
from tests.ltl import ltl_oracles as oracle
from tests.operations import handled, operations

MANY = tuple(f"p{i}" for i in range(24))
SHUFFLED = tuple(random.Random(0).sample(MANY, len(MANY)))


def chain(names):
    text = f"F {names[-1]}"
    for name in reversed(names[:-1]):
        text = f"F({name} & {text})"
    return text


def avoiding(goals, obstacles):
    avoid = " & ".join(f"!{name}" for name in obstacles)
    text = f"({avoid}) U {goals[-1]}"
    for goal in reversed(goals[:-1]):
        text = f"({avoid}) U ({goal} & ({text}))"
    return text


LARGE = {
    "chain": chain(MANY),
    "chain in another order": chain(SHUFFLED),
    "goals and obstacles": avoiding(SHUFFLED[:12], SHUFFLED[12:]),
    "pairs far apart": "F(" + " | ".join(f"({a} & {b})" for a, b in zip(MANY[:12], MANY[12:], strict=True)) + ")",
    "all at once": "F(" + " & ".join(MANY) + ")",
    "several chains": " & ".join(
        [*(chain(SHUFFLED[4 * i : 4 * i + 4]) for i in range(3)), f"F({' | '.join(SHUFFLED[12:])})"]
    ),
}
MACHINE = """
start -> 1
otherwise -> stay / -0.5
1 -> 2 : (p0 | p13) & !p23 & (p5 <-> p17) / 0.25
1 -> fail : p23
2 -> done : p1 & (p22 -> p3) / 1
2 -> 1 : !p1 & p4
2 -> fail : p2 & p6 & p7 & p8 & p9 & p10 & p11 & p12 & p14 & p15 & p16 & p18 & p19 & p20 & p21
"""


@pytest.fixture
def in_parts(monkeypatch):
    """Letters are cut into as many parts as there are propositions, or into so many."""

    def cut(few):
        monkeypatch.setattr(parts, "ONE_PART", 1)
        monkeypatch.setattr(parts, "FEW_PARTS", few)
        monkeypatch.setattr(parts, "ENTRIES_PER_ROW", 0)

    return cut


# ----- in parts or at once -----

ABCDEF = tuple("abcdef")
SMALL = {
    "one formula": lambda: compile_tasks("F(a & F(b & (!c U (d & X(e | f)))))", ABCDEF),
    "some formulas": lambda: compile_tasks(["F a & F b & F(c & d)", "(a & b) U (c | (d & X e))", "F(e <-> f)"], ABCDEF),
    "machines": lambda: compile_named("rm_water_published", ABCDEF),
    "one proposition": lambda: compile_tasks("F a", ABCDEF),
}


@jax.jit
def everything(table):
    letters, rows = jnp.arange(table.num_letters), jnp.arange(table.num_rows)[:, None]
    distance = distance_to_true(table)
    return {
        "step_all": table.step_all(letters),
        "step": table.step(rows, letters),
        "progress": table.progress(rows, letters),
        "distance": (distance, nearest_to_true(table, distance)),
        "potential": potential(table, 0.9),
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "few"), [("one formula", 1), ("some formulas", 150), ("machines", 1), ("one proposition", 1)]
)
def test_letters_in_parts_lead_where_whole_ones_do(name, few, in_parts):
    whole = SMALL[name]()
    in_parts(few)
    table = SMALL[name]()
    assert len(whole.branches) == 1 and whole.num_letters == table.num_letters
    first, second = everything(whole), everything(table)
    chex.assert_trees_all_equal(first, second)
    chex.assert_trees_all_equal_dtypes(first, second)
    np.testing.assert_array_equal(first["progress"], whole.next_row)
    assert table.describe() == whole.describe()
    if name == "one proposition":
        assert len(table.branches) == 1
        return
    with pytest.raises(TooLargeError, match=r"progress\(row, letter\) or step_all\(letter\)"):
        _ = table.next_row


def test_the_best_letter_is_the_first_of_the_best(in_parts):
    in_parts(1)
    table = compile_tasks(["F(a & F(b & c))", "!a U (d | (b & X c))"], ABCDEF)
    dense = np.asarray(table.step_all(jnp.arange(table.num_letters))[0])
    best_outcome = jax.jit(partial(lookup.best_outcome, table.branches, table.num_outcomes))
    for seed in range(20):
        value = np.random.default_rng(seed).integers(0, 3, table.num_rows)
        expected = [row[value[row].argmax()] for row in dense]
        np.testing.assert_array_equal(best_outcome(value), expected)


@pytest.mark.slow
def test_tables_in_parts_are_padded_stacked_and_drawn_as_others(in_parts):
    automaton = build(["F(a & F(b & c)) & F d", "!d U (e & f)"], ABCDEF)
    whole, pool = padded(automaton, 64, 32), draw(0)
    in_parts(1)
    table = padded(automaton, 64, 32)
    step_all = jax.jit(lambda table: table.step_all(jnp.arange(table.num_letters))[0])
    np.testing.assert_array_equal(step_all(table), whole.next_row)
    assert len(table.branches) > 1 and needed_nodes(automaton, 64) > 2
    with pytest.raises(TooLargeError, match=r"need \d+ nodes, and the table has room for 2"):
        padded(automaton, 64, 32, nodes=2)
    same = draw(0)
    np.testing.assert_array_equal(step_all(same), pool.next_row)
    np.testing.assert_array_equal(same.tokens, pool.tokens)
    both = jax.tree.map(lambda *x: np.stack(x), table, table)
    stepped = jax.jit(jax.vmap(step_all))(both)
    np.testing.assert_array_equal(stepped[1], whole.next_row)


def draw(seed, names=ABCDEF, **caps):
    return compile_pool("chains", names, "every_subset", seed, **{"size": 6, "rows": 64, "length": 40} | caps)


def test_languages_do_not_depend_on_how_letters_are_read(monkeypatch):
    """In parts of two propositions or at once: the same rows have equal languages, also under other names."""
    tasks = ["F(a & F b)", "F(F b & a)", "F a & F b", "F(b & F a)", "F c & F d", "!e U (f & c)", "!c U (f & e)"]
    automaton = build(tasks, ABCDEF)
    rows, steps = automaton.initial_row.tolist(), automaton.every_letter()
    whole = languages.languages(automaton.next_row, automaton.verdict, rows)
    monkeypatch.setattr(languages, "_PART", 2)
    cut = languages.of_rows(steps, automaton.verdict, rows)
    assert [whole.index(x) for x in whole] == [cut.index(x) for x in cut] and len(set(cut)) == 6
    codes = renaming.of_rows(automaton.steps, automaton.verdict, rows)
    assert codes == renaming.classes(automaton.next_row, automaton.verdict, rows, "every_subset")


# ----- 24 propositions -----


@pytest.mark.parametrize("name", LARGE)
def test_every_subset_of_24_propositions_is_small_and_quick(name):
    compile_tasks("F a", ABCDEF)  # starts the backend
    tracemalloc.start()
    table = compile_tasks(LARGE[name], MANY)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    began = time.process_time()
    compile_tasks(LARGE[name], MANY)
    assert time.process_time() - began < 1  # seconds: 0.2 at most on an idle processor
    size = sum(x.nbytes for x in jax.tree.leaves(table))
    assert table.num_letters == 2**24 and peak + size < 100 * 2**20
    assert len(table.branches) <= 2


def test_the_cost_of_a_step_does_not_grow_with_the_letters():
    """The same three rows over more and more propositions: whatever reads along the letters would count millions."""

    def costs(count):
        names = MANY[:count]
        table, letters = compile_tasks("F(" + " & ".join(names) + ")", names), jnp.zeros(8, jnp.int32)
        assert (table.num_rows, table.num_letters) == (3, 2**count)
        one, all_rows = partial(table.step, jnp.zeros(8, jnp.int32)), table.step_all
        gathers = tuple(operations(step, letters)["gather"] for step in (one, all_rows))
        return len(table.branches), gathers, tuple(handled(step, letters) for step in (one, all_rows))

    few, (one_gather, all_gathers), (one, of_all) = costs(10)
    assert few == 1 and costs(18) == costs(10)
    parts, (later_gather, later_gathers), (later, later_of_all) = costs(20)
    assert parts == 2 and costs(24) == costs(20)
    assert (later_gather, later_gathers) == (one_gather + 1, all_gathers + 1)
    assert later < 4 * one and later_of_all < 4 * of_all


@pytest.mark.slow
def test_a_hundred_thousand_rows_compile_in_under_a_minute():
    """Of one core: ten to twenty seconds, more beside other work."""
    names = MANY[:17]
    began = time.process_time()
    table = compile_tasks(" & ".join(f"F {name}" for name in names), names, "at_most_one", limits=Limits(200_000))
    assert time.process_time() - began < 60
    assert table.num_rows == 2**17 + 1  # every subset of what is left to do, and false


def random_words(rng, names, count, length):
    for index in range(count):
        share = (0.1, 0.5, 0.9)[index % 3]
        yield [frozenset(name for name in names if rng.random() < share) for _ in range(rng.randint(1, length))]


@pytest.mark.parametrize("name", LARGE)
def test_24_propositions_agree_with_the_definition_of_ltl(name):
    """A lasso satisfies the formula exactly when the table reaches the true row on it."""
    formula, rng, seen = parse(LARGE[name]), random.Random(1), set()
    table = compile_tasks(formula, MANY)
    progress = jax.jit(lambda row, label: table.progress(row, table.letter(label)))
    step_all = jax.jit(lambda label: table.step_all(table.letter(label))[0])
    automaton = table.automaton()
    for word in random_words(rng, MANY, 12, 4):
        row = int(table.initial_row[0])
        for number, letter in enumerate(word * (table.num_rows if table.num_rows < 30 else 25)):
            label = np.array([name in letter for name in MANY])
            if number < len(word):
                assert int(step_all(label)[row]) == int(progress(row, label))
                assert automaton.follow(row, automaton.letter(letter))[0] == int(progress(row, label))
            row = int(progress(row, label))
        assert oracle.holds(formula, [], word) == (row == 0)
        seen.add(row == 0)
    assert name == "all at once" or seen == {True, False}


def test_machines_over_24_propositions_agree_with_the_interpreter():
    machine, rng = parse_machine(MACHINE), random.Random(2)
    table = compile_reward_machines(machine, MANY)
    assert table.num_letters == 2**24 and len(table.branches) == 2
    assert "-> 0     p1 & !p22 | p1 & p3 / 1" in table.describe()
    step_all = jax.jit(lambda labels: table.step_all(table.letter(labels)))
    words = [letter for word in random_words(rng, MANY, 60, 4) for letter in word]
    rows, rewards = step_all(np.array([[name in letter for name in MANY] for letter in words]))
    row_of = {"done": 0, "fail": 1, "1": 2, "2": 3}
    for number, letter in enumerate(words):
        for state in ("1", "2"):
            target, reward = machine.step(state, letter)
            assert (int(rows[row_of[state], number]), float(rewards[row_of[state], number])) == (row_of[target], reward)
    assert (rows[:2] == jnp.arange(2)[:, None]).all() and (rewards[:2] == 0).all()


@pytest.mark.slow
def test_pools_over_24_propositions_have_equal_shapes_and_are_true_to_their_formulas():
    tables = [draw(seed, MANY, rows=512, size=32) for seed in (0, 1)]
    assert len({str(jax.tree.map(lambda x: (x.shape, x.dtype), table)) for table in tables}) == 1
    table, rng = tables[0], np.random.default_rng(0)
    assert table.num_letters == 2**24 and sum(x.nbytes for x in jax.tree.leaves(table)) < 40 * 2**20
    for task in range(0, table.num_tasks, 4):
        row = int(table.initial_row[task])
        alone = compile_tasks(table.formula(row), MANY)
        own = int(alone.initial_row[0])
        for labels in rng.random((10, 24)) < np.array([[0.1], [0.5]] * 5):
            row = int(table.progress(row, table.letter(jnp.asarray(labels))))
            own = int(alone.progress(own, alone.letter(jnp.asarray(labels))))
            assert table.verdict[row] == alone.verdict[own]
    rows = np.flatnonzero(np.asarray(table.verdict) == 0)
    automaton = table.automaton()
    assert len(set(languages.of_rows(automaton.every_letter(), automaton.verdict, rows[:20]))) == 20


def test_formulas_that_need_more_nodes_than_there_are_left_are_drawn_again():
    table = draw(0, MANY, nodes=30)
    assert table.branches[1].shape == (2**12, 30) and table.num_tasks == 6
    one, two = Listed(("F p0", "F p20")), Listed(("F p0", "F p1"))
    caps = {"size": 2, "rows": 512, "length": 9, "nodes": 1}
    assert compile_pool(one, MANY, "every_subset", 0, **caps).num_tasks == 2
    with pytest.raises(TooLargeError, match=r"1 of 2 .* \d+ too many nodes for the 1 of their letters.* and nodes"):
        compile_pool(two, MANY, "every_subset", 0, **caps)


def test_a_large_table_is_described_by_what_its_rows_read():
    text = compile_tasks("F(p0 & (p23 | F p7))", MANY).describe()
    assert "8 letters (every_subset of p0, p7, p23)" in text and "  -> 0     p0 & p23 | p0 & p7" in text
    text = compile_tasks(chain(MANY), MANY).describe()
    assert "16,777,216 letters" in text and "  -> 2     !p0\n" in text


def test_more_than_an_int32_can_hold_is_refused():
    names = tuple(f"p{i}" for i in range(32))
    with pytest.raises(TooLargeError, match=r"32 propositions are used, and a letter .* room for 31.*at_most_one"):
        compile_tasks("F(" + " & ".join(names) + ")", names)
    table = compile_tasks("F(" + " & ".join(names[1:]) + ")", names)
    letter = table.letter(jnp.ones(32, bool))
    assert int(letter) == 2**31 - 1 and int(table.progress(table.initial_row[0], letter)) == 0
    assert compile_pool("chains", ZONE_PROPOSITIONS, "at_most_one", 0, size=4, rows=32, length=30).num_letters == 5
