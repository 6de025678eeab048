"""A run that version 0.1 left behind, in `run_of_0_1/`: this version loads, evaluates, compares and plots it.

It trained zone_ppo_closed_form by t1tl with tiny networks: two seeds, four iterations. Its training state is left out.
"""

import shutil
from pathlib import Path

import jax
import numpy as np
import pytest

import t2tl_jax
from envs.zones.point_mjx import MjxPoint
from experiments import compare, evaluate, plot
from t2tl_jax.runs.folder import RunFolder

pytestmark = pytest.mark.slow  # nearly every test loads, compiles or draws

STORED = Path(__file__).parent / "run_of_0_1"


@pytest.fixture
def run(tmp_path) -> Path:
    """A copy of it, to write to."""
    return Path(shutil.copytree(STORED, tmp_path / "run"))


def test_it_is_loaded():
    result = t2tl_jax.load(STORED)
    config = result.config
    assert (config.task, result.seeds, result.iteration, result.ended) == ("phi_zone", (0, 1), 4, "finished")
    assert (config.learner.unroll_length, config.learner.clip_eps, config.random_starts) == (16, 0.2, 0.0)
    assert config.learner.task_encoder == t2tl_jax.TransformerConfig(
        layers=1, width=16, heads=2, feed_forward=16, output=16
    )
    np.testing.assert_array_equal(result.metrics["frames"], [[512, 1024, 1536, 2048]] * 2)
    assert {"success_rate", "discounted_return", "length"} <= set(result.metrics)
    assert result.success_since == {0: None, 1: None}


@pytest.mark.parametrize("which", ["final", "best"])
def test_both_kinds_of_parameters_are_there_and_act(run, which):
    result = t2tl_jax.load(run)
    leaves = jax.tree.leaves(result.params[which])
    assert all(len(x) == 2 and np.isfinite(x).all() for x in leaves)
    assert any((x[0] != x[1]).any() for x in leaves)  # seeds began apart, and so they end
    obs = np.zeros((3, result.experiment.env.observation_size), np.float32)
    action = result.policy(seed=1, which=which)(obs, "phi_zone")
    assert action.shape == (3, 2) and np.isfinite(action).all()
    item = "latest" if which == "final" else which
    shutil.rmtree(run / "checkpoints" / "4" / item)
    with pytest.raises(t2tl_jax.UserError, match=f"cannot read '{item}' of checkpoint"):
        t2tl_jax.load(run)


@pytest.mark.slow
def test_it_is_evaluated_beside_its_earlier_evaluation(run, read_json, capsys):
    (earlier,) = read_json(run / "evaluation.json")["evaluations"]
    assert evaluate.main([str(run), "--episodes", "3", "--episode-length", "5"]) == 0
    shown = capsys.readouterr()
    assert "final deterministic  0" in shown.out and f"stored: {run / 'evaluation.json'}" in shown.out
    kept, *new = read_json(run / "evaluation.json")["evaluations"]
    assert kept == earlier and [entry["settings"]["checkpoint"] for entry in new] == ["final", "best"]
    assert all(entry["settings"]["episodes"] == 3 for entry in new)
    assert all(set(entry["settings"]) == set(earlier["settings"]) for entry in new)


@pytest.mark.slow
def test_it_is_evaluated_in_other_physics(run, read_json, monkeypatch):
    """As if it had been trained in MJX, which takes half a minute to compile and must not be touched here."""
    config = (run / "config.json").read_text().replace('"physics": "closed_form"', '"physics": "mjx"')
    (run / "config.json").write_text(config)
    assert t2tl_jax.load(run).config.env.physics == "mjx"
    monkeypatch.delattr(MjxPoint, "_substep")
    flags = ["--episodes", "2", "--episode-length", "3", "--physics", "closed_form"]
    assert evaluate.main([str(run), *flags]) == 0
    (_, *new) = read_json(run / "evaluation.json")["evaluations"]
    assert [entry["settings"]["physics"] for entry in new] == ["closed_form"] * 2  # final and best parameters


def test_it_is_compared(run, finished, capsys):
    assert compare.main([str(run), str(finished), "--last", "1"]) == 0
    header, old, new, *_ = capsys.readouterr().out.splitlines()
    assert header.split()[0] == "frames/s" and "2,771" in old
    assert "learner=fake" in new and "env=fake" in new


def test_its_curve_is_drawn(run, drawn):
    assert plot.main([str(run)]) == 0
    assert RunFolder(run).curves.stat().st_size > 10_000


def test_it_cannot_go_on_since_its_training_state_is_another_one(run, resume, capsys):
    assert resume(run, "--frames", "4096", "--run.compilation-cache", "") == 2
    assert "was trained by an earlier version" in capsys.readouterr().err
