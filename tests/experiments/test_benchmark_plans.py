"""What a plan is worth: both plans play the same formulas with the same agent, and the table holds what they did."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

import t2tl_jax
from experiments.benchmarks import plans
from t2tl_jax.evaluation.statistics import mean, rate

STORED = json.loads((Path(__file__).parents[2] / "results/plans.json").read_text(encoding="utf-8"))


@pytest.fixture
def played(monkeypatch):
    """Calls of the agent's loading and evaluation; it succeeds more often with a plan, and in more steps."""
    calls = []

    def load(run, plan):
        def evaluate(tasks, episodes):
            calls.append((str(run), plan, tuple(tasks), episodes))
            seed = SimpleNamespace(
                success_rate=rate(episodes // (1 if plan == "critic" else 2), episodes),
                success_length=mean([3.0, 4.0] if plan == "critic" else [2.0, 3.0]),
                discounted_return=mean([0.7, 0.8]),
            )
            return {
                task: {name: SimpleNamespace(seeds=[seed]) for name in ("deterministic", "sampled")} for task in tasks
            }

        return SimpleNamespace(evaluate=evaluate, seeds=(24,), config=SimpleNamespace(episode_length=75))

    monkeypatch.setattr(t2tl_jax, "load", load)
    return calls


def test_command(played, tmp_path, capsys):
    file = tmp_path / "plans.json"
    assert plans.main(["runs/letters", "--episodes", "10", "--json", str(file)]) == 0
    formulas = (*plans.TRAPS, *plans.OPEN)
    assert played == [("runs/letters", plan, formulas, 10) for plan in ("none", "critic")]
    content = json.loads(file.read_text())
    assert content["where"]["command"][:3] == ["python", "-m", "experiments.benchmarks.plans"]
    assert content["tasks"]["letters_1"]["none"]["sampled"] == [
        {"episodes": 10, "successes": 5, "steps": 2.5, "discounted_return": 0.75}
    ]
    shown = capsys.readouterr().out
    assert "| `F a\\|F(b & F c)` | 0.500 [0.237, 0.763], 2.5 | 1.000 [0.722, 1.000], 3.5 |" in shown


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "takes one run, got none"),
        (["runs/letters", "--episodes", "0"], "episodes"),
        (["runs/letters", "--json", "no/such/file.json"], "there is no folder no/such"),
        (["no/such/run"], "there is no folder no/such/run"),
    ],
)
def test_what_cannot_be_played_is_refused(words, said, capsys):
    assert plans.main(words) == 2
    assert said in capsys.readouterr().err


def test_what_was_measured_is_known():
    assert STORED["where"]["git_modified"] is False and len(STORED["where"]["git_revision"]) == 40
    assert set(STORED["tasks"]) == {*plans.TRAPS, *plans.OPEN} and STORED["seeds"] == [24]
    for made in STORED["tasks"].values():
        assert all(one["episodes"] == STORED["episodes"] for plan in plans.PLANS for (one,) in made[plan].values())
