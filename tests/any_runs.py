"""Runs of agents for any task that nobody trained or tested, and what is stored of their tests."""

import json

import pytest

from experiments.reproduction.anytask import met, suites, tested
from experiments.reproduction.runs import all_runs
from tests.made_up_runs import write


def figures(success):
    """What is stored of a task, the same for both policies."""
    rest = {"violation_rate": 0.0, "timeout_rate": 0.0, "env_termination_rate": 0.01, "discounted_return": 0.7}
    of = {name: [value] * len(success) for name, value in (rest | {"success_length": 150.0}).items()}
    return {policy: of | {"success_rate": list(success)} for policy in ("sampled", "deterministic")}


@pytest.fixture
def zones(tmp_path):
    """A run of which two seeds were tested on z1 to z6, once with other texts."""
    made = write(tmp_path / "any-zones", all_runs()["any-zones"].config, seeds=(24, 25))
    tasks = {name: figures((1.0, 0.99)) for name in suites.ZONE_Z} | {"z6": figures((1.0, 0.9))}
    exchanged = {name: figures((0.1, 0.1)) for name in suites.ZONE_Z}
    content = {"zones": {"scale": "full", "tasks": tasks}, "texts exchanged": {"scale": "full", "tasks": exchanged}}
    (made.path / tested.FILE).write_text(json.dumps(content))
    (made.path / met.FILE).write_text(
        json.dumps({"exactly": {"z1": "3/5"}, "renamed": {"z1": "4/5"}, "rows": {"exactly": 9, "renamed": 8}})
    )
    return made
