"""Processes that share a reproduction: what each is given, who is told of what, and that none is left behind."""

import os
import sys
import time

import pytest

from experiments.reproduction import launch
from t2tl_jax.runs.interrupts import StopRequest

NOTHING = {"a": {"NAME": "a"}, "b": {"NAME": "b"}}


def python(text):
    return [sys.executable, "-S", "-c", f"import os, signal, sys, time\nfrom pathlib import Path\n{text}"]


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    monkeypatch.setattr(launch, "POLL", 0.02)
    monkeypatch.setattr(launch, "APART", 0.0)


def run(command, tmp_path, environments=NOTHING, progress=lambda: "", stopped=lambda: False):
    said = []
    failed = launch.launch(lambda: command, environments, tmp_path / "logs", progress, stopped, said.append)
    return failed, said


def test_every_worker_sees_its_gpu_and_takes_memory_as_it_needs_it(monkeypatch):
    monkeypatch.delenv("JAX_PLATFORMS", raising=False)
    given = launch.worker_environments(2, {"0": "GPU-a", "GPU-5": "GPU-5"})
    assert list(given) == ["gpu-0-0", "gpu-GPU-5-0", "gpu-0-1", "gpu-GPU-5-1"]
    assert [extra["CUDA_VISIBLE_DEVICES"] for extra in given.values()] == ["GPU-a", "GPU-5"] * 2
    assert {extra["XLA_PYTHON_CLIENT_PREALLOCATE"] for extra in given.values()} == {"false"}
    assert {extra["JAX_PLATFORMS"] for extra in given.values()} == {"cuda,cpu"}
    assert launch.worker_environments(2, {}) == {"cpu-0": {}, "cpu-1": {}}


@pytest.mark.parametrize(
    ("environment", "present", "visible"),
    [
        ({}, {"0": "GPU-a", "1": "GPU-b"}, ["0", "1"]),
        ({"CUDA_VISIBLE_DEVICES": "1, GPU-a"}, {"0": "GPU-a", "1": "GPU-b"}, ["1", "GPU-a"]),
        ({"CUDA_VISIBLE_DEVICES": ""}, {"0": "GPU-a"}, []),
        ({"CUDA_VISIBLE_DEVICES": "0"}, {}, []),
    ],
)
def test_the_gpus_are_those_that_this_process_may_use(environment, present, visible, monkeypatch):
    monkeypatch.setattr(launch, "gpu_uuids", lambda: present)
    assert launch.visible_gpus(environment) == visible


def test_each_worker_runs_once_and_one_that_fails_is_told(tmp_path):
    text = f"Path({str(tmp_path)!r}, os.environ['NAME']).touch(exist_ok=False); print('hello')\n"
    failed, said = run(python(text + "sys.exit(3 * (os.environ['NAME'] == 'b'))"), tmp_path)
    assert (tmp_path / "a").is_file() and (tmp_path / "b").is_file()
    assert failed == ["b"] and any("b ended with exit code 3" in line for line in said)
    assert (tmp_path / "logs" / "a.log").read_text() == "hello\n"


@pytest.mark.parametrize(("ending", "tries"), [("sys.exit(75)", 3), ("os.abort()", 3), ("sys.exit(1)", 1)])
def test_a_worker_that_is_killed_or_lost_its_device_is_started_again(tmp_path, ending, tries):
    """Not one that says that something of its own failed; and the other one runs once."""
    log = tmp_path / "starts"
    text = f"with open({str(log)!r}, 'a') as file: file.write(os.environ['NAME'])\n"
    failed, said = run(python(f"{text}if os.environ['NAME'] == 'b': {ending}"), tmp_path)
    assert failed == ["b"] and sorted(log.read_text()) == sorted("a" + "b" * tries)
    assert sum("started again" in line for line in said) == tries - 1


def test_a_worker_that_lost_its_device_goes_on_where_it_left_off(tmp_path):
    text = f"first = Path({str(tmp_path)!r}, os.environ['NAME']); known = first.exists(); first.touch()\n"
    failed, said = run(python(f"{text}sys.exit(75 * (not known))"), tmp_path)
    assert not failed and sum("started again" in line for line in said) == 2


