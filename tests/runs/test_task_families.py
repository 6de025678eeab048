"""Families that are data as the task of a configuration: on the command line, in files, and in pools."""

import dataclasses
import json
import re

import numpy as np
import pytest

from experiments.cli.request import override
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import (
    Chains,
    Conjunction,
    Listed,
    LTLError,
    Mixture,
    Named,
    compile_pool,
    compile_tasks,
    renaming,
    resolve_tasks,
    row_languages,
)
from t2tl_jax.ltl.tasks import NAMED_TASKS
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs import config_files
from t2tl_jax.runs.config import PoolConfig
from t2tl_jax.runs.differences import differences
from t2tl_jax.runs.pools import make_pools
from t2tl_jax.single_state import SingleStateConfig

ZONE = named_config("zone_ppo_long")
ENV = make_env(SingleStateConfig(("Blue", "Green", "Magenta", "Yellow")))
BASE = dataclasses.replace(named_config("pretrain_zone"), pool=PoolConfig(size=6, rows=64, length=30))


def meanings(table):
    """Classes of the open rows of a pool, up to renaming."""
    rows = np.flatnonzero(np.asarray(table.verdict) == 0)
    return set(renaming.classes(np.asarray(table.next_row), np.asarray(table.verdict), rows, table.alphabet))


@pytest.mark.parametrize(
    ("flags", "task"),
    [
        (["--task", "chains"], Chains()),
        (["--task", "chains", "--task.depth", "1", "3", "--task.repeat", "False"], Chains((1, 3), repeat=False)),
        (
            ["--task=conjunction", "--task.of.avoid", "0", "0", "--task.count", "2", "3"],
            Conjunction(Chains(reach=(1, 1), avoid=(0, 0)), (2, 3)),
        ),
        (["--task", "chains_OR_Default"], "chains_OR_Default"),
    ],
)
def test_flags_make_families(flags, task):
    config = override(ZONE, flags)
    assert config.task == task
    assert config_files.from_json(config_files.to_json(config), "test") == config
    assert override(config, ["--task", "F Red"]).task == "F Red"


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--task", "chains", "--task.dept", "1", "3"], "unknown option '--task.dept'; did you mean '--task.depth'"),
        (["--task", "chains", "--task.depth", "3", "1"], "task: depth is a range of at least 1"),
        (["--task", "F Red", "--task.depth", "1", "3"], "unknown option '--task.depth'"),
    ],
)
def test_flags_that_do_not_fit_are_explained(flags, said):
    with pytest.raises(UserError, match=said):
        override(ZONE, flags)


def test_trees_survive_files_and_unknown_kinds_do_not():
    tree = Mixture((Chains(), Conjunction(Named("Until_1_2_1_1")), Listed(("z1", "F Blue"))), (0.5, 0.25, 0.25))
    config = dataclasses.replace(ZONE, task=tree)
    text = config_files.to_json(config)
    assert json.loads(text)["task"]["parts"][0]["kind"] == "chains"
    assert config_files.from_json(text, "test") == config
    for wrong, said in (
        (text.replace('"chains"', '"chain"'), "unknown task sampler 'chain'; did you mean 'chains'"),
        (text.replace('"depth"', '"dpeth"'), "unknown field 'dpeth', nearest known 'depth'"),
        (config_files.to_json(ZONE).replace('"task": "phi_zone"', '"task": 3'), "config.task: expected an object"),
    ):
        with pytest.raises(UserError, match=said):
            config_files.from_json(wrong, "test")


def test_a_name_in_a_configuration_is_the_family():
    assert dataclasses.replace(ZONE, task=" chains ").task == Chains()
    assert list(differences(ZONE, dataclasses.replace(ZONE, task="chains"))) == ["task=chains"]
    assert not list(differences(dataclasses.replace(ZONE, task=Chains()), dataclasses.replace(ZONE, task="chains")))


