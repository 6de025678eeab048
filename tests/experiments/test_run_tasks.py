"""Tasks that a run can be trained on: not those that are decided from the start."""

import dataclasses

import pytest

from experiments import evaluate, run
from t2tl_jax.ltl import PAPER_TASKS, ZONE_PROPOSITIONS
from t2tl_jax.registry import configs, make_env
from t2tl_jax.runs.pools import make_table


@pytest.mark.parametrize(
    ("name", "task", "said"),
    [
        ("zone_ppo_closed_form", "F(Red & Black)", "at most one of Black, White, Red, Yellow holds at a time"),
        ("waterworld_dqn", "F(Blue & !Blue)", "F(Blue & !Blue) can never be satisfied; give a task that can"),
        ("waterworld_dqn", "F Blue | True", "F Blue | True is true from the start"),
        ("pretrain_zone", "F(Red & Black)", "can never be satisfied: at most one of"),
    ],
)
def test_tasks_that_are_decided_from_the_start_are_refused(name, task, said, capsys, tmp_path):
    flags = ["--config", name, "--run.folder", str(tmp_path / "runs"), "--run.compilation-cache", ""]
    flags += ["--pretrained", "", "--learner.network.freeze-task-encoder", "False"]
    assert run.main([*flags, "--task", task]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


def test_evaluation_refuses_them_too(finished, capsys):
    assert evaluate.main([str(finished), "--task", "F(Red & Black)"]) == 2
    assert "F(Red & Black) can never be satisfied: at most one of" in capsys.readouterr().err


COMPILED = {}
"""Tables by what they are compiled from."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "config"), [(name, config) for name, (config, _) in configs().items()])
def test_named_tasks_are_open(name, config):
    water = "water" in name
    named = [task for task in PAPER_TASKS if task.startswith("phi_water") == water and not name.startswith("rm")]
    env = make_env(config.env)
    named = named if water or set(ZONE_PROPOSITIONS) <= set(env.propositions) else []
    few = dataclasses.replace(config.pool, size=16)  # of a family; `tests/ltl` and `tests/runs/test_pools.py` draw many
    config = dataclasses.replace(config, pool=few)
    for task in (config.task, *named):
        config = dataclasses.replace(config, task=task, task_length=0)
        known = (task, env.propositions, env.alphabet, config.pool, config.progression)
        if known not in COMPILED:  # many configurations have the same propositions
            COMPILED[known] = make_table(config, env)
        assert not COMPILED[known].verdict[COMPILED[known].initial_row].any()
