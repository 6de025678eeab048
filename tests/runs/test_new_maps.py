"""Training goes on with new maps every few iterations; a resumed run with the same ones, evaluation with its own."""

import dataclasses

import jax
import jax.numpy as jnp
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


RANDOM = (
    ZoneEnv(dataclasses.replace(OPEN, physics="closed_form", pool_size=20)),
    WaterWorld(WaterWorldConfig(layout="random", pool_size=20)),
    LetterWorld(LetterWorldConfig(pool_size=20)),
    FlatWorld(FlatWorldConfig(pool_size=20)),
)
BY_SEED = WaterWorldConfig(layout="by_seed", pool_size=20)


@pytest.mark.parametrize("env", RANDOM, ids=lambda env: type(env).__name__)
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


@pytest.mark.parametrize("env", RANDOM, ids=lambda env: type(env).__name__)
def test_independent_episodes_have_a_map_each_that_serves_nothing_else(env):
    one, other = env.independent_params(3, 30), env.independent_params(4, 30)
    single = jax.tree.map(lambda x: x[7], one)  # parameters of an episode: a pool of one map
    state, again = (env.reset(jax.random.key(9), params) for params in (single, jax.tree.map(jnp.asarray, single)))
    np.testing.assert_array_equal(state.obs, again.obs)
    known = env.make_params(3)
    assert jax.tree.structure(one) == jax.tree.structure(known)
    drawn = [mine for mine, pool in zip(*map(jax.tree.leaves, (one, known)), strict=True) if np.ndim(mine) > 2]
    assert drawn and all(len(mine) == 30 and mine.shape[1] == 1 for mine in drawn)
    pools = [
        [x for x in jax.tree.leaves(env.make_params(seed, purpose)) if np.ndim(x) > 1]
        for seed in (3, 4)
        for purpose in ("training", "evaluation", "selection")
    ]
    rows = [np.concatenate([x.reshape(len(x), -1) for x in pool], axis=1) for pool in pools]
    rows += [
        np.concatenate([x[:, 0].reshape(30, -1) for x in jax.tree.leaves(of) if np.ndim(x) > 2], axis=1)
        for of in (one, other)
    ]
    assert len(np.unique(np.concatenate(rows), axis=0)) == 6 * 20 + 2 * 30


def test_where_no_map_is_drawn_there_are_none_of_ones_own():
    envs = [ZoneEnv(ZoneConfig(physics="closed_form")), WaterWorld(), WaterWorld(BY_SEED), fake_learner.FakeEnv()]
    assert [env.independent_params(0, 5) for env in envs] == [None] * 4
