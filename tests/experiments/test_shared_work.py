"""How runs of the reproduction are done: in which order, by several processes, and what becomes of those that fail."""

import json
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import jax
import pytest

from experiments.reproduction import locks, work
from experiments.reproduction.plan import Run, Scale
from experiments.reproduction.runs import all_runs
from t2tl_jax.errors import UserError
from t2tl_jax.runs.checkpoints import CheckpointError
from t2tl_jax.runs.interrupts import NeverStop

ROOT = Path(__file__).parents[2]


def fake(name, done, fails=()):
    def measure(folder):
        if name in fails:
            raise ValueError("no luck")
        folder.mkdir()
        (folder / "status.json").write_text(json.dumps({"ended": "complete", "seeds": []}))
        done.append(name)

    return measure


def test_what_is_done_is_kept_what_fails_is_told_and_the_rest_goes_on(tmp_path):
    done, said = [], []
    runs = {name: Run(None, measure=fake(name, done, ("b",)), evaluated=False) for name in "abc"}
    scale, deadline = Scale("full", "1"), work.Deadline(1.0)
    assert work.do_all(runs, list("abc"), scale, tmp_path, deadline, NeverStop(), said.append) == ["b"]
    assert done == ["a", "c"] and any("no luck" in line for line in said)
    runs["b"] = Run(None, measure=fake("b", done), evaluated=False)
    assert work.do_all(runs, list("abc"), scale, tmp_path, deadline, NeverStop(), said.append) == []
    assert done == ["a", "c", "b"]
    assert work.do_all(runs, list("abc"), scale, tmp_path, work.Deadline(-1.0), NeverStop(), said.append) == []


@pytest.mark.parametrize(
    ("error", "cause", "traced"),
    [
        (UserError("no luck"), None, False),
        (UserError("no luck"), CheckpointError("no luck"), False),
        (UserError("no luck"), ValueError("shapes differ"), True),  # as training makes of a mistake in the program
        (RuntimeError("no luck"), None, True),
    ],
)
def test_what_a_message_explains_is_told_without_a_traceback(tmp_path, error, cause, traced):
    def measure(folder):
        raise error from cause

    said, runs = [], {"a": Run(None, measure=measure, evaluated=False)}
    assert work.do_all(runs, ["a"], Scale("full", "1"), tmp_path, work.Deadline(1.0), NeverStop(), said.append) == ["a"]
    assert any("failed: " in line and "no luck" in line for line in said)
    assert any("Traceback" in line for line in said) is traced


def test_a_run_that_may_lack_memory_is_done_once_more_at_the_end_and_then_alone(tmp_path, monkeypatch):
    done, said, claims, tries = [], [], [], dict.fromkeys("abd", 0)
    claimed = locks.claimed

    def noted(base, name, devices, alone):
        claims.append((name, alone))
        return claimed(base, name, devices, alone)

    monkeypatch.setattr(work, "claimed", noted)

    def short(name, times):
        def measure(folder):
            tries[name] += 1
            if tries[name] <= times:
                raise jax.errors.JaxRuntimeError("NOT_FOUND: All configs failed during profiling")
            fake(name, done)(folder)

        return Run(None, measure=measure, evaluated=False)

    runs = {"a": short("a", 1), "b": short("b", 9), "c": Run(None, measure=fake("c", done), evaluated=False)}
    scale, deadline = Scale("full", "1"), work.Deadline(1.0)
    assert work.do_all(runs, list("abc"), scale, tmp_path, deadline, NeverStop(), said.append) == ["b"]
    assert done == ["c", "a"] and tries == {"a": 2, "b": 2, "d": 0}
    assert claims == [("a", False), ("b", False), ("c", False), ("a", True), ("b", True)]
    runs = {"d": short("d", 1), "c": runs["c"]}  # another process has come to it before
    (tmp_path / f"d{work.CROWDED}").touch()
    assert work.do_all(runs, ["d"], scale, tmp_path, deadline, NeverStop(), said.append) == ["d"]
    assert tries["d"] == 1 and claims[-1] == ("d", True)


