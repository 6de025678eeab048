"""The GPU is started while modules load, by who is about to train."""

import jax
import pytest

from experiments import run
from experiments.cli import cpu_devices, early_start


@pytest.fixture
def started(monkeypatch):
    """What was put on a device, and how often a number of devices was asked for."""
    done = []
    monkeypatch.setattr(cpu_devices, "use", lambda: done.append("devices"))
    real = jax.device_put
    monkeypatch.setattr(jax, "device_put", lambda x: (done.append("put"), real(x))[1])
    return done


@pytest.mark.parametrize("words", [(), ("--config", "zone_ppo"), ("--resume", "runs/a", "--frames=10")])
def test_a_training_starts_its_device(words, started):
    early_start.begin(words).join()
    assert started == ["devices", "put"]


@pytest.mark.parametrize(
    ("words", "several"),
    [
        (("--help",), False),
        (("--config", "zone_ppo", "-h"), False),
        (("--list", "True"), False),
        (("--import", "my_module", "--config", "mine"), False),
        (("--import=my_module",), False),
        (("--hosts=node1:1234,2,0",), False),
        ((), True),
    ],
)
def test_others_do_not(words, several, started):
    assert early_start.begin(words, several) is None and not started


def test_what_fails_is_left_to_the_training(started, monkeypatch):
    def fail(x):
        raise RuntimeError("no memory")

    monkeypatch.setattr(jax, "device_put", fail)
    early_start.begin(()).join()  # of whose errors pytest would tell
    assert started == ["devices"]


@pytest.mark.parametrize("words", [["--config", "zone_pqo"], ["--config", "zone_ppo", "--hosts", "nowhere"]])
def test_the_command_begins_with_it_where_it_may(words, started, monkeypatch):
    """Mistakes are found meanwhile."""
    threads = []
    monkeypatch.setattr(early_start, "begin", lambda *given, begin=early_start.begin: threads.append(begin(*given)))
    assert run.main(words) == 2
    for thread in threads:
        thread.join()
    assert started == ([] if "--hosts" in words else ["devices", "put"])
