"""Two processes as one run: the numbers of one process, one that dies ends the other, and what is left goes on.

Their two devices train three seeds, and so four: nothing of the one that fills up is left behind.
"""

import contextlib
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from experiments import run
from experiments.cli import finding, hosts, last_words
from t2tl_jax import load, resume, train
from t2tl_jax.errors import UserError, explained
from t2tl_jax.registry import named_config
from t2tl_jax.training.devices import seed_sharding
from tests import two_hosts
from tests.runs.test_stored_runs import restored

# ----- who is who -----


def test_flag_and_variables():
    assert hosts.read(["--seeds", "2"], {}) == (["--seeds", "2"], None)
    assert hosts.read(["--hosts", "slurm", "--seeds", "2"], {}) == (["--seeds", "2"], hosts.Hosts("slurm"))
    assert hosts.read(["--hosts=node1:1234,4,3"], {}) == ([], hosts.Hosts("node1:1234", 4, 3))
    given = dict(zip(hosts.VARIABLES, ("node1:1234", "2", "1"), strict=True))
    assert hosts.read([], given) == ([], hosts.Hosts("node1:1234", 2, 1))
    for wrong in (
        "node1",
        "node1,2,0",
        "node1:1234,2,2",
        "node1:1234,2",
        "node1:1234,a,b",
        "node1:1234,²,0",
        "",
        ":1234,2,0",
        "node1:0,2,0",
    ):
        with pytest.raises(UserError, match="--hosts takes slurm, or HOST:PORT,COUNT,INDEX"):
            hosts.read(["--hosts", wrong], {})


class Device:
    """One of a host."""

    platform = "gpu"

    def __init__(self, process_index):
        self.process_index = process_index


def test_no_host_is_left_idle():
    devices = [Device(0), Device(0), Device(1), Device(1)]
    with pytest.raises(ValueError, match=r"work for 2 of 4 devices .* leaves 1 of 2 hosts idle"):
        seed_sharding(2, 16, devices=devices)
    with pytest.raises(ValueError, match=r"or spread each seed \(--run.devices-per-seed\)"):
        seed_sharding(1, 16, devices=devices)


# ----- who is alive -----


class Store(dict):
    """The store of names of `jax.distributed`, for one process."""

    def key_value_set(self, name, value, allow_overwrite=False):
        assert allow_overwrite or name not in self
        self[name] = value

    def key_value_dir_get(self, folder):
        if self.get("broken"):
            raise RuntimeError("UNAVAILABLE: connection refused")
        return [(name, value) for name, value in self.items() if name.startswith(folder)]


class Left(Exception):
    """Instead of the end of this process."""


@pytest.fixture
def left(monkeypatch):
    def leave(code):
        raise Left(code)

    monkeypatch.setattr(hosts, "_leave", leave)
    monkeypatch.setattr(hosts, "POLL", 0.01)
    monkeypatch.setattr(hosts, "PATIENCE", 0.1)


@pytest.mark.parametrize(
    ("store", "code", "said"),
    [
        ({"t2tl_jax/gone/1": "2 cannot create a run"}, "2", "error: cannot create a run\n"),
        ({"t2tl_jax/gone/1": "1 division by zero"}, "1", "process 1 of this run ended: division by zero\n"),
        ({"t2tl_jax/alive/1": "7"}, "1", "process 1 of this run ended: no sign of life for 0 seconds"),
        ({"broken": "yes"}, "1", "process 0 of this run ended: its store of names cannot be reached"),
    ],
)
def test_a_process_that_is_gone_is_noticed(store, code, said, left, monkeypatch, capsys):
    monkeypatch.setattr(hosts.threading.Thread, "start", lambda thread: None)
    monkeypatch.setattr("t2tl_jax.training.hosts.store", lambda: Store(store))
    with pytest.raises(Left, match=code):
        hosts.Watch()._look()
    words = capsys.readouterr().err
    assert said in words and ("--resume RUN" in words) == (code == "1")


def test_an_error_is_told_to_the_others(left, monkeypatch, capsys):
    store = Store()
    monkeypatch.setattr(hosts.threading.Thread, "start", lambda thread: None)
    monkeypatch.setattr("t2tl_jax.training.hosts.store", lambda: store)
    with pytest.raises(Left, match="2"):
        hosts.Watch().fail(UserError("no such folder\nbut others"))
    assert store == {"t2tl_jax/gone/0": "2 no such folder\nbut others"}
    assert capsys.readouterr().err == "error: no such folder\nbut others\n"