@pytest.mark.parametrize("alone", [False, True])
def test_a_process_whose_device_is_lost_leaves_the_other_runs_to_others(tmp_path, monkeypatch, alone):
    """The run that failed is marked, since it may have done it; those after it are not touched."""
    assert work.devices_answer()

    def measure(folder):
        raise jax.errors.JaxRuntimeError("INTERNAL: CUDA error: CUDA_ERROR_LAUNCH_FAILED: unspecified launch failure")

    def dead(*_):
        raise jax.errors.JaxRuntimeError("INTERNAL: CUDA error: Error recording CUDA event")

    monkeypatch.setattr(work.jax, "device_put", dead)
    assert not work.devices_answer()
    done = []
    runs = {"a": Run(None, measure=measure, evaluated=False, alone=alone)}
    runs["b"] = Run(None, measure=fake("b", done), evaluated=False, alone=alone)
    given = runs, ["a", "b"], Scale("full", "1"), tmp_path, work.Deadline(1.0), NeverStop(), print
    with pytest.raises(work.LostDeviceError) as raised:
        work.do_all(*given)
    assert not done and raised.value.failed == (["a"] if alone else [])
    marks = {path.suffix for path in tmp_path.iterdir()} & {work.LOSS, work.CROWDED}
    assert marks == (set() if alone else {work.LOSS})  # others may have caused it
    with pytest.raises(work.LostDeviceError):
        work.do_all(*given)
    assert alone or (tmp_path / f"a{work.CROWDED}").exists()  # the second time it is suspected, and done alone
    with pytest.raises(work.LostDeviceError):
        work.do_all({"a": runs["a"]}, ["a"], *given[2:])


def test_a_device_that_is_lost_between_two_runs_is_told_from_a_mistake(tmp_path, monkeypatch):
    def is_done(*_):
        raise jax.errors.JaxRuntimeError("INTERNAL: CUDA error")

    monkeypatch.setattr(work, "is_done", is_done)
    given = {"a": Run(None)}, ["a"], Scale("full", "1"), tmp_path, work.Deadline(1.0), NeverStop(), print
    with pytest.raises(jax.errors.JaxRuntimeError):
        work.do_all(*given)
    monkeypatch.setattr(work, "devices_answer", lambda: False)
    with pytest.raises(work.LostDeviceError):
        work.do_all(*given)


def test_a_device_whose_memory_is_full_answers(monkeypatch):
    def full(*_):
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory while trying to allocate 2097152 bytes.")

    monkeypatch.setattr(work.jax, "device_put", full)
    assert work.devices_answer()


def test_a_client_of_mps_that_waits_for_others_sees_that_its_device_is_lost(tmp_path, monkeypatch):
    monkeypatch.setattr(work, "WAIT", 0.01)
    monkeypatch.setattr(work, "LOOK", 0.02)
    monkeypatch.setattr(work, "devices_answer", lambda: False)
    runs = {"a": Run(None, measure=fake("a", []), evaluated=False)}

    def wait():
        return work.do_all(runs, ["a"], Scale("full", "1"), tmp_path, work.Deadline(0.002), NeverStop(), print)

    with locks.claimed(tmp_path, "a", (), alone=False) as mine:
        assert mine and wait() == []
        monkeypatch.setenv("CUDA_MPS_PIPE_DIRECTORY", "/somewhere")
        with pytest.raises(work.LostDeviceError):
            wait()


def test_a_run_that_may_lack_memory_has_failed_where_there_is_no_time_to_do_it_alone(tmp_path):
    def measure(folder):
        deadline.at = 0.0
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED")

    deadline, runs = work.Deadline(1.0), {"a": Run(None, measure=measure, evaluated=False)}
    assert work.do_all(runs, ["a"], Scale("full", "1"), tmp_path, deadline, NeverStop(), print) == ["a"]


@pytest.mark.parametrize("minutes", [1.0, -1.0])
def test_nothing_is_evaluated_once_the_time_is_up(tmp_path, monkeypatch, minutes):
    run, played = all_runs()["steps-4-1-rm"], []
    trained = SimpleNamespace(ended="complete", folder=tmp_path, config=run.config, params=None, iteration=1)
    trained.experiment = SimpleNamespace(with_config=lambda config: None)
    monkeypatch.setattr(work.train, "train", lambda *_, **__: trained)
    monkeypatch.setattr(work, "is_done", lambda *_: bool(played))
    monkeypatch.setattr(
        work.evaluations, "evaluate_policies", lambda experiment, params, episodes, limit: played.append(limit) or {}
    )
    ended = work.do(run, Scale("full", "1"), tmp_path, None, work.Deadline(minutes), NeverStop())
    assert (ended, played) == (("complete", [600, 1000]) if minutes > 0 else (work.OUT_OF_TIME, []))


def test_how_far_all_have_come_is_said_once_for_each_run_that_is_done(tmp_path):
    runs = {name: Run(None, measure=fake(name, []), evaluated=False) for name in "ab"}
    progress = work.Progress(runs, list(runs), Scale("full", "1"), tmp_path)
    said = [progress(), progress()]
    runs["b"].measure(tmp_path / "b")
    said += [progress(), progress()]
    runs["a"].measure(tmp_path / "a")
    assert [*dict.fromkeys([*said, progress(), progress()])] == [
        "0 of 2 runs are done",
        "1 of 2 runs are done: b",
        "2 of 2 runs are done: a",
    ]


