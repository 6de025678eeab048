"""`python -m experiments.attention`: mistakes and their answers; that it works is shown in `test_real_runs.py`."""

import dataclasses
from pathlib import Path

import pytest

from experiments import attention
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.registry import named_config
from t2tl_jax.runs import folder as run_folder

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


@pytest.mark.slow
def test_a_run_without_checkpoint_cannot_be_read(run, capsys):
    assert attention.main([str(run(seeds="2"))]) == 2
    assert "no complete checkpoint" in capsys.readouterr().err


def test_codes_without_tokens_cannot_be_read(run, capsys):
    learner = named_config("zone_ppo").learner
    learner = dataclasses.replace(learner, network=dataclasses.replace(learner.network, task_encoder=OneHotConfig()))
    assert attention.main([str(run(learner=learner, pretrained=""))]) == 2
    message = capsys.readouterr().err
    assert "by OneHotConfig, which reads no tokens" in message
    assert "zone_ppo" in message and "rm_water" not in message


def test_only_runs_can_be_read(tmp_path, capsys):
    assert attention.main([str(tmp_path / "nothing")]) == 2
    assert "there is no folder" in capsys.readouterr().err


def test_a_family_is_too_many_formulas_to_read(capsys):
    assert attention.main([str(TRAINED), "--task", "Until_1_2_1_1"]) == 2
    assert "family of random tasks: choose the one to read" in capsys.readouterr().err