def test_nothing_is_started_again_once_the_time_is_up_or_the_user_wants_to_stop(tmp_path, monkeypatch):
    words = [python("sys.exit(75)"), python("sys.exit(75)"), [], []]
    failed = launch.launch(lambda: words.pop(0), NOTHING, tmp_path / "logs", lambda: "", lambda: False, print)
    assert sorted(failed) == ["a", "b"] and not words
    failed, said = run(python("sys.exit(75)"), tmp_path, stopped=lambda: True)
    assert sorted(failed) == ["a", "b"] and not any("is started again" in line for line in said)
    failed, said = run(python("os.kill(os.getpid(), signal.SIGTERM)"), tmp_path)  # by somebody who wants it
    assert sorted(failed) == ["a", "b"] and not any("is started again" in line for line in said)
    commands = []
    monkeypatch.setattr(launch, "launch", lambda command, *_: commands.append(command) or [])
    for minutes in (1.0, -1.0):
        launch.launch_workers(1, ["--only", "x"], minutes, tmp_path, lambda: "", StopRequest())
    first, second = (command() for command in commands)
    assert second == [] and first[3:6] == ["--only", "x", "--minutes"] and 0.9 < float(first[6]) < 1.0


def test_a_client_of_mps_is_started_again_when_the_others_of_its_gpu_have_ended(tmp_path):
    """The first of a GPU loses it at once, the second a little later, and that of another GPU works on."""
    mps = {launch.MPS: "pipe"}
    environments = {name: {"NAME": name, launch.GPU: gpu, **mps} for name, gpu in (("a", "0"), ("b", "0"), ("c", "1"))}
    log = tmp_path / "told"
    log.touch()
    text = f"""
name, log = os.environ['NAME'], Path({str(log)!r})
first = Path({str(tmp_path)!r}, name); known = first.exists(); first.touch()
while not known and len(log.read_text()) < {{'a': 0, 'b': 1, 'c': 4}}[name]: time.sleep(0.01)
time.sleep(0.2 * (name == 'b' and not known))
with log.open('a') as file: file.write(name)
sys.exit(75 * (name != 'c' and not known))
"""
    failed, said = run(python(text), tmp_path, environments)
    again = [line[0] for line in said if "is started again" in line]
    assert not failed and sorted(again) == ["a", "b"]
    assert log.read_text()[:2] == "ab" and sorted(log.read_text()[2:4]) == ["a", "b"] and log.read_text()[4:] == "c"
    ended = [k for k, line in enumerate(said) if "b ended with exit code 75" in line]
    assert min(k for k, line in enumerate(said) if "is started again" in line) > ended[0]


def test_a_client_of_mps_that_hangs_is_not_waited_for_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(launch, "PATIENCE", 0.3)
    monkeypatch.setenv(launch.MPS, "pipe")  # by the user's own service, too
    second = tmp_path / "second"
    text = f"""
second, first = Path({str(second)!r}), Path({str(tmp_path)!r}, os.environ['NAME'])
while os.environ['NAME'] == 'b' and not second.exists(): time.sleep(0.01)
known = first.exists(); first.touch()
if os.environ['NAME'] == 'a' and known: second.touch()
sys.exit(75 * (os.environ['NAME'] == 'a' and not known))
"""
    failed, said = run(python(text), tmp_path, {name: {"NAME": name, launch.GPU: "0"} for name in "ab"})
    assert not failed and sum("is started again" in line for line in said) == 1


def test_a_client_of_mps_that_crashed_by_itself_is_started_again_at_once(tmp_path):
    environments = {name: {"NAME": name, launch.GPU: "0", launch.MPS: "pipe"} for name in "ab"}
    second = tmp_path / "second"
    text = f"""
second, first = Path({str(second)!r}), Path({str(tmp_path)!r}, os.environ['NAME'])
while os.environ['NAME'] == 'b' and not second.exists(): time.sleep(0.01)
known = first.exists(); first.touch()
if os.environ['NAME'] == 'a': second.touch() if known else os.abort()
"""
    failed, _ = run(python(text), tmp_path, environments)
    assert not failed and second.exists()


