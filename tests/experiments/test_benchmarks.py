"""Mistakes in the arguments of the benchmarks of DQN and of the LTL compiler are answered before any measurement."""

import pytest

from experiments import benchmark_dqn, benchmark_ltl


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--families", "phi_water", "Foo"], 'unknown task family "Foo"; known: Default, Until_'),
        (["--families", "phi_watr"], 'did you mean "phi_water"'),
        (["--families"], "one or more names, got none"),
        (["--draws", "0"], "draws must be at least 1, got 0"),
        (["--alphabet", "at_most_two"], "did you mean 'at_most_one'"),
    ],
)
def test_mistakes_for_the_compiler_are_explained(flags, said, capsys):
    assert benchmark_ltl.main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and not printed.out


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--batch-size", "300000"], "buffer_size must hold at least one batch"),
        (["--repeats", "0"], "repeats must be at least 1, got 0"),
        (["--batch", "3"], "did you mean '--batch-size'"),
    ],
)
def test_mistakes_for_dqn_are_explained(flags, said, capsys):
    assert benchmark_dqn.main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and not printed.out


def test_compiler_is_timed(capsys):
    assert benchmark_ltl.main(["--families", "phi_water", "Sequence_2_2", "--draws", "2"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[-2:]] == ["phi_water", "Sequence_2_2"]
