"""The fixtures of `tests/fake_runs.py` and `tests/any_runs.py`, and runs of the plan that nobody trained."""

from types import SimpleNamespace

import pytest

from experiments import play
from experiments.reproduction import claims
from experiments.reproduction.runs import all_runs
from tests.any_runs import zones
from tests.fake_runs import evaluate_run, finished, finished_run, read_json, resume, train
from tests.made_up_runs import write

__all__ = ["configs", "evaluate_run", "finished", "finished_run", "make", "read_json", "resume", "train", "zones"]


@pytest.fixture(scope="session")
def configs():
    """The configuration of each planned run, by name."""
    return {name: run.config for name, run in all_runs().items()}


@pytest.fixture
def make(configs, tmp_path):
    """Writes the run of a name, as it would be configured."""
    return lambda name, **written: write(tmp_path / name, configs[name], **written)


@pytest.fixture
def unpaired(monkeypatch):
    """Environments need not be built to see whether seeds share maps: `test_claims.py` does that."""
    monkeypatch.setattr(claims, "worlds", lambda config, seeds: None)


@pytest.fixture(autouse=True)
def uncollected(monkeypatch):
    """The command that plays collects all garbage of its process: here that of the whole session, half a second each
    time, of which none is its own."""
    monkeypatch.setattr(play, "gc", SimpleNamespace(unfreeze=int, collect=int, freeze=int))
