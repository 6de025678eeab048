"""Pools of random tasks during training: one that does not fit is drawn again, and never ends a run."""

import dataclasses

import jax
import numpy as np
import pytest

import t2tl_jax
from experiments import run
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import TooLargeError, compile_pool
from t2tl_jax.ltl.languages import languages
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs import pools as run_pools
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.config import PoolConfig
from t2tl_jax.runs.pools import make_pools
from t2tl_jax.single_state import SingleStateConfig
from tests import fake_learner

ENV = make_env(SingleStateConfig())
CONFIG = dataclasses.replace(
    named_config("pretrain_zone"), task="Until_1_2_1_1", pool=PoolConfig(size=2, rows=16, length=14)
)


def drawn(which: str):
    """What `compile_pool` gives for a pool of this name."""
    table = make_pools(CONFIG, ENV).evaluation
    without = meanings(table, np.asarray(table.initial_row)) if which != "0" else ()
    return compile_pool(
        "Until_1_2_1_1", ENV.propositions, ENV.alphabet, f"0 {which}", size=2, rows=16, length=14, without=without
    )


def meanings(table, rows):
    """Languages of rows."""
    return set(languages(np.asarray(table.next_row), np.asarray(table.verdict), rows))


def assert_equal(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


def test_more_formulas_than_a_table_has_rows_for_are_refused_at_once():
    """Before any is drawn, which takes long where none is left to be found."""
    many = dataclasses.replace(CONFIG, pool=dataclasses.replace(CONFIG.pool, size=15))
    with pytest.raises(ValueError, match=r"rows=16 rows holds 14 formulas at most, .* got pool.size=15"):
        make_pools(many, ENV)
    assert make_pools(dataclasses.replace(many, task="phi_zone"), ENV) is None  # of which nothing of this counts


@pytest.fixture
def unlucky(monkeypatch):
    """Makes pools fail whose name (what follows the seed) the given function answers with True; lists the draws."""

    def fail(which) -> list[str]:
        draws: list[str] = []

        def compile_or_fail(family, propositions, alphabet, seed, **caps):
            name = seed.partition(" ")[2]
            if name != "evaluation":
                draws.append(name)
            if which(name):
                raise TooLargeError("1 of 2 formulas were found")
            return compile_pool(family, propositions, alphabet, seed, **caps)

        monkeypatch.setattr(run_pools, "compile_pool", compile_or_fail)
        return draws

    return fail


def test_pools_that_fit_are_those_of_their_number_and_the_first_is_drawn_once(unlucky):
    draws = unlucky(lambda name: False)
    pools = make_pools(CONFIG, ENV).training
    tables = [pools(number) for number in (0, 1, 2, 0)]
    assert draws == ["0", "1", "2"]
    for number, table in zip((0, 1, 2, 0), tables, strict=True):
        assert_equal(table, drawn(str(number)))


def test_a_pool_that_does_not_fit_is_drawn_again_the_same_way_every_time(unlucky):
    draws = unlucky(lambda name: name in ("3", "3 again 1"))
    table = make_pools(CONFIG, ENV).training(3)
    assert draws == ["0", "3", "3 again 1", "3 again 2"]
    assert_equal(table, drawn("3 again 2"))
    assert_equal(make_pools(CONFIG, ENV).training(3), table)  # as after a resume


def test_after_many_draws_the_first_pool_comes_again(unlucky):
    draws = unlucky(lambda name: name.startswith("3"))
    table = make_pools(CONFIG, ENV).training(3)
    assert len(draws) == run_pools.DRAWS_PER_POOL + 1
    assert_equal(table, drawn("0"))


def test_caps_too_small_for_the_first_pool_are_explained_before_anything_is_written(
    unlucky, tmp_path, capsys, monkeypatch
):
    unlucky(lambda name: name == "0")
    flags = ["--config", "pretrain_fake", "--run.folder", str(tmp_path / "runs"), "--pool.size", "2"]
    assert run.main([*flags, "--task", "Until_1_2_1_1"]) == 2
    assert "1 of 2 formulas were found; the fields: pool.length, pool.rows, pool.size" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
    monkeypatch.setattr(pretraining, "SCHEDULE", fake_learner.PRETRAINING)
    with pytest.raises(UserError, match="1 of 2 formulas"):
        t2tl_jax.train(fake_learner.CONFIG, pretrained="auto")


def test_caps_that_some_draws_miss_do_not_end_training():
    """With the real sampler; every pool has formulas of its own and the shapes of the first."""
    tight = PoolConfig(size=4, rows=11, length=20)
    config = dataclasses.replace(CONFIG, task="Sequence_3_3", pool=tight)
    with pytest.raises(TooLargeError):
        compile_pool("Sequence_3_3", ENV.propositions, ENV.alphabet, "0 1", size=4, rows=11, length=20)
    pools = make_pools(config, ENV).training
    first, second = pools(0), pools(1)
    assert jax.tree.map(np.shape, first) == jax.tree.map(np.shape, second)
    assert not np.array_equal(first.tokens, second.tokens)
    assert_equal(second, make_pools(config, ENV).training(1))


@pytest.mark.parametrize("task", ["Until_1_2_1_1", "Eventually_1_5_1_4"])
def test_what_is_evaluated_on_was_not_trained_on_in_whatever_words(task):
    """Neither as a task nor as what is left of one; parameters are chosen by yet other tasks."""
    config = dataclasses.replace(named_config("pretrain_zone"), task=task)
    pools = make_pools(config, ENV)
    held_out = meanings(pools.evaluation, np.asarray(pools.evaluation.initial_row))
    assert len(held_out) == 16
    for number in range(4):
        table = pools.training(number)
        assert held_out.isdisjoint(meanings(table, np.flatnonzero(np.asarray(table.verdict) == 0)))
    selection = pools.selection()
    assert held_out.isdisjoint(meanings(selection, np.asarray(selection.initial_row)))


def test_a_family_without_a_formula_to_spare_is_refused():
    config = dataclasses.replace(CONFIG, task="Sequence_1_1", pool=PoolConfig(size=4, rows=16, length=14))
    with pytest.raises(TooLargeError, match=r"0 of 4 formulas .* belong to another pool.*pool\.size"):
        _ = make_pools(config, ENV).evaluation
    smaller = make_pools(dataclasses.replace(config, pool=dataclasses.replace(config.pool, size=3)), ENV)
    assert smaller.evaluation.num_tasks == 1  # of the four that there are
    tasks = [meanings(table, np.asarray(table.initial_row)) for table in map(smaller.training, (0, 5))]
    assert tasks[0] == tasks[1]