def test_the_first_process_leaves_last(left, monkeypatch):
    class Filling(Store):
        """In which the others say one after the other that they leave."""

        def key_value_dir_get(self, folder):
            before = super().key_value_dir_get(folder)
            self.setdefault("t2tl_jax/left/2" if before else "t2tl_jax/left/1", "")
            return before

    monkeypatch.setattr(hosts.threading.Thread, "start", lambda thread: None)
    monkeypatch.setattr("t2tl_jax.training.hosts.count", lambda: 3)
    monkeypatch.setattr(hosts, "PATIENCE", 60.0)
    store = Filling()
    monkeypatch.setattr("t2tl_jax.training.hosts.store", lambda: store)
    with pytest.raises(Left):
        hosts.Watch().fail(UserError("no such folder"))
    assert sum(name.startswith("t2tl_jax/left/") for name in store) == 2


def test_a_process_that_is_lost_is_not_waited_for(left, monkeypatch):
    """Process 1 leaves; process 2 cannot say so any more."""
    store = Store({"t2tl_jax/left/1": ""})
    monkeypatch.setattr(hosts.threading.Thread, "start", lambda thread: None)
    monkeypatch.setattr("t2tl_jax.training.hosts.count", lambda: 3)
    monkeypatch.setattr("t2tl_jax.training.hosts.store", lambda: store)
    monkeypatch.setattr(hosts, "PATIENCE", 4.0)
    began = time.monotonic()
    with pytest.raises(Left):
        hosts.Watch()._lost("2", "no sign of life")
    assert time.monotonic() - began < 2.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--help"], "zone_ppo"),
        (["--list"], "zone_ppo"),
        (["--config", "fake", "-h"], "zone_ppo"),
        (["--config", "fakes"], "did you mean 'fake'"),
        (["--config", "fake", "--frames", "many"], "--frames"),
        (["--config", "fake", "--frames", "-1"], "frames"),
        (["--resume", "nowhere"], "nowhere"),
    ],
)
def test_help_and_mistakes_wait_for_no_host(words, said, monkeypatch, capsys):
    monkeypatch.setattr(hosts, "_join", lambda given: pytest.fail("the hosts were joined"))
    with contextlib.suppress(SystemExit):
        run.main([*words, "--hosts", "node1:1234,2,0"])
    assert said in "".join(capsys.readouterr())


def test_an_error_of_the_runtime_may_be_of_any_kind():
    with pytest.raises(UserError) as caught, explained():
        raise ValueError("UNKNOWN: Gloo AllGather failed: Connection reset by peer")
    assert hosts._is_of_runtime(caught.value) and not hosts._is_of_runtime(UserError("unknown task"))


def test_an_abort_for_want_of_the_first_process_is_told_in_words():
    """And nothing else is: what is no abort, or one for another reason."""
    other = [b"W1125 07:28:32.908701 2152 slow.cc:1] slow\n", b"F1125 07:28:32.908701 2152 b.cc:1] Check failed\n"]
    fatal = b"F1125 07:28:10.1 1625 client.h:80] Terminating process because the JAX distributed service detected\n"
    met = last_words.MET
    assert list(last_words.readable([*other, met])) == other
    assert list(last_words.readable([met, other[0], fatal, b"*** trace\n"])) == [other[0], last_words.LOST.encode()]
    assert list(last_words.readable([b"half a line" + met, fatal])) == [b"half a line", last_words.LOST.encode()]
    assert list(last_words.readable([fatal, met])) == [last_words.NEVER_MET.encode()]


# ----- who looks for whom -----


@pytest.fixture
def look(monkeypatch, capsys):
    """What is said by a process that has looked for the first one for so many seconds."""

    def looked(address, seconds=0.3):
        monkeypatch.setattr(finding, "SOON", 0.1)
        state = SimpleNamespace(coordinator_address=address, process_id=1, num_processes=2)
        monkeypatch.setattr("jax._src.distributed.global_state", state)
        with finding.told():
            time.sleep(seconds)
        return capsys.readouterr().err

    return looked


def test_who_waits_for_long_says_for_whom(look):
    said = look("localhost:1234")
    assert "process 1 of 2 waits" in said and "at localhost:1234" in said and "know that name" not in said
    assert look("localhost:1234", seconds=0) == look(None) == ""


def test_a_name_that_leads_nowhere_is_told(look, monkeypatch):
    def nowhere(*_):
        raise OSError("Name or service not known")

    monkeypatch.setattr(finding.socket, "getaddrinfo", nowhere)
    assert "This host does not know that name: Name or service not known" in look("node7:1234")
    assert "know that name" not in look("dns:///node7:1234")  # which JAX looks up in a way of its own


