"""`python -m t2tl_jax.ltl`: what it prints, and how it fails."""

import re
import subprocess
import sys
import time

import pytest

from t2tl_jax.ltl.__main__ import main
from t2tl_jax.ltl.compiler.automaton import build
from t2tl_jax.ltl.compiler.budget import Limits
from t2tl_jax.ltl.describe import describe


def test_prints_rows_and_word(capsys):
    assert main(["!Red U (Black & F White)", "--word", "Black; ;White"]) == 0
    out = capsys.readouterr().out
    assert "row 2 [open]   <- task 0" in out and "Black & White" in out
    assert [line.split("  ")[0].strip() for line in out.splitlines()[-4:]] == [
        "start",
        "1 {Black}",
        "2 {}",
        "3 {White}",
    ]
    assert [line[22:27].strip() for line in out.splitlines()[-4:]] == ["open", "open", "open", "true"]


def test_dot(capsys):
    assert main(["F(a & F b)", "--dot", "--alphabet", "at_most_one"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("digraph tasks {") and out.rstrip().endswith("}")
    assert '2 -> 3 [label="a"];' in out and '3 -> 0 [label="b"];' in out and '"b | otherwise"' in out


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["a U"], "^"),
        (["G a"], "not co-safe"),
        (["phi_watr"], 'did you mean "phi_water"'),
        (["F a", "--word", "b"], "known: a"),
        (["F a & F b", "--max-rows", "3"], "max_rows"),
        ([], "at least one formula"),
    ],
)
def test_errors_are_messages(argv, message, capsys):
    assert main(argv) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and message in captured.err and not captured.out


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["F a", "--wrd", "a"], "unknown option '--wrd'; did you mean '--word'?"),
        (["Until_1_2"], '"Until_1_2" needs 4 positive whole numbers: Until_<min levels>_<max levels>_<min conjuncts>'),
        (["Untl_1_2_1_1"], 'did you mean "Until_1_2_1_1"?'),
        (["F a", "Until_1_2_1_1"], "Until_1_2_1_1 is a family of random tasks, and this command shows given ones"),
        (["Default"], "Default is a family of random tasks"),
        (["F a", "--max-rows", "many"], "--max-rows takes a whole number, got 'many'"),
        (["F a", "--alphabet", "every"], "did you mean 'every_subset'?"),
        (["--dot=Tru", "F a"], "unknown --dot 'Tru'; did you mean 'True'?"),
        (["F a", "-w", "a"], "every option begins with --, got '-w'"),
    ],
)
def test_mistakes_in_options_are_plain_lines(argv, message, capsys):
    assert main(argv) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("error: ") and message in lines[0] and len(lines) <= 2


@pytest.mark.parametrize("argv", [['"room_1"'], ["room_1", "--propositions", "room_1,b"], ["F Default"]])
def test_a_proposition_may_be_called_like_a_family(argv, capsys):
    assert main(argv) == 0 and "3 rows, 1 task" in capsys.readouterr().out


@pytest.mark.parametrize("options", [["--max-rows", "10", "--dot"], ["--dot=True", "--max-rows=10"], ["--dot", "True"]])
def test_formulas_stand_before_or_behind_options(options, capsys):
    ways = [
        ["F a", "F b", *options],
        [*options, "F a", "F b"],
        ["F a", *options, "F b"],
        [*options, "F a", *options, "F b"],
    ]
    for argv in ways:
        assert main(argv) == 0
    empty, *shown = capsys.readouterr().out.split("digraph")
    assert not empty and len(shown) == len(ways) and len(set(map(str.strip, shown))) == 1 and "F b" in shown[0]
    assert main(["--max-rows", "2", "F a", "F b"]) == 2  # the number is the option's own


EIGHT = " & ".join(f"F {name}" for name in "abcdefgh")


def test_a_large_table_is_described_in_short(capsys):
    assert main([EIGHT, "--word", "a;b"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("257 rows, 1 task, 256 letters") and out.count("\nrow ") == 20
    assert "row 2 [open]   <- task 0" in out and "  -> more than 20 rows" in out
    assert "... and 237 more rows, not listed" in out and "--show-rows 0 for all" in out
    assert re.search(r"compiled in \d+\.\d s; the longest row has 23 tokens", out)
    assert "word, task 0" in out and "2 {b}" in out


@pytest.mark.slow
def test_as_many_rows_as_asked_for(capsys):
    assert main([EIGHT, "--show-rows", "30"]) == 0
    out = capsys.readouterr().out
    assert out.count("\nrow ") == 30 and "... and 227 more" in out
    assert main([EIGHT, "--show-rows", "0"]) == main([EIGHT, "--show-rows", "257"]) == 0
    whole = capsys.readouterr().out
    assert whole.count("\nrow ") == 2 * 257 and "more" not in whole
    assert whole.count("  -> ") == 2 * (3**8 - 1)  # from a set of goals to each of its subsets, but from none
    assert main([EIGHT, "--show-rows", "-1"]) == 2
    assert "--show-rows takes a whole number from 0 on, got -1" in capsys.readouterr().err


def test_more_rows_than_a_picture_has(capsys):
    thirteen = " & ".join(f"F {name}" for name in "abcdefghijklm")
    assert main([thirteen, "--dot", "--max-rows", "10000"]) == 2
    assert "8,193 rows cannot be drawn, 4,096 at most" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("alphabet", ["every_subset", "at_most_one"])
def test_a_huge_table_is_described_soon(alphabet):
    names = tuple("abcdefghijklmno")
    automaton = build(" & ".join(f"F {name}" for name in names), names, alphabet, limits=Limits(max_rows=40_000))
    begin = time.process_time()
    said = describe(automaton, 20)
    assert time.process_time() - begin < 1 and said.startswith("32,769 rows")


def test_help(capsys):
    with pytest.raises(SystemExit) as left:
        main(["--help"])
    assert left.value.code == 0 and "--max-rows" in capsys.readouterr().out


def test_starts_without_jax():
    code = "import sys, t2tl_jax.ltl.__main__ as m; m.main(['F a']); sys.exit('jax' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and "row 2 [open]" in done.stdout, done.stderr