def test_pools_are_drawn_from_it_and_read_by_look_ahead():
    learner = dataclasses.replace(
        BASE.learner, network=dataclasses.replace(BASE.learner.network, task_encoder=LookaheadConfig())
    )
    pools = make_pools(dataclasses.replace(BASE, task=Chains(), learner=learner), ENV)
    assert pools.training(1).num_tasks == 6
    one_hot = dataclasses.replace(learner, network=dataclasses.replace(learner.network, task_encoder=OneHotConfig()))
    with pytest.raises(ValueError, match="chains is a family of random tasks, and a one-hot code says nothing"):
        make_pools(dataclasses.replace(BASE, task=Chains(), learner=one_hot), ENV).training(0)


def test_what_is_held_out_is_met_under_no_name():
    """z2 and chains share rows; without holding out, the same pools meet some of them."""
    held_out = set(row_languages(resolve_tasks("z2").values(), ENV.propositions))
    config = dataclasses.replace(BASE, task=Chains((2, 2)))
    free = make_pools(config, ENV)
    kept = make_pools(dataclasses.replace(config, pool=dataclasses.replace(config.pool, held_out="z2")), ENV)
    assert any(not held_out.isdisjoint(meanings(free.training(number))) for number in range(3))
    assert all(held_out.isdisjoint(meanings(kept.training(number))) for number in range(3))
    assert held_out.isdisjoint(meanings(kept.selection()))
    wrong = dataclasses.replace(config, pool=dataclasses.replace(config.pool, held_out="z9"))
    with pytest.raises(LTLError, match='unknown task "z9"'):
        make_pools(wrong, ENV).training(0)
    wrong = dataclasses.replace(config, pool=dataclasses.replace(config.pool, unseen="F Red"))
    with pytest.raises(LTLError, match=r'(?s)unknown proposition "Red".*kept out of training speak of them'):
        make_pools(wrong, ENV).training(0)


def start(task, env):
    """The class of a task itself, not of what is left of it."""
    table = compile_tasks(resolve_tasks(task)[task], env.propositions, env.alphabet)
    full = compile_pool(Listed((task,)), env.propositions, env.alphabet, 0, size=1, rows=table.num_rows, length=999)
    rows = np.asarray(full.initial_row).tolist()
    return renaming.classes(np.asarray(full.next_row), np.asarray(full.verdict), rows, full.alphabet)[0]


def test_what_is_unseen_is_no_task_under_any_name_but_what_is_left_of_it_may_be():
    first, every = start("z4", ENV), set(row_languages(resolve_tasks("z4").values(), ENV.propositions))
    config = dataclasses.replace(BASE, task=Chains((2, 2), (1, 1)), pool=PoolConfig(size=60, rows=512, length=40))
    free = make_pools(config, ENV).training(1)
    kept = make_pools(dataclasses.replace(config, pool=dataclasses.replace(config.pool, unseen="z4")), ENV).training(1)
    assert first in meanings(free) and first not in meanings(kept)
    assert not meanings(kept).isdisjoint(every - {first})


@pytest.mark.parametrize(
    ("name", "begins", "named", "others"),
    [
        ("zones_any", r"(z|g|j|s)\d|long|reach_|avoid_", 22, 2),
        ("letters_any", "letters_", 7, 0),
        ("flat_any", "flat_", 5, 0),
        ("water_any", "phi_water", 9, 0),
    ],
)
def test_configurations_for_any_task_keep_out_what_they_are_tested_on(name, begins, named, others):
    """Pools of their sizes fit, fill their table well, and meet none of the test formulas as a task."""
    config = named_config(name)
    env = make_env(config.env)
    config = dataclasses.replace(config, pool=dataclasses.replace(config.pool, size=48, rows=256))
    tests = resolve_tasks(config.pool.unseen)
    of_its_world = {task for task in NAMED_TASKS if re.match(begins, task)} - {"reach_2"}  # which is any chain of two
    assert len(of_its_world) == named and of_its_world <= tests.keys() and len(tests) == named + others
    starts = {start(name, env) for name in tests}
    table = make_pools(config, env).training(0)
    own = renaming.classes(
        np.asarray(table.next_row), np.asarray(table.verdict), np.flatnonzero(table.starts).tolist(), table.alphabet
    )
    assert starts.isdisjoint(own) and table.num_tasks == 48
    assert config_files.from_json(config_files.to_json(config), "test") == config
