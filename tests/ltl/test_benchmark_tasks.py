"""The test formulas of others by name: each compiles in its environment, to as many rows as were counted elsewhere."""

import pytest

from t2tl_jax.ltl import NAMED_TASKS, compile_named, is_family, named_task, resolve_task
from t2tl_jax.ltl.benchmark_tasks import BENCHMARK_TASKS, COLOURS

SIX = ("Red", "Cyan", "Blue", "Yellow", "Green", "Magenta")
FLAT = ("Red", "Magenta", "Yellow", "Orange", "Blue", "Green", "Aqua")
ROWS = {
    **{"z1": 7, "z2": 6, "z3": 9, "z4": 4, "z5": 4, "z6": 4, "g1": 9, "g2": 10, "g3": 7, "g4": 6},
    **{"long": 14, "j10": 8, "s8": 17, "reach_12": 14},
}
"""True and false among them."""


@pytest.mark.parametrize("name", BENCHMARK_TASKS)
def test_every_task_is_open_in_its_environment(name):
    names, alphabet = COLOURS, "at_most_one"
    if name.startswith(("six", "letters", "flat")):
        names = {"six": SIX, "letters": tuple("abcdefghijkl"), "flat": FLAT}[name.split("_")[0]]
        alphabet = "every_subset" if name.startswith("flat") else alphabet
    table = compile_named(name, names, alphabet)
    assert table.num_rows == ROWS.get(name, table.num_rows) and int(table.initial_row[0]) >= 2
    assert resolve_task(name) == named_task(name) and not is_family(name) and name in NAMED_TASKS


def test_chains_of_this_project_follow_their_rule():
    assert BENCHMARK_TASKS["reach_4"] == "F(Blue & F(Green & F(Yellow & F Blue)))"
    assert BENCHMARK_TASKS["avoid_3"] == "!Green U (Blue & (!Magenta U (Green & (!Yellow U Magenta))))"
    assert BENCHMARK_TASKS["letters_avoid_6"].startswith("!a U (b & (!c U (d & (!e U (f")