def test_a_wish_to_stop_is_heard_between_runs(tmp_path):
    done, stop = [], SimpleNamespace(requested=False)
    first = fake("a", done)

    def measure(folder):
        first(folder)
        stop.requested = True

    runs = {"a": Run(None, measure=measure, evaluated=False), "b": Run(None, measure=fake("b", done), evaluated=False)}
    assert work.do_all(runs, ["a", "b"], Scale("full", "1"), tmp_path, work.Deadline(1.0), stop, print) == []
    assert done == ["a"]


def test_a_run_that_another_process_has_claimed_is_left_to_it(tmp_path, monkeypatch):
    done = []
    runs = {name: Run(None, measure=fake(name, done), evaluated=False) for name in "ab"}
    monkeypatch.setattr(work, "WAIT", 0.01)
    with locks.claimed(tmp_path, "a", (), alone=False) as mine:
        assert mine
        work.do_all(runs, ["a", "b"], Scale("full", "1"), tmp_path, work.Deadline(0.002), NeverStop(), print)
    assert done == ["b"]


@pytest.mark.parametrize(("first", "second", "together"), [(0, 0, True), (0, 1, False), (1, 0, False), (1, 1, False)])
def test_a_run_that_is_to_be_alone_shares_its_device_with_none(tmp_path, first, second, together):
    with locks.claimed(tmp_path, "a", ["gpu-0", "gpu-1"], bool(first)) as mine:
        assert mine
        with locks.claimed(tmp_path, "b", ["gpu-1", "gpu-2"], bool(second)) as other:
            assert other == together
        with locks.claimed(tmp_path, "c", ["gpu-3"], alone=True) as other:
            assert other
    with locks.claimed(tmp_path, "b", ["gpu-1", "gpu-2"], alone=True) as other:
        assert other


ELSEWHERE = """
import sys, time
from pathlib import Path
from experiments.reproduction import locks
with locks.claimed(Path(sys.argv[1]), "of another process", locks.device_names(), alone=False) as mine:
    print(mine, flush=True)
    sys.stdin.readline()
"""


@pytest.mark.slow
def test_a_run_that_is_to_be_alone_waits_for_other_processes_and_is_done_after_them(tmp_path, monkeypatch):
    """The ordinary run goes ahead beside the other process, which ends once this one has begun to wait."""
    done, when_waiting = [], []
    runs = {
        "timed": Run(None, measure=fake("timed", done), evaluated=False, alone=True),
        "ordinary": Run(None, measure=fake("ordinary", done), evaluated=False),
    }
    other = subprocess.Popen(
        [sys.executable, "-c", ELSEWHERE, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT
    )
    assert other.stdin is not None and other.stdout is not None

    def waiting(seconds):
        when_waiting.append(list(done))
        other.communicate(b"\n", timeout=60)

    # Not the module's own function: subprocess sleeps too while it waits for the other process to end.
    monkeypatch.setattr(work, "time", SimpleNamespace(sleep=waiting, monotonic=time.monotonic))
    with other:
        assert other.stdout.readline() == b"True\n"
        assert not work.do_all(runs, list(runs), Scale("full", "1"), tmp_path, work.Deadline(1.0), NeverStop(), print)
    assert when_waiting == [["ordinary"]] and done == ["ordinary", "timed"]


def test_runs_come_by_the_work_that_follows_on_them_and_those_alone_last():
    runs = all_runs()
    order = work.in_order(runs, list(runs))
    alone = [runs[name].alone for name in order]
    assert set(order) == set(runs) and alone == sorted(alone)
    place = {name: order.index(name) for name in runs}
    assert all(place[run.before] < place[name] for name, run in runs.items() if run.before is not None)
    early = [runs[name].early for name in order]
    assert any(early) and early == sorted(early, reverse=True)
    # What takes longest and needs nothing, then a pre-training that much waits for, then what takes less than that.
    assert place["rm-crm"] < place["zone-published-pretraining-transformer"] < place["zone-pretraining-transformer"]
    assert place["zone-pretraining-transformer"] < place["water-rm"] < place["search-zone-pretraining-gnn"]


def test_device_names():
    assert locks._device_name(1, [""], {"0": "GPU-a", "1": "GPU-b"}) == "GPU-b"
    assert locks._device_name(0, ["1"], {"0": "GPU-a", "1": "GPU-b"}) == "GPU-b"
    assert locks._device_name(0, ["GPU-b"], {"0": "GPU-a", "1": "GPU-b"}) == "GPU-b"
    assert locks._device_name(0, ["3"], {}).endswith("-3") and locks._device_name(2, [""], {}).endswith("-2")
    assert len(locks.device_names()) == 1  # the processor, however many devices it is made to look like
