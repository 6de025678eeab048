"""`python -m experiments.split`: the shares as a table, and mistakes in plain words."""

import pytest

from experiments import split


def test_prints_shares_both_ways(capsys):
    flags = ["--training", "Until_1_2_1_1,z1", "--tests", "z5,reach_2,Until_1_1_1_1"]
    assert split.main(flags) == 0
    head, *lines = (line.split() for line in capsys.readouterr().out.splitlines())
    assert head[-3:] == ["z5", "reach_2", "Until_1_1_1_1"]
    assert [(line[0], line[1], line[-3:]) for line in lines] == [
        ("Until_1_2_1_1", "60", ["1/2", "0/2", "12/12"]),
        ("Until_1_2_1_1", "3", ["1/2", "0/2", "12/12"]),
        ("z1", "5", ["0/2", "0/2", "0/12"]),
        ("z1", "5", ["0/2", "1/2", "0/12"]),
    ]


def test_fields_of_a_family_are_flags(capsys):
    assert split.main(["--training", "chains", "--training.depth", "1", "1", "--tests", "z4"]) == 0
    assert [line.split()[-1] for line in capsys.readouterr().out.splitlines()[1:]] == ["1/2", "1/2"]


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--tests", "z7"], 'unknown task "z7"'),
        (["--tests", "F Red"], 'unknown proposition "Red"; known: Blue'),
        (["--tests", ","], "at least one task or family"),
        (["--training", "Untl_1_2_1_1"], 'did you mean "Until_1_2_1_1"'),
        (["--training", "chain"], 'did you mean "chains"'),
        (["--draws", "0"], "--draws must be at least 1"),
        (["--test", "z1"], "did you mean '--tests'"),
    ],
)
def test_mistakes_are_plain_lines(flags, said, capsys):
    assert split.main(flags) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and said in error
