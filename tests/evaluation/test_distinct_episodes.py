"""A deterministic policy from a fixed start plays one episode of a task: however often it is asked for, it is one."""

import jax
import numpy as np
import pytest

from envs.waterworld import WaterWorld, WaterWorldConfig
from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax import Config, EnvConfig, PPOConfig, compile_tasks
from t2tl_jax.evaluation.episodes import distinct
from t2tl_jax.evaluation.report import table
from t2tl_jax.runs import evaluations
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.single_state import SingleState, SingleStateConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.types import Agent
from tests.probe import ProbeEnv

pytestmark = pytest.mark.slow  # nearly every test loads, compiles or draws

NOISY = Agent(
    init=lambda key, env_params: None,
    iterate=lambda state, env_params: (state, None),
    embed=lambda params, table: jax.numpy.zeros((table.num_rows, 1)),
    act=lambda params, embedding, carry, obs, row, key, deterministic: (
        jax.numpy.ones((*row.shape, 1)) if deterministic else jax.random.normal(key, (*row.shape, 1))
    ),
    frames_per_iteration=1,
)


class FixedProbe(ProbeEnv):
    fixed_start = True


def test_repeated_episodes_count_once():
    env = FixedProbe()
    config = Config(env=EnvConfig(), task="F Up", learner=PPOConfig(), seeds="2", episode_length=4)
    experiment = Experiment(config, env, compile_tasks(["F Up"], env.propositions, env.alphabet), NOISY, None)
    reports = evaluations.evaluate_policies(experiment, {"final": np.zeros(2)}, episodes=20, episode_length=4)["final"]
    for deterministic, sampled in zip(reports["deterministic"].seeds, reports["sampled"].seeds, strict=True):
        assert deterministic.success_rate.count == 1 and sampled.success_rate.count == 20
        assert deterministic.success_rate.value == 1.0 and deterministic.success_rate.low < 0.5
        assert deterministic.discounted_return.low is None
    assert "it counts once" in table(reports)
    assert "it counts once" not in table({"sampled": reports["sampled"]})


@pytest.mark.parametrize(
    ("fixed", "deterministic", "asked", "played"),
    [(True, True, 20, 3), (True, True, 2, 2), (True, False, 20, 20), (False, True, 20, 20)],
)
def test_every_task_of_a_fixed_start_is_an_episode(fixed, deterministic, asked, played):
    env = FixedProbe() if fixed else ProbeEnv()
    tasks = compile_tasks(["F Up", "F Down", "F(Up & F Down)"], env.propositions, env.alphabet)
    assert distinct(TaskEnv(env, tasks), asked, deterministic) == played


@pytest.mark.parametrize(
    "env",
    [
        ZoneEnv(ZoneConfig(physics="closed_form")),
        ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=5)),
        WaterWorld(WaterWorldConfig()),
        WaterWorld(WaterWorldConfig(layout="by_seed")),
        WaterWorld(WaterWorldConfig(layout="random", pool_size=5)),
        WaterWorld(WaterWorldConfig(layout="random", pool_size=0)),
        SingleState(SingleStateConfig()),
        SingleState(SingleStateConfig(offered=2)),
    ],
    ids=lambda env: f"{type(env).__name__}-{getattr(env.config, 'layout', '')}",
)
def test_environments_tell_whether_resets_differ(env):
    params = env.make_params(3)
    states = jax.jit(jax.vmap(lambda key: env.reset(key, params)))(jax.random.split(jax.random.key(0), 8))
    same = all((np.asarray(leaf) == np.asarray(leaf)[:1]).all() for leaf in jax.tree.leaves(states))
    assert same == env.fixed_start
