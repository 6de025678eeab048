"""The command line with the real environment and learner, at reduced size."""

import dataclasses

import jax
import numpy as np
import pytest

from experiments import evaluate, run
from experiments.build import build
from experiments.configs import CONFIGS
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.training.program import trace

pytestmark = pytest.mark.slow

SMALL = (
    *("--ppo.num-envs", "8", "--ppo.rollout-steps", "32", "--ppo.minibatch-size", "128", "--ppo.epochs", "2"),
    *("--network.transformer.layers", "1", "--episode-length", "40", "--run.progress", "False"),
    # Correlated noise fades with the share of the run that is done, so a run that is made longer would have had other.
    *("--ppo.noise-time", "0"),
)


def reduced(name: str):
    config = CONFIGS[name][0]
    ppo = dataclasses.replace(config.ppo, num_envs=4, rollout_steps=8, minibatch_size=16, epochs=1)
    transformer: TransformerConfig = dataclasses.replace(config.network.transformer, layers=1)
    network = dataclasses.replace(config.network, transformer=transformer)
    env = dataclasses.replace(config.env, pool_size=8)
    return dataclasses.replace(config, ppo=ppo, network=network, env=env, frames=32, episode_length=10)


def iterate_once(config, seeds):
    program = trace(build(config).agent, seeds)
    state = program.lowered_init.compile()(program.keys)
    return program.lowered_iterate.compile()(state)


@pytest.mark.parametrize("name", CONFIGS)
def test_every_config_trains_one_iteration(name):
    state, metrics = iterate_once(reduced(name), (0,))
    assert all(np.isfinite(value).all() for value in metrics.scalars.values())
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(state.params))


def test_vmapped_seeds_equal_single_seeds():
    config = reduced("zone_ppo_closed_form")
    # One step of physics only: the robot's yaw servo is unstable, so that rounding (1e-5 in velocity after one step)
    # grows to 1e-3 in position within eight. And Adam divides by the size of a gradient: with its usual epsilon, one
    # that is zero but for rounding moves a parameter by a whole learning rate. What remains is the learner itself.
    ppo = dataclasses.replace(config.ppo, num_envs=16, rollout_steps=1, minibatch_size=8, epochs=2, adam_epsilon=1e-2)
    config = dataclasses.replace(config, ppo=ppo)
    many, _ = iterate_once(config, (0, 3, 7))
    single, _ = iterate_once(config, (3,))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a[1], b[0], rtol=0, atol=1e-6), many.params, single.params)


def test_train_resume_evaluate_draw(tmp_path):
    def train(name: str, frames: str):
        flags = ["--config", "zone_ppo_closed_form", "--run.folder", str(tmp_path / name), "--frames", frames, *SMALL]
        flags += ["--seeds", "2", "--run.compilation-cache", str(tmp_path / "xla"), "--run.evaluation-episodes", "4"]
        assert run.main(flags) == 0
        (folder,) = (tmp_path / name / "zone_ppo_closed_form").iterdir()
        return folder

    long, short = train("long", "1536"), train("short", "768")
    assert (short / "episode.gif").exists()
    assert run.main(["--resume", str(short), "--frames", "1536"]) == 0
    assert (long / "metrics.csv").read_bytes() == (short / "metrics.csv").read_bytes()
    assert (long / "evaluation.json").read_text() != ""
    flags = ["--episodes", "4", "--task", "F(Red & F White)", "--checkpoint", "latest", "--physics", "mjx"]
    assert evaluate.main([str(short), *flags]) == 0
