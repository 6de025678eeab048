"""Tables of the stored WaterWorld runs beside the published curves."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from experiments.paper.published_water import EPISODES
from experiments.paper.water_scores import _at, main
from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.comparisons import outcome
from t2tl_jax.evaluation.scores import return_by_episode
from t2tl_jax.runs.metrics_file import read_columns

RESULTS = Path(__file__).parents[2] / "results"
TEN_TASKS = RESULTS / "water_h200" / "rm_parallel"
"""A run of the reward-machine benchmark on maps 1 to 4."""


def cells(text, start):
    (line,) = (line for line in text.splitlines() if line.startswith(start) or start in line.split("   ")[0])
    return line


def test_ten_tasks_by_steps(capsys):
    assert main([str(TEN_TASKS)]) == 0
    shown = capsys.readouterr().out
    ours = cells(shown, "water_h200/rm_parallel")
    assert "(4 maps)" in ours and "0.616±0.086" in ours
    assert "0.644±0.082" in cells(shown, "published crm ")


def test_other_tasks_by_episode(capsys):
    run = RESULTS / "paper" / "water-rm"
    assert main([str(run)]) == 0
    shown = capsys.readouterr().out
    columns = read_columns(run / "metrics.csv")
    ends = [return_by_episode(columns, seed, [7500])[0] for seed in range(12)]
    assert f"{np.mean(ends):.3f}±{np.std(ends, ddof=1):.3f}   (12 seeds)" in cells(shown, "paper/water-rm")
    assert "published T2TL_pre (phi_water)" in shown


def test_methods_are_compared_map_by_map(capsys):
    """Between maps the returns differ far more than between methods: unpaired, little would show."""
    runs = [RESULTS / "paper" / name for name in ("water-rm", "water-dfa")]
    assert main([str(run) for run in runs]) == 0
    (test,) = capsys.readouterr().out.split("comparisons\n")[1].splitlines()
    first, second = (
        [np.mean(return_by_episode(read_columns(run / "metrics.csv"), seed, EPISODES)) for seed in range(12)]
        for run in runs
    )
    gap = statistics.mean(np.subtract(first, second))
    assert re.split(r"  +", test)[0] == gap.text() and re.split(r"  +", test)[2:4] == ["paired", outcome(gap)]


@pytest.mark.parametrize(
    ("runs", "said"),
    [
        (["zone_short_h200/t2tl"], "was not trained in WaterWorld"),
        ([], "at least one run"),
        (["water_h200/rm_parallel", "paper/water-rm"], "give runs of one kind"),
        (["nothing"], "there is no folder"),
    ],
)
def test_mistakes_are_explained(runs, said, capsys):
    assert main([str(RESULTS / run) for run in runs]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("layout", ["fixed", "random"])
def test_ten_tasks_on_other_maps_have_no_published_scores(tmp_path, capsys, layout):
    config = json.loads((TEN_TASKS / "config.json").read_text())
    config["env"]["layout"] = layout
    (tmp_path / "config.json").write_text(json.dumps(config))
    shutil.copy(TEN_TASKS / "metrics.csv", tmp_path)
    assert main([str(tmp_path)]) == 2
    assert f"was trained with env.layout={layout}" in capsys.readouterr().err


def test_scores_exist_between_the_first_and_the_last_iteration(tmp_path, capsys):
    x, score = np.array([100.0, 200.0]), np.array([0.25, 0.5])
    assert [_at(steps, x, score) for steps in (99, 100, 199, 200, 201)] == [None, 0.25, 0.25, 0.5, None]
    for name in ("config.json", "metrics.csv"):
        shutil.copy(TEN_TASKS / name, tmp_path)
    header, *rows = (tmp_path / "metrics.csv").read_text().splitlines(keepends=True)
    frames = [float(row.split(",")[1]) for row in rows]
    kept = [row for row, at in zip(rows, frames, strict=True) if 60_000 <= at <= 150_000]
    (tmp_path / "metrics.csv").write_text("".join([header, *kept]))
    assert main([str(tmp_path)]) == 0
    line = capsys.readouterr().out.splitlines()[1].split()
    assert line[1] == "-" and "±" in line[2] and line[3:13] == ["-"] * 10
