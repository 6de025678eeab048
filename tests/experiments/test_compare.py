"""Comparing runs by command: what is not known, what is given twice, tests and pictures."""

from pathlib import Path

import pytest

from experiments.compare import main

HEADER = (
    "iteration,frames,seed,episodes,success_rate,violation_rate,timeout_rate,discounted_return,length,success_length"
)
RESULTS = Path(__file__).parents[2] / "results" / "zone_methods_h200"


@pytest.fixture
def metrics(tmp_path):
    """Two seeds, four iterations; seed 1 finishes no episode in the last one."""
    lines = [HEADER]
    for iteration in range(1, 5):
        lines.append(f"{iteration},{iteration * 10},0,{iteration},{iteration / 4},0,0,{iteration / 10},5,5")
        lines.append(f"{iteration},{iteration * 10},1," + ("0,,,,,," if iteration == 4 else "2,1.0,0,0,0.5,5,5"))
    path = tmp_path / "metrics.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def incomplete(metrics, tmp_path):
    """A run with those metrics and without status.json."""
    (tmp_path / "config.json").write_text((RESULTS / "t2tl" / "config.json").read_text())
    return tmp_path


def test_what_is_not_known_is_a_dash(incomplete, capsys):
    assert main([str(incomplete), "--last", "0.01"]) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[1].split()[:3] == ["-", "1/1", "0.400"]
    assert f"note: {incomplete}: left out 1 of 2 seeds" in shown

    (incomplete / "metrics.csv").write_text(f"{HEADER}\n1,10,0,0,,,,,,\n1,10,1,0,,,,,,\n")
    assert main([str(incomplete), str(RESULTS / "t2tl"), "--pairs", "True"]) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[1].split()[:3] == ["-", "-", "-"] and "left out 2 of 2 seeds" in shown
    assert "p=-" in shown and "a test needs two seeds of each run or more, got 0 and 12" in shown


def test_violations_are_reported(metrics, incomplete, capsys):
    """Mean over seeds of the last part: of phi_safe and its like, success alone does not say how the rest went."""
    text = metrics.read_text().replace(",0,4,1.0,0,", ",0,4,0.5,0.25,").replace(",1,2,1.0,0,", ",1,2,0.5,0.25,")
    metrics.write_text(text)
    assert main([str(incomplete), "--last", "0.01"]) == 0
    header, line = capsys.readouterr().out.splitlines()[:2]
    at = header.index("violation")
    assert line[at:].split()[0] == "0.250"


def test_a_run_given_twice_counts_once(capsys):
    run = str(RESULTS / "t2tl")
    assert main([run, f"{run}/../t2tl", str(RESULTS / "gnn"), "--pairs", "True"]) == 0
    shown = capsys.readouterr().out
    assert "t2tl/../t2tl is given more than once" in shown and shown.count("p=") == 1
    assert main([run, run, "--pairs", "True"]) == 2
    assert "--pairs tests two runs or more" in capsys.readouterr().err


def test_wrong_folder_is_a_clean_error(tmp_path, capsys):
    assert main([str(tmp_path / "nowhere")]) == 2
    assert "there is no folder" in capsys.readouterr().err


def test_runs_are_tested_and_drawn(tmp_path, capsys):
    runs, figure = [str(RESULTS / name) for name in ("t2tl", "gnn", "dfa")], tmp_path / "curves.png"
    assert main([*runs, "--pairs", "True", "--figure", str(figure)]) == 0
    shown = capsys.readouterr().out
    assert shown.count("p=") == 3 and "0.021 [0.004, 0.037]" in shown  # t2tl - gnn, as in docs/results.md
    assert figure.stat().st_size > 10_000
    assert main([runs[0], "--figure", str(tmp_path / "nowhere" / "x.png")]) == 2
    assert main([runs[0], "--figure", str(tmp_path / "x.pdf")]) == 2 and not (tmp_path / "x.pdf").exists()
    assert "cannot write" in capsys.readouterr().err