def test_progress_is_said_when_it_changes(tmp_path):
    command = python(f"time.sleep(0.3); Path({str(tmp_path / 'done')!r}).touch(); time.sleep(0.3)")
    _, said = run(command, tmp_path, progress=lambda: str((tmp_path / "done").exists()))
    assert said == ["False", "True"]


CAREFUL = """
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have it ignored in the background
try:
    Path(os.environ['FOLDER'], os.environ['NAME'] + '.ready').touch()
    time.sleep(60)
except KeyboardInterrupt:
    Path(os.environ['FOLDER'], os.environ['NAME'] + '.saved').touch()
"""


@pytest.fixture
def both_ready(tmp_path, monkeypatch):
    monkeypatch.setenv("FOLDER", str(tmp_path))
    return lambda: all((tmp_path / f"{name}.ready").exists() for name in NOTHING)


def test_workers_save_when_the_user_wants_to_stop(tmp_path, both_ready):
    failed, _ = run(python(CAREFUL), tmp_path, stopped=both_ready)
    assert not failed and all((tmp_path / f"{name}.saved").exists() for name in NOTHING)


def test_a_worker_that_does_not_heed_is_ended(tmp_path, both_ready, monkeypatch):
    monkeypatch.setattr(launch, "PATIENCE", 0.2)
    deaf = CAREFUL.replace("signal.default_int_handler", "signal.SIG_IGN")
    failed, said = run(python(deaf), tmp_path, stopped=both_ready)
    assert sorted(failed) == ["a", "b"] and any("exit code -9" in line for line in said)


def test_workers_end_when_what_started_them_fails(tmp_path, both_ready):
    def broken():
        if both_ready():
            raise OSError("disk")
        return ""

    with pytest.raises(OSError, match="disk"):
        run(python(CAREFUL), tmp_path, progress=broken)
    deadline = time.monotonic() + 20
    while not all((tmp_path / f"{name}.saved").exists() for name in NOTHING) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert all((tmp_path / f"{name}.saved").exists() for name in NOTHING)


@pytest.fixture
def control(tmp_path, monkeypatch):
    """A program in the place of MPS's that writes down what it is told."""
    program, log = tmp_path / "bin" / "nvidia-cuda-mps-control", tmp_path / "told"
    program.parent.mkdir()
    told = f'echo "$@ $CUDA_MPS_PIPE_DIRECTORY $CUDA_VISIBLE_DEVICES" >> {log}'
    program.write_text(f'#!/bin/sh\n{told}\n[ "$1" = -d ] || cat >> {log}\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    monkeypatch.delenv("CUDA_MPS_PIPE_DIRECTORY", raising=False)
    return log


def test_the_service_runs_while_it_is_needed(control):
    with launch.multi_process_service(True, ["GPU-a", "GPU-c"]) as clients:
        pipe = clients["CUDA_MPS_PIPE_DIRECTORY"]
        assert os.path.isdir(pipe) and control.read_text() == f"-d {pipe} GPU-a,GPU-c\n"
    assert control.read_text().endswith("quit\n") and not os.path.exists(pipe)


def test_the_service_and_its_workers_name_the_same_gpu(control, tmp_path, monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    monkeypatch.setattr(launch, "gpu_uuids", lambda: {"0": "GPU-a", "1": "GPU-b"})
    given = {}
    monkeypatch.setattr(launch, "launch", lambda command, environments, *rest: given.update(environments) or [])
    launch.launch_workers(2, [], 1.0, tmp_path, lambda: "", StopRequest())
    assert control.read_text().splitlines()[0].endswith(" GPU-b")
    assert {own["CUDA_VISIBLE_DEVICES"] for own in given.values()} == {"GPU-b"} and len(given) == 2


def test_a_service_that_runs_already_or_is_not_wanted_is_left_alone(control, monkeypatch):
    with launch.multi_process_service(False, ["GPU-a"]) as clients:
        assert clients == {}
    monkeypatch.setenv("CUDA_MPS_PIPE_DIRECTORY", "/somewhere")
    with launch.multi_process_service(True, ["GPU-a"]) as clients:
        assert clients == {}
    assert not control.exists()
