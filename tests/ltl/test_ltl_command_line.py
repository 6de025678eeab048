"""`python -m t2tl_jax.ltl`: what it prints, and how it fails."""

import subprocess
import sys

import pytest

from t2tl_jax.ltl.__main__ import main


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


def test_help(capsys):
    with pytest.raises(SystemExit) as left:
        main(["--help"])
    assert left.value.code == 0 and "--max-rows" in capsys.readouterr().out


def test_starts_without_jax():
    code = "import sys, t2tl_jax.ltl.__main__ as m; m.main(['F a']); sys.exit('jax' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and "row 2 [open]" in done.stdout, done.stderr
