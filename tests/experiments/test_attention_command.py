"""`python -m experiments.attention`: mistakes and their answers; that it works is shown in `test_real_runs.py`."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import pytest

from experiments import attention
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.registry import named_config
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import train

TRAINED = Path(__file__).parents[1] / "runs" / "run_of_0_1"
"""Two seeds of zone_ppo_closed_form; nothing may be written there."""


@pytest.fixture
def run(tmp_path):
    """A run without training, as (folder, config)."""
    config = named_config("zone_ppo_closed_form")
    config = dataclasses.replace(config, run=dataclasses.replace(config.run, compilation_cache=""))
    return lambda **changes: run_folder.create(tmp_path / "run", dataclasses.replace(config, **changes), {}).path


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--task", "F(Red & F Blue)"], 'unknown proposition "Blue"; known: Black, White, Red, Yellow'),
        (["--task", "F(Red &"], "the formula ends after"),
        (["--row", "7"], "no sub-task of this task; its rows:\n  2: F(Red & F(Black & F Yellow))\n  3:"),
        (["--row", "0"], "no sub-task"),
        (["--seed", "3"], "no seed 3; its seeds: 0, 1"),
        (["--episodes", "0"], "--episodes must be at least 1"),
        (["--output", "x.json"], "give a name that ends in .png, got x.json"),
        (["--output", "x.tiff"], "give a name that ends in .png, got x.tiff"),
        (["--which", "finl"], "did you mean 'final'"),
    ],
)
def test_mistakes_are_explained(flags, said, capsys):
    assert attention.main([str(TRAINED), *flags]) == 2
    assert said in capsys.readouterr().err


def test_a_run_without_checkpoint_cannot_be_read(run, capsys):
    assert attention.main([str(run(seeds="2"))]) == 2
    assert "no complete checkpoint" in capsys.readouterr().err


def test_other_encoders_have_no_attention(run, capsys):
    learner = named_config("zone_ppo").learner
    learner = dataclasses.replace(learner, network=dataclasses.replace(learner.network, task_encoder=GRUConfig()))
    assert attention.main([str(run(learner=learner))]) == 2
    message = capsys.readouterr().err
    assert "with a GRUConfig, which has no attention" in message
    assert "zone_ppo" in message and "rm_water" not in message


def test_only_runs_can_be_read(tmp_path, capsys):
    assert attention.main([str(tmp_path / "nothing")]) == 2
    assert "there is no folder" in capsys.readouterr().err


def test_start_of_a_run_with_pretrained_encoder(run, tmp_path, monkeypatch, capsys):
    """That encoder if it can be read; else a new network, and the picture says so."""
    source = run_folder.create(tmp_path / "source", named_config("pretrain_zone"), {}).path
    folder, config = run_folder.open_existing(run(pretrained=str(source), seeds="2"))
    fresh = {"params": {"task_encoder": {"w": jnp.zeros(2)}, "actor": {"w": jnp.zeros(3)}}}
    origin, params = attention._start(folder, config, 1, fresh)
    assert origin.startswith("new network") and params is fresh
    assert "no complete checkpoint" in capsys.readouterr().out

    def load(path):
        assert str(path) == str(source)
        encoders = jnp.array([[7.0, 7.0], [1.0, 1.0]])
        return SimpleNamespace(params={"best": {"params": {"task_encoder": {"w": encoders}}}}, seeds=(0, 1))

    monkeypatch.setattr(train, "load", load)
    origin, params = attention._start(folder, config, 1, fresh)
    assert origin == "pre-trained encoder"
    assert (params["params"]["task_encoder"]["w"] == 1).all()  # of this seed
    assert (params["params"]["actor"]["w"] == 0).all()


def test_a_family_is_too_many_formulas_to_read(capsys):
    assert attention.main([str(TRAINED), "--task", "Until_1_2_1_1"]) == 2
    assert "family of random tasks: choose the one to read" in capsys.readouterr().err
