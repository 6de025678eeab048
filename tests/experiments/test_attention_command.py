"""`python -m experiments.attention`: mistakes and their answers; that it works is shown in `test_real_runs.py`."""

import dataclasses

import jax.numpy as jnp
import pytest
from t2tl_jax.runs.build import build

from experiments import attention
from experiments.configs import CONFIGS, PoolConfig
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import pretraining


@pytest.fixture
def run(tmp_path):
    """A run without training, as (folder, config)."""
    config = CONFIGS["zone_ppo_closed_form"][0]
    config = dataclasses.replace(config, run=dataclasses.replace(config.run, compilation_cache=""))
    return lambda **changes: run_folder.create(tmp_path, "run", dataclasses.replace(config, **changes), {}).path


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
        (["--checkpoint", "last"], "did you mean 'latest'"),
        ([], "no complete checkpoint"),
    ],
)
def test_mistakes_are_explained(run, flags, said, capsys):
    assert attention.main([str(run(seeds="2")), *flags]) == 2
    assert said in capsys.readouterr().err


def test_other_encoders_have_no_attention(run, capsys):
    network = dataclasses.replace(CONFIGS["zone_ppo"][0].network, task_encoder="gru")
    assert attention.main([str(run(network=network))]) == 2
    message = capsys.readouterr().err
    assert "task_encoder=gru, which has no attention" in message
    assert "zone_ppo" in message and "rm_water" not in message


def test_only_runs_can_be_read(tmp_path, capsys):
    assert attention.main([str(tmp_path / "nothing")]) == 2
    assert "there is no folder" in capsys.readouterr().err


def test_start_of_a_run_with_pretrained_encoder(run, tmp_path, monkeypatch, capsys):
    """That encoder if it can be read; else a new network, and the picture says so."""
    source = run_folder.create(tmp_path, "pretrain_zone", CONFIGS["pretrain_zone"][0], {}).path
    folder, config = run_folder.open_existing(run(pretrained=str(source), seeds="2"))
    fresh = {"params": {"task_encoder": {"w": jnp.zeros(2)}, "actor": {"w": jnp.zeros(3)}}}
    origin, params = attention._start(folder, config, 1, fresh, build)
    assert origin.startswith("new network") and params is fresh
    assert "no complete checkpoint" in capsys.readouterr().out

    def load(folder, stored, experiment, config):
        assert config.seeds == "1,"  # of this seed only
        return {"w": jnp.ones((1, 2))}

    monkeypatch.setattr(pretraining.Checkpoints, "latest_iteration", lambda checkpoints: 1)
    monkeypatch.setattr(pretraining, "load", load)
    origin, params = attention._start(folder, config, 1, fresh, build)
    assert origin == "pre-trained encoder"
    assert (params["params"]["task_encoder"]["w"] == 1).all() and (params["params"]["actor"]["w"] == 0).all()


def test_a_family_is_too_many_formulas_to_read(run, capsys):
    assert attention.main([str(run(task="Until_1_2_1_1", pool=PoolConfig(size=2, rows=8, length=16)))]) == 2
    assert "family of random tasks: choose the one to read" in capsys.readouterr().err
