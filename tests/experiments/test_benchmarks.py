"""Mistakes in the arguments of the benchmarks of DQN and of the LTL compiler are answered before any measurement."""

import pytest

from experiments.benchmarks import dqn as benchmark_dqn
from experiments.benchmarks import ltl as benchmark_ltl


@pytest.mark.parametrize(
    ("command", "flags", "said"),
    [
        (benchmark_ltl, ["--families", "phi_water", "Foo"], 'unknown task family "Foo"; known: chains, '),
        (benchmark_ltl, ["--families", "phi_watr"], 'did you mean "phi_water"'),
        (benchmark_ltl, ["--families"], "one or more names, got none"),
        (benchmark_ltl, ["--draws", "0"], "draws must be at least 1, got 0"),
        (benchmark_ltl, ["--alphabet", "at_most_two"], "did you mean 'at_most_one'"),
        (benchmark_dqn, ["--batch-size", "300000"], "buffer_size must hold at least one batch"),
        (benchmark_dqn, ["--repeats", "0"], "repeats must be at least 1, got 0"),
        (benchmark_dqn, ["--batch", "3"], "did you mean '--batch-size'"),
    ],
)
def test_mistakes_are_explained(command, flags, said, capsys):
    assert command.main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and not printed.out


def test_compiler_is_timed(capsys):
    assert benchmark_ltl.main(["--families", "phi_water", "Sequence_2_2", "--draws", "2"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[-2:]] == ["phi_water", "Sequence_2_2"]
