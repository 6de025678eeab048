"""Training goes on with new maps every few iterations; a resumed run with the same ones, evaluation with its own."""

import dataclasses

import jax
import numpy as np
import pytest

import t2tl_jax
from envs.flatworld import FlatWorld, FlatWorldConfig
from envs.letterworld import LetterWorld, LetterWorldConfig
from envs.waterworld import WaterWorld, WaterWorldConfig
from envs.zones import OPEN, ZoneConfig, ZoneEnv
from t2tl_jax.registry import AGENTS, ENVS
from t2tl_jax.runs.experiment import build
from tests import fake_agent, fake_learner
from tests.fake_runs import StopAfter

PERIOD = 3


@dataclasses.dataclass(frozen=True)
class NumberedConfig(t2tl_jax.EnvConfig):
    """Nothing to choose."""


class Numbered(fake_learner.FakeEnv):
    """Its only parameter says which maps it has: 1000 x seed + renewal, negative if they are not for training."""

    renewable = True

    def make_params(self, seed, purpose="training"):
        return np.float32(1000 * seed if purpose == "training" else -1)

    def renewed_params(self, seed, renewal):
        assert renewal > 0
        return np.float32(1000 * seed + renewal)


def make_agent(task_env, config, episode_length, iterations):
    """The fake learner, which also reports the maps that an iteration was given."""
    agent = fake_agent.make_agent()

    def iterate(state, env_params):
        state, metrics = agent.iterate(state, env_params)
        return state, metrics.replace(scalars=metrics.scalars | {"maps": env_params.env})

    return agent._replace(iterate=iterate)


@dataclasses.dataclass(frozen=True)
class ReportingConfig(fake_agent.FakeConfig):
    """The fake learner that reports its maps."""


@pytest.fixture(scope="module", autouse=True)
def registered():
    with pytest.MonkeyPatch.context() as patch:
        for registry in (ENVS, AGENTS):
            patch.setattr(registry, "_kinds", dict(registry._kinds))
        t2tl_jax.register_env("numbered", NumberedConfig, lambda config: Numbered())
        t2tl_jax.register_agent("reporting", ReportingConfig, make_agent)
        yield


CONFIG = dataclasses.replace(
    fake_learner.CONFIG, env=NumberedConfig(), learner=ReportingConfig(), seeds="0,2", map_period=PERIOD
)


@pytest.mark.slow
def test_maps_are_renewed_after_every_period(tmp_path):
    run = t2tl_jax.train(CONFIG, frames=1000, folder=tmp_path / "whole")
    expected = np.arange(10) // PERIOD + np.array([[0], [2000]])
    np.testing.assert_array_equal(run.metrics["maps"], expected)
    # Stopped within a period, and resumed.
    part = t2tl_jax.train(CONFIG, frames=1000, folder=tmp_path / "part", callbacks=[StopAfter(5)])
    assert part.metrics["maps"].shape[1] == 5
    resumed = t2tl_jax.resume(tmp_path / "part")
    np.testing.assert_array_equal(resumed.metrics["maps"], expected)


def test_zero_keeps_the_first_maps():
    run = t2tl_jax.train(CONFIG, frames=500, map_period=0)
    np.testing.assert_array_equal(run.metrics["maps"], [[0] * 5, [2000] * 5])
    assert not build(dataclasses.replace(CONFIG, map_period=0)).renews_maps


def test_where_nothing_is_random_nothing_is_renewed():
    for env in (ZoneEnv(ZoneConfig(physics="closed_form")), WaterWorld(), fake_learner.FakeEnv()):
        assert not env.renewable
    assert not WaterWorld(WaterWorldConfig(layout="random", pool_size=0)).renewable
    assert not LetterWorld(LetterWorldConfig(layout="by_seed")).renewable
    with pytest.raises(NotImplementedError, match="FakeEnv has no maps to renew"):
        fake_learner.FakeEnv().renewed_params(0, 1)


@pytest.mark.parametrize(
    "env",
    [
        ZoneEnv(dataclasses.replace(OPEN, physics="closed_form", pool_size=20)),
        WaterWorld(WaterWorldConfig(layout="random", pool_size=20)),
        LetterWorld(LetterWorldConfig(pool_size=20)),
        FlatWorld(FlatWorldConfig(pool_size=20)),
    ],
    ids=lambda env: type(env).__name__,
)
def test_renewed_maps_are_new_ones(env):
    """Of all seeds and purposes, none comes twice, and every pool has the shapes of the first one."""
    assert env.renewable
    pools = [env.make_params(seed, purpose) for seed in (0, 1) for purpose in ("training", "evaluation", "selection")]
    pools += [env.renewed_params(seed, renewal) for seed in (0, 1) for renewal in (1, 2, 7)]
    shapes = [jax.tree.map(lambda x: (x.shape, x.dtype), pool) for pool in pools]
    assert all(shape == shapes[0] for shape in shapes)
    one_a_map = [
        np.concatenate([x.reshape(20, -1) for x in jax.tree.leaves(pool) if len(np.shape(x)) > 1], axis=1)
        for pool in pools
    ]
    assert len(np.unique(np.concatenate(one_a_map), axis=0)) == 12 * 20
    jax.tree.map(np.testing.assert_array_equal, env.renewed_params(1, 2), pools[10])
