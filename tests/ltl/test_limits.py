"""Every limit of a table: its message names the field and the flag, and where it is known, what would do."""

import re

import pytest

from t2tl_jax.ltl import Limits, LTLError, TooLargeError, compile_pool, compile_reward_machines, compile_tasks
from t2tl_jax.ltl.__main__ import main
from t2tl_jax.ltl.tasks import named_machines

NAMES = tuple("abcdefgh")
ANY_ORDER = " & ".join(f"F {name}" for name in NAMES[:6])
BEYOND = {
    "max_rows": (ANY_ORDER, 64),
    "max_cells": (ANY_ORDER, 4000),
    "max_tokens": (ANY_ORDER, 16),
    "max_terms": ("(F a | F(b & F c)) & (F(d & F e) | F(f & F g)) & X(F h | F(a & b))", 3),
    "max_work": (ANY_ORDER, 2000),
    "max_propositions": (ANY_ORDER, 5),
}


@pytest.mark.parametrize("field", BEYOND)
def test_a_limit_says_how_to_raise_it_and_that_helps(field):
    text, limit = BEYOND[field]
    assert field in Limits.__dataclass_fields__ and set(BEYOND) == set(Limits.__dataclass_fields__)
    for _ in range(20):
        with pytest.raises(TooLargeError) as caught:
            compile_tasks(text, NAMES, limits=Limits(**{field: limit}))
        said = str(caught.value)
        flag = f"--limits.{field.replace('_', '-')}"
        assert f"{field} of Limits; of a run {flag} " in said
        least = int(re.search(rf"{flag} (\d+)", said).group(1))
        assert least > limit
        limit = least
        try:
            table = compile_tasks(text, NAMES, limits=Limits(**{field: limit}))
        except TooLargeError:
            assert field in ("max_terms", "max_work")  # of which nobody knows beforehand how much it takes
            continue
        break
    assert table.num_rows == compile_tasks(text, NAMES).num_rows
    if field not in ("max_terms", "max_work"):
        with pytest.raises(TooLargeError):
            compile_tasks(text, NAMES, limits=Limits(**{field: limit - 1}))


def test_limits_of_machines_and_pools():
    machines, names = named_machines("rm_water"), tuple("abcdef")
    with pytest.raises(TooLargeError, match=r"max_rows=78: raise it to 79 or more .*--limits.max-rows 79"):
        compile_reward_machines(machines, names, limits=Limits(max_rows=78))
    with pytest.raises(TooLargeError, match=r"take 5,056 entries; .* --limits.max-cells 5056\)"):
        compile_reward_machines(machines, names, limits=Limits(max_cells=5055))
    pool = {"size": 4, "rows": 64, "length": 30}
    with pytest.raises(TooLargeError, match=r"64 rows with letters over 8 .* 16,384 entries; .*max-cells 16384"):
        compile_pool("chains", NAMES, "every_subset", 0, **pool, limits=Limits(max_cells=16383))
    with pytest.raises(TooLargeError, match=r"--task-length 5, or 0"):
        compile_tasks("F(a & F b)", NAMES, length=4)


def test_room_for_tokens_is_counted_before_it_is_taken():
    said = r"4 rows of 2,000,000,000 tokens take 8,000,000,000 .*--task-length.*--limits.max-cells 8000000000\)"
    with pytest.raises(TooLargeError, match=said):
        compile_tasks("F(a & F b)", NAMES, length=2_000_000_000)
    with pytest.raises(TooLargeError, match=r"64 rows of 2,000,000,000 tokens .*--pool.length"):
        compile_pool("chains", NAMES, "at_most_one", 0, size=4, rows=64, length=2_000_000_000)
    assert compile_tasks("F(a & F b)", NAMES, "at_most_one", length=9, limits=Limits(max_cells=36)).num_rows == 4
    with pytest.raises(TooLargeError, match="max_cells=36"):
        compile_tasks("F(a & F b)", NAMES, "at_most_one", length=10, limits=Limits(max_cells=36))


def test_pools_with_more_places_than_rows_end_soon():
    caps = {"rows": 8, "length": 30}
    with pytest.raises(TooLargeError, match=r"of 1000000 formulas of .* within 400 draws"):
        compile_pool("chains", NAMES, "at_most_one", 0, size=10**6, **caps)
    with pytest.raises(TooLargeError, match=r"2,000,000,000 formulas is too large; .*--pool.size"):
        compile_pool("chains", NAMES, "at_most_one", 0, size=2 * 10**9, **caps)


def test_limits_are_checked():
    with pytest.raises(LTLError, match="max_rows must be at least 1, got 0"):
        Limits(max_rows=0)
    with pytest.raises(LTLError, match="max_propositions must be at most 500, got 501"):
        Limits(max_propositions=501)
    assert Limits().work(2) == 7_500 * 4096 + 1_000_000


@pytest.mark.parametrize("field", BEYOND)
def test_the_command_takes_the_same_limits_and_names_its_own_flag(field, capsys):
    text, limit = BEYOND[field]
    flag = f"--{field.replace('_', '-')}"
    options = ["--propositions", ",".join(NAMES)]
    for _ in range(20):
        code = main([text, *options, flag, str(limit)])
        said = capsys.readouterr().err
        if code == 0:
            break
        assert code == 2 and "--limits." not in said and "of a run" not in said
        limit = re.search(rf"\({flag} (\d+)\)", said).group(1)
    assert code == 0


def test_the_command_names_its_own_flag_for_tokens_too(capsys):
    options = ["--alphabet", "at_most_one", "--max-cells"]
    assert main([ANY_ORDER, *options, "1000"]) == 2
    assert "the limit is max_cells=1,000: raise it to 1,105 or more (--max-cells 1105)" in capsys.readouterr().err
    assert main([ANY_ORDER, *options, "1105"]) == 0
    assert main([ANY_ORDER, "--max-rows", "5"]) == 2
    assert "80 goes 16 times as far (--max-rows 80)" in capsys.readouterr().err


def test_more_propositions_than_usual_and_as_deep_as_allowed():
    names = tuple(f"p{i}" for i in range(500))
    tasks = [f"F({one} & F {other})" for one, other in zip(names[:250], names[250:], strict=True)]
    with pytest.raises(TooLargeError, match="use 500 propositions; the limit is max_propositions=200"):
        compile_tasks(tasks, names, "at_most_one")
    table = compile_tasks(tasks, names, "at_most_one", limits=Limits(max_propositions=500))
    assert table.num_rows == 2 + 500
