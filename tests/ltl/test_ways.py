"""The ways that a row leaves open, as rows of their own."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import LTLError, compile_reward_machines, compile_tasks, named_machines
from t2tl_jax.ltl.ahead import distance_to_true
from t2tl_jax.ltl.ways import with_ways

NAMES = ("a", "b", "c", "d", "e")


def made(text, alphabet="at_most_one", most=8):
    """The table of a task, the one with its ways, whose they are, and a letter by its name."""
    table = compile_tasks([text], NAMES, alphabet)
    alone = table.letter(jnp.eye(len(NAMES), dtype=bool))
    longer, whose = jax.jit(with_ways, static_argnums=2)(table, alone, most)
    return table, longer, np.asarray(whose), dict(zip(NAMES, np.asarray(alone).tolist(), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("alphabet", ["at_most_one", "every_subset"])
def test_a_way_goes_on_with_its_own_letters_fails_as_its_row_does_and_else_stays(alphabet):
    table, longer, whose, letter = made("!e U (a | (b & F c) | (d & F c))", alphabet)
    start = int(table.initial_row[0])
    ways = list(dict.fromkeys(whose[start].tolist()))
    assert len(ways) == 2 and min(ways) >= table.num_rows  # b and d leave the same to do
    by_letter = [{name: int(longer.next_row[way, letter[name]]) for name in NAMES} for way in ways]
    nothing = [int(longer.next_row[way, 0]) for way in ways]
    after_b = int(table.next_row[start, letter["b"]])
    assert by_letter[0] == {"a": 0, "b": ways[0], "c": ways[0], "d": ways[0], "e": 1}
    assert by_letter[1] == {"a": ways[1], "b": after_b, "c": ways[1], "d": after_b, "e": 1}
    assert nothing == ways and list(distance_to_true(longer)[jnp.array(ways)]) == [1, 2]
    assert longer.text(ways[0]) == table.text(start) and (longer.verdict[jnp.array(ways)] == 0).all()


def test_the_rows_of_the_table_stay_and_a_single_way_is_the_row_itself():
    table, longer, whose, _ = made("F(a & F(b & F c))")
    assert (whose == np.arange(table.num_rows)[:, None]).all()
    np.testing.assert_array_equal(longer.next_row[: table.num_rows], table.next_row)
    np.testing.assert_array_equal(longer.tokens[: table.num_rows], table.tokens)


def test_the_nearest_ways_are_kept():
    table, longer, whose, _ = made("F a | F(b & F c) | F(d & F(c & F e))", most=2)
    ways = whose[int(table.initial_row[0])]
    assert whose.shape[1] == 2 and list(distance_to_true(longer)[ways]) == [1, 2]


@pytest.mark.slow
def test_to_undo_what_was_done_is_no_way_but_a_longer_one_without_return_is():
    """After a, b takes it back; the second task gives up a for good by b, and then has more to do."""
    table, _, whose, letter = made("F(a & (!b U c)) & F d")
    start = int(table.initial_row[0])
    after_a = int(table.next_row[start, letter["a"]])
    assert int(table.next_row[after_a, letter["b"]]) == start
    assert len(set(whose[start].tolist())) == len(set(whose[after_a].tolist())) == 2  # a or d; c or d
    table, longer, whose, _ = made("(!b U a) | (!a U (b & F(c & F d)))")
    assert list(distance_to_true(longer)[whose[int(table.initial_row[0]), :2]]) == [1, 3]


def test_what_has_no_ways_is_refused():
    alone = jnp.arange(1, 6)
    machine = compile_reward_machines(named_machines("rm_t10_published"), tuple("abcdef"), "every_subset")
    with pytest.raises(LTLError, match="a reward machine pays on its way"):
        with_ways(machine, alone, 4)
    many = tuple(f"p{k}" for k in range(24))
    parts = compile_tasks([f"F({' & '.join(many[:12])} & F({' & '.join(many[12:])}))"], many)
    assert len(parts.branches) > 1
    with pytest.raises(LTLError, match="have several; take fewer"):
        with_ways(parts, alone, 4)
