"""Comparing runs: every finished episode counts once, and only settings that matter are named."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from experiments.compare import differences, ending, main
from experiments.configs import CONFIGS, Config
from experiments.methods import apply

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


def test_last_iterations_are_averaged_over_episodes(metrics):
    end = ending(metrics, last=0.5)
    np.testing.assert_allclose(end.success, [(3 * 0.75 + 4 * 1.0) / 7, 1.0])
    np.testing.assert_allclose(end.discounted_return, [(3 * 0.3 + 4 * 0.4) / 7, 0.5])


def test_at_least_one_iteration_is_averaged(metrics):
    end = ending(metrics, last=0.01)
    for values, of_first in ((end.success, 1.0), (end.discounted_return, 0.4), (end.length, 5.0)):
        np.testing.assert_allclose(values, [of_first, np.nan])  # no episode of seed 1 ended


@pytest.mark.parametrize("cut", [len("4,40,1,0,,,,,,\n"), len(",,,,,\n")])
def test_a_seed_without_its_last_row_counts_with_those_before(metrics, cut):
    metrics.write_text(metrics.read_text()[:-cut])
    np.testing.assert_allclose(ending(metrics, last=0.5).discounted_return, [(3 * 0.3 + 4 * 0.4) / 7, 0.5])


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


def test_a_run_given_twice_counts_once(capsys):
    run = str(RESULTS / "t2tl")
    assert main([run, f"{run}/../t2tl", str(RESULTS / "gnn"), "--pairs", "True"]) == 0
    shown = capsys.readouterr().out
    assert "t2tl/../t2tl is given more than once" in shown and shown.count("p=") == 1
    assert main([run, run, "--pairs", "True"]) == 2
    assert "--pairs tests two runs or more" in capsys.readouterr().err


def test_differences_name_nested_fields_and_leave_out_where_the_run_lies():
    base = Config()
    other = dataclasses.replace(
        base, ppo=dataclasses.replace(base.ppo, noise_time=0.0), run=dataclasses.replace(base.run, folder="x")
    )
    assert list(differences(base, other)) == ["ppo.noise_time=0.0"]


def test_differences_between_kinds_are_those_from_the_defaults():
    zone, water = Config(), apply(CONFIGS["waterworld_dqn"][0], "rm")
    water = dataclasses.replace(water, frames=zone.frames)
    assert set(differences(zone, water)) == {
        "env=WaterWorldConfig",
        "env.layout=by_seed",
        "network=QNetworkConfig",
        "network.task_encoder=one_hot",
        "network.head=bilinear",
        "network.task_layer=512",
        "ppo=None",
        "dqn=DQNConfig",
        "task=phi_water",
        "episode_length=600",
    }
    assert "env=ZoneConfig" in set(differences(water, zone)) and "dqn=None" in set(differences(water, zone))


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