def test_nothing_is_said_once_all_are_there(look, monkeypatch):
    monkeypatch.setattr(finding.socket, "getaddrinfo", lambda *_: time.sleep(0.4))
    assert look("localhost:1234", seconds=0.2) == ""


# ----- two processes -----


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hosts")
    command = [sys.executable, "-m", "tests.two_hosts", str(folder)]
    answer = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=500)
    assert answer.returncode == 0, answer.stderr
    return folder


def ended(folder, name):
    """Exit code and words of a process."""
    return int((folder / f"{name}.code").read_text()), (folder / f"{name}.log").read_text()


def seconds_to_end(folder, name, index):
    """From the death of the other process to the end of this one."""
    killed, end = (float((folder / file).read_text()) for file in (f"{name}.killed", f"{name}{index}.ended"))
    return end - killed


@pytest.mark.slow
def test_two_processes_give_the_numbers_of_one(folder):
    for name in ("alone", "together0", "together1"):
        code, said = ended(folder, name)
        assert code == 0, said
    for name in ("metrics.csv", "checkpoints/4/info/metadata"):  # which has a checksum of every array
        assert (folder / "alone" / name).read_bytes() == (folder / "together" / name).read_bytes()


@pytest.mark.slow
def test_filling_up_leaves_no_trace(folder, tmp_path):
    spread = Path(shutil.copytree(folder / "alone", tmp_path / "spread"))
    alone = train(two_hosts.CONFIG, folder=tmp_path / "alone")  # on one device
    (_, many), (_, one) = restored(spread), restored(tmp_path / "alone")
    np.testing.assert_allclose(many.params["params"]["w"], one.params["params"]["w"], rtol=1e-4, atol=1e-5)
    loaded = load(spread)
    assert loaded.metrics.keys() == alone.metrics.keys()
    for name, values in alone.metrics.items():
        np.testing.assert_allclose(loaded.metrics[name], values, rtol=1e-4, atol=1e-5, err_msg=name)
    assert resume(spread, frames=500).iteration == 5  # goes on where there is but one device


@pytest.mark.slow
@pytest.mark.parametrize("name", ["envs", "ppo"])
def test_the_environments_of_one_seed_over_two_processes(folder, name):
    """Of a little learner, and of PPO itself, whose gradients are summed over both."""
    alone = {"envs": two_hosts.environments_of_one_seed, "ppo": two_hosts.ppo_of_one_seed}[name](over=1)
    one, other = (np.load(folder / f"{name}{index}.npz").values() for index in (0, 1))
    for expected, mine, yours in zip(alone, one, other, strict=True):
        np.testing.assert_allclose(mine, expected, rtol=1e-4, atol=1e-6)
        np.testing.assert_array_equal(mine, yours)


@pytest.mark.slow
def test_what_all_processes_refuse_each_of_them_says(folder):
    for name in ("refused0", "refused1"):
        code, said = ended(folder, name)
        assert code == 2 and said.startswith("error: there is work for 2 of 4 devices"), said
        assert "leaves 1 of 2 hosts idle: take more seeds or fewer hosts" in said and said.count("\n") == 1, said
    assert not (folder / "refused").exists()


@pytest.mark.slow
def test_without_the_first_process_the_others_end_in_plain_words(folder):
    code, said = ended(folder, "headless1")
    assert code == 1 and "error: another process of this run ended, most likely process 0" in said, said
    assert "goes on from its last checkpoint with --resume RUN" in said and "***" not in said, said
    assert seconds_to_end(folder, "headless", 1) < 10
    (run,) = (folder / "headless" / "fake").iterdir()
    iteration, _ = restored(run)
    assert iteration > 0  # there is a checkpoint to go on from


@pytest.mark.slow
def test_one_that_dies_ends_the_other_and_the_run_goes_on_elsewhere(folder, tmp_path):
    code, said = ended(folder, "dying0")
    assert code == 1 and "process 1 of this run ended: no sign of life for 3 seconds" in said, said
    assert "The run goes on from its last checkpoint with --resume RUN" in said
    assert seconds_to_end(folder, "dying", 0) < 20

    (run,) = (folder / "dying" / "fake").iterdir()
    result = resume(run)  # on one device, in one process
    assert (result.iteration, result.ended) == (20, "complete")
    whole = train(replace(named_config("fake"), seeds="4", frames=2000), folder=tmp_path / "whole")
    (_, resumed), (_, expected) = restored(run), restored(tmp_path / "whole")
    np.testing.assert_allclose(resumed.params["params"]["w"], expected.params["params"]["w"], rtol=1e-4, atol=1e-5)
    curve, expected = (of.metrics["discounted_return"] for of in (result, whole))
    np.testing.assert_allclose(curve, expected, rtol=1e-3, atol=1e-4)
