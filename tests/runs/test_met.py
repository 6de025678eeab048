"""What the training of a run met of some tasks, of the pools that it drew."""

from dataclasses import replace
from typing import Any

import pytest

from t2tl_jax import Config, EnvConfig, PPOConfig
from t2tl_jax.ltl import Chains, Curriculum, Stage
from t2tl_jax.runs import met
from t2tl_jax.runs.config import PoolConfig
from t2tl_jax.runs.pools import Pools
from tests.agents.sizes import GRU, PPO
from tests.probe import ProbeEnv

TASK = "F(Up & F Down)"
LEARNER: PPOConfig = replace(PPO, network=replace(PPO.network, task_encoder=GRU))
FAMILY = Config(
    env=EnvConfig(),
    task=Chains(depth=(1, 3), avoid=(0, 1)),
    learner=LEARNER,
    pool=PoolConfig(size=2, period=4, rows=16),
)


def shares(found: met.MetInTraining | None) -> dict[str, tuple[str, str]]:
    assert found is not None
    return {task: (str(one.exactly), str(one.renamed)) for task, one in found.by_task.items()}


def test_of_a_task_its_own_rows():
    config = replace(FAMILY, task=TASK)
    found = met.met_in_training(config, ProbeEnv(), ["F Down", "F Up", TASK, "Up & X Down"], 9)
    assert shares(found) == {
        "F Down": ("1/1", "1/1"),
        "F Up": ("0/1", "1/1"),
        TASK: ("2/2", "2/2"),
        "Up & X Down": ("0/2", "0/2"),
    }


def test_of_a_task_over_other_propositions_what_does_not_read_them_and_what_does_under_other_names():
    config = replace(FAMILY, task=TASK)
    found = met.met_in_training(config, ProbeEnv(), ["F Left", "F(Left & F Down)", "F(Up & F(Down & F Left))"], 9)
    assert shares(found) == {
        "F Left": ("0/1", "1/1"),
        "F(Left & F Down)": ("1/2", "2/2"),
        "F(Up & F(Down & F Left))": ("0/3", "2/3"),
    }


def test_the_pools_that_it_drew_are_looked_at_and_no_other_formulas():
    pools = Pools(FAMILY, ProbeEnv())
    drawn = [pools.training(number) for number in range(3)]
    texts = [table.text(row) for table in drawn for row in range(2, table.num_rows) if table.verdict[row] == 0]
    tasks = list(dict.fromkeys(text for text in texts if text))
    found = met.met_in_training(FAMILY, ProbeEnv(), tasks, iterations=11, most=9)
    assert found is not None and (found.counted, found.drawn) == (3, 3)
    assert all(one.exactly.met == one.exactly.rows for one in found.by_task.values())
    reported = pools.evaluation
    own = [reported.text(int(row)) for row in reported.initial_row]
    of_own = met.met_in_training(FAMILY, ProbeEnv(), own, iterations=11, most=9)
    # The family can draw each of them; training keeps them out.
    assert of_own is not None and all(one.exactly.met < one.exactly.rows for one in of_own.by_task.values())


def test_of_some_pools_at_least_so_much(monkeypatch: pytest.MonkeyPatch):
    asked: list[int] = []
    draw = Pools.training

    def recorded(pools: Pools, number: int, *lesson: Any) -> Any:
        asked.append(number)
        return draw(pools, number, *lesson)

    monkeypatch.setattr(Pools, "training", recorded)
    found = met.met_in_training(FAMILY, ProbeEnv(), ["Up & X X X Down"], iterations=4000, most=2)
    assert found is not None and (found.counted, found.drawn) == (2, 1000) and asked == [0, 1]
    (one,) = found.by_task.values()
    assert str(one.exactly).startswith(">=0/") and not one.exactly.unseen and not one.renamed.unseen
    every = met.met_in_training(FAMILY, ProbeEnv(), ["Up & X X X Down"], iterations=8, most=2)
    assert every is not None and every.by_task["Up & X X X Down"].exactly.unseen


def test_of_a_curriculum_the_pools_that_success_does_not_decide():
    stages = (Stage(Chains(depth=(1, 2))), Stage(Chains(depth=(2, 3))))
    config = replace(FAMILY, task=Curriculum(stages))
    assert met.pools_counted(config, 400, most=100) == 2 and met.pools_counted(config, 4, most=100) == 1


def test_what_is_not_compared():
    for changes in ({"task": "rm_t1"}, {"progression": "paper"}):
        config = replace(FAMILY, **changes)
        assert met.met_in_training(config, ProbeEnv(), ["F Up"], 8) is None
