"""Tables of the stored WaterWorld runs beside the published curves."""

from pathlib import Path

import pytest

from experiments.water_scores import main

RESULTS = Path(__file__).parents[2] / "results" / "water_h200"


def cells(text, start):
    (line,) = (line for line in text.splitlines() if line.startswith(start) or start in line.split("   ")[0])
    return line


def test_ten_tasks_by_steps(capsys):
    assert main([str(RESULTS / "rm_crm"), str(RESULTS / "rm_ql")]) == 0
    shown = capsys.readouterr().out
    crm = cells(shown, "water_h200/rm_crm")
    assert "(4 maps)" in crm and "0.669±0.076" in crm  # as in docs/results.md, normalised with both runs' best
    assert "0.644±0.082" in cells(shown, "published crm")


def test_other_tasks_by_episode(capsys):
    assert main([str(RESULTS / "phi_rm")]) == 0
    shown = capsys.readouterr().out
    assert "0.906±0.080" in cells(shown, "water_h200/phi_rm") and "(12 seeds)" in shown
    assert "published T2TL_pre (phi_water)" in shown


@pytest.mark.parametrize(
    ("runs", "said"),
    [([], "at least one run"), (["rm_ql", "phi_rm"], "give runs of one kind"), (["nothing"], "there is no folder")],
)
def test_mistakes_are_explained(runs, said, capsys):
    assert main([str(RESULTS / run) for run in runs]) == 2
    assert said in capsys.readouterr().err
