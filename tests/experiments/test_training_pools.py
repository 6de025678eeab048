"""Pools of random tasks during training: one that does not fit is drawn again, and never ends a run."""

import dataclasses

import fake_learner
import jax
import numpy as np
import pytest

from envs import registry
from envs.single_state import SingleStateConfig
from experiments import run
from experiments.configs import PRETRAINING, Config, PoolConfig
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import TooLargeError, compile_pool
from t2tl_jax.runs import build, training_run

ENV = registry.make(SingleStateConfig())
CONFIG = dataclasses.replace(PRETRAINING, task="Until_1_2_1_1", pool=PoolConfig(size=2, rows=16, length=14))


def drawn(which: str):
    """What `compile_pool` gives for a pool of this name."""
    return compile_pool("Until_1_2_1_1", ENV.propositions, ENV.alphabet, f"0 {which}", size=2, rows=16, length=14)


def assert_equal(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


@pytest.fixture
def unlucky(monkeypatch):
    """Makes pools fail whose name (what follows the seed) the given function answers with True; lists the draws."""

    def fail(which) -> list[str]:
        draws: list[str] = []

        def compile_or_fail(family, propositions, alphabet, seed, **caps):
            name = seed.partition(" ")[2]
            draws.append(name)
            if which(name):
                raise TooLargeError("1 of 2 formulas were found")
            return compile_pool(family, propositions, alphabet, seed, **caps)

        monkeypatch.setattr(build, "compile_pool", compile_or_fail)
        return draws

    return fail


def test_pools_that_fit_are_those_of_their_number_and_the_first_is_drawn_once(unlucky):
    draws = unlucky(lambda name: False)
    pools = build.make_pools(CONFIG, ENV)
    for number in (0, 1, 2, 0):
        assert_equal(pools(number), drawn(str(number)))
    assert draws == ["0", "1", "2"]


def test_a_pool_that_does_not_fit_is_drawn_again_the_same_way_every_time(unlucky):
    draws = unlucky(lambda name: name in ("3", "3 again 1"))
    assert_equal(build.make_pools(CONFIG, ENV)(3), drawn("3 again 2"))
    assert draws == ["3", "3 again 1", "3 again 2"]
    assert_equal(build.make_pools(CONFIG, ENV)(3), drawn("3 again 2"))  # as after a resume


def test_after_many_draws_the_first_pool_comes_again(unlucky):
    draws = unlucky(lambda name: name.startswith("3"))
    assert_equal(build.make_pools(CONFIG, ENV)(3), drawn("0"))
    assert len(draws) == build.DRAWS_PER_POOL + 1


def test_caps_too_small_for_the_first_pool_are_explained_before_anything_is_written(unlucky, tmp_path, capsys):
    def with_pools(config: Config) -> build.Experiment:
        agent = fake_learner.make_agent()._replace(renew=lambda state, table: state)
        return dataclasses.replace(fake_learner.build(config), agent=agent, pools=build.make_pools(CONFIG, ENV))

    unlucky(lambda name: name == "0")
    flags = ["--config", "pretrain_zone", "--run.folder", str(tmp_path / "runs"), "--run.compilation-cache", ""]
    assert run.main(flags, build=with_pools) == 2
    assert "1 of 2 formulas were found; the flags: --pool.length, --pool.rows, --pool.size" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
    with pytest.raises(UserError, match="1 of 2 formulas"):
        training_run._prepare(Config(pretrained="auto"), with_pools)


def test_caps_that_some_draws_miss_do_not_end_training():
    """With the real sampler; every pool has formulas of its own and the shapes of the first."""
    tight = PoolConfig(size=4, rows=11, length=20)
    config = dataclasses.replace(CONFIG, task="Sequence_3_3", pool=tight)
    with pytest.raises(TooLargeError):
        compile_pool("Sequence_3_3", ENV.propositions, ENV.alphabet, "0 1", size=4, rows=11, length=20)
    pools = build.make_pools(config, ENV)
    first, second = pools(0), pools(1)
    assert jax.tree.map(np.shape, first) == jax.tree.map(np.shape, second)
    assert not np.array_equal(first.tokens, second.tokens)
    assert_equal(second, build.make_pools(config, ENV)(1))
