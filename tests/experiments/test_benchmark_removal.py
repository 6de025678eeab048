"""Agents without attention are read, too: what is stored of it, what the page says of that, and a stored agent."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from experiments.benchmarks import removal
from experiments.reproduction.sections import attention
from tests.made_up_runs import write

ROOT = Path(__file__).parents[2]
GNN = ROOT / "results" / "paper" / "zone-gnn"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "name at least one run folder"),
        (["no/such/run", "--episodes", "0"], "episodes"),
        (["no/such/run", "--json", "no/such/file.json"], "there is no folder no/such"),
        (["no/such/run"], "there is no folder no/such/run"),
        ([str(GNN.parent / "zone-dfa")], "reads no tokens: nothing to take away"),
    ],
)
def test_what_cannot_be_read_is_refused(words, said, capsys):
    assert removal.main(words) == 2
    assert said in capsys.readouterr().err


def test_steps_are_counted_for_the_token_that_matters_most():
    """The first one of equals, and no token where none matters."""
    moved = np.array([[0.1, 0.5, 0.0, 0.3], [0.2, 0.1, 0.0, 0.3], [0.0, 0.0, 0.0, 0.1]])
    assert removal.counts(moved) == [2, 1, 0]


def test_the_page_shows_what_is_stored(configs, tmp_path):
    stored = json.loads((ROOT / "results" / attention.REMOVAL).read_text(encoding="utf-8"))
    run = write(tmp_path / "paper" / "prime-fresh", configs["prime-fresh"])
    runs = {"prime-fresh": run}
    assert attention.removed(runs) == attention.removed({}) == ""  # it is not beside them
    shutil.copy(ROOT / "results" / attention.REMOVAL, run.path.parents[1])
    text = attention.removed(runs)
    assert stored["where"]["git_revision"][:7] in text and "agents of `phi_zone`, not of the task" in text
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| zone-")]
    readings = [(agent, one) for agent in stored["agents"] for one in agent["sub_tasks"]]
    assert {Path(agent["run"]).name for agent, _ in readings} == {"zone-gnn", "zone-t1tl"}
    for line, (agent, one) in zip(lines, readings, strict=True):
        at = int(np.argmax(one["most"]))
        assert line[:3] == [Path(agent["run"]).name, f"`{one['formula']}`", f"{at}: {one['tokens'][at]}"]
        assert line[3].startswith(f"{one['most'][at] / one['steps']:.2f} [") and line[4] == f"{one['policy'][at]:.2g}"
        assert f"of {Path(agent['run']).name} seed {agent['seed']} alone" in " ".join(text.split())
        assert one["met"] and sum(one["most"]) <= one["steps"] <= stored["episodes"]
        assert len(one["tokens"]) == len(one["policy"]) == len(one["most"]) == len(one["most_named"])


@pytest.mark.slow
def test_a_trained_graph_network_is_read():
    """Of every sub-task a finite change for each token, not the same for all, and the whole formula matters."""
    agent = removal.read(GNN, episodes=4)
    assert agent["encoder"] == "RGCNConfig" and agent["seed"] == 24
    assert [one["formula"] for one in agent["sub_tasks"]] == [
        "F(Red & F(Black & F Yellow))",
        "F(Black & F Yellow)",
        "F Yellow",
    ]
    for one in agent["sub_tasks"]:
        policy = np.array(one["policy"])
        assert len(policy) == len(one["tokens"]) and np.isfinite(policy).all() and (policy >= 0).all()
        assert policy[0] > 1.0 and np.ptp(policy) > 0.1
        assert sum(one["most"]) == sum(one["most_named"]) == one["steps"]
    assert "| zone-gnn | `F Yellow` |" in removal.table({"agents": [agent]})
