"""Checkpoints that are damaged, unfinished or cannot be written: the one before is as it was, and is used and said."""

import dataclasses
import itertools
import json
import os
import resource
import subprocess
import sys
import time
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tensorstore
from flax import struct

from t2tl_jax.errors import Note
from t2tl_jax.quiet import LEFT_LOOP, quiet_left_loops
from t2tl_jax.runs import checkpoints
from t2tl_jax.runs.checkpoints import CheckpointError, Checkpoints


@struct.dataclass
class State:
    params: dict
    key: jax.Array
    replay: object


def state(number: int) -> State:
    keys = jax.random.split(jax.random.key(number), 2)
    return State({"w": jnp.full((2, 300), number, jnp.float32)}, keys, {"obs": jnp.full((2, 50), number)})


def wanted(_):
    return {"state": state(0), "best": state(0).params}


@pytest.fixture
def folder(tmp_path):
    """Two checkpoints, of iterations 1 and 2."""
    with Checkpoints(tmp_path / "checkpoints") as checkpoints:
        for number in (1, 2):
            checkpoints.save(number, state(number), {"seeds": [0, 1]}, replay="replay")
    return tmp_path / "checkpoints"


def files_of(step, item):
    return [path for path in (step / item).rglob("*") if path.is_file() and path.stat().st_size]


def cut_off(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip_a_bit(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 8
    path.write_bytes(data)


def change_a_number(path):
    path.write_text(path.read_text().replace('"seeds": [0', '"seeds": [3').replace('"seeds":[0', '"seeds":[3'))


def lose(path):
    path.unlink()


DAMAGES = [(cut_off, "state"), (flip_a_bit, "state"), (flip_a_bit, "replay"), (lose, "best"), (cut_off, "info")]


@pytest.mark.parametrize(("damage", "item"), [*DAMAGES, (change_a_number, "info")])
def test_a_damaged_checkpoint_gives_way_to_the_one_before(folder, damage, item):
    for path in files_of(folder / "2", item):
        damage(path)
    said = rf"(?s)cannot read '{item}' of checkpoint .*2: .*of iteration 1"
    with Checkpoints(folder) as checkpoints, pytest.warns(Note, match=said):
        stored = checkpoints.read(wanted, "replay")
    assert (stored.iteration, stored.damaged) == (1, (2,))
    np.testing.assert_array_equal(stored.items["state"].params["w"], state(1).params["w"])
    np.testing.assert_array_equal(stored.items["state"].replay["obs"], 1)


def test_what_is_put_aside_is_not_in_the_way_of_those_to_come(folder):
    for path in files_of(folder / "2", "state"):
        flip_a_bit(path)
    with Checkpoints(folder) as checkpoints:
        with pytest.warns(Note):
            checkpoints.put_aside(checkpoints.read(wanted, "replay").damaged)
        checkpoints.save(2, state(2), {}, replay="replay")
        assert checkpoints.read(wanted, "replay").iteration == 2
    assert (folder.parent / "damaged_checkpoints" / "2" / "state").is_dir()


def test_where_all_are_damaged_the_newest_is_told(folder):
    for step in ("1", "2"):
        for path in files_of(folder / step, "state"):
            cut_off(path)
    with (
        Checkpoints(folder) as checkpoints,
        pytest.raises(CheckpointError, match=r"(?s)checkpoint .*/2: .*present: 1, 2"),
    ):
        checkpoints.read(wanted, "replay")


def test_another_configuration_is_no_damage(folder):
    other = dataclasses.replace(state(0), params={"w": jnp.zeros((2, 5))})
    with Checkpoints(folder) as checkpoints, pytest.raises(CheckpointError, match="belongs to another configuration"):
        checkpoints.read(lambda _: {"state": other}, "replay")


def write_blank(folder, shape, pieces):
    """In place of an array of the later checkpoint, one that says its shape and holds nothing, which reads as zeros."""
    place = {"driver": "ocdbt", "base": f"file://{folder}/2/state/", "path": "params.w/"}
    said = {"shape": shape, "chunks": pieces, "dtype": "<f4", "fill_value": 0}
    spec = {"driver": "zarr", "kvstore": place, "metadata": said, "create": True, "delete_existing": True}
    tensorstore.open(spec).result()


def most_memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 2**10


@pytest.mark.parametrize(
    ("shape", "pieces", "said"),
    [
        ([2**29], [2**29], r"params/w: float32\[536870912\] on disk, float32\[2, 300\] expected"),
        ([2, 300], [2**29, 1], r"params/w: stored in pieces of \[536870912, 1\], which are larger"),
    ],
)
def test_a_small_checkpoint_that_expands_is_not_read(folder, shape, pieces, said):
    write_blank(folder, shape, pieces)
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) < 2**18
    before = most_memory()
    with Checkpoints(folder) as checkpoints, pytest.raises(CheckpointError, match=said):
        checkpoints.read(wanted, "replay")
    assert most_memory() < before + 2**28, "of 2^31 bytes"


def test_what_does_not_fit_into_memory_is_refused(folder, monkeypatch):
    monkeypatch.setattr(os, "sysconf", {"SC_PHYS_PAGES": 1, "SC_PAGE_SIZE": 2**11}.get)
    with Checkpoints(folder) as checkpoints, pytest.raises(CheckpointError, match=r"'state' of .* GiB of memory"):
        checkpoints.read(wanted, "replay")


@pytest.mark.parametrize("jump", [-1e8, 1e8], ids=["back", "ahead"])
def test_a_clock_that_jumps_changes_nothing(folder, monkeypatch, jump):
    """Of whole runs: `test_clock.py`."""
    now = time.time() + jump
    monkeypatch.setattr(time, "time", lambda: now)
    monkeypatch.setattr(time, "time_ns", lambda: int(now * 1e9))
    with Checkpoints(folder) as checkpoints:
        checkpoints.save(3, state(3), {}, replay="replay")
        assert checkpoints.iterations() == [2, 3] and checkpoints.read(wanted, "replay").iteration == 3


def test_a_full_disk_is_told_and_leaves_the_one_before(folder, monkeypatch):
    with Checkpoints(folder) as checkpoints:
        manager = checkpoints._open()

        def full(step, **_):
            (folder / f"{step}.orbax-checkpoint-tmp").mkdir()
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(manager, "save", full)
        checkpoints.save(3, state(3), {}, replay="replay")
        with pytest.raises(CheckpointError, match=r"(?s)cannot write checkpoint .*3: .*No space left.*make room"):
            checkpoints.wait()
        assert not list(folder.glob("*tmp*"))
        assert checkpoints.read(wanted, "replay").iteration == 2


@pytest.mark.slow
def test_a_disk_that_really_is_full_is_told_without_tracebacks(tmp_path):
    command = [sys.executable, "-m", "tests.full_disk", str(tmp_path / "checkpoints")]
    child = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    said, make_room, complete, read = child.stdout.splitlines()
    assert said.startswith("cannot write checkpoint ") and "File too large" in said and len(said) < 500
    assert "make room" in make_room
    assert (complete, read) == ("complete: 1", "read: 1 True")
    assert "Traceback" not in child.stderr and "ERROR" not in child.stderr


def test_training_goes_on_while_a_checkpoint_is_written(tmp_path, monkeypatch):
    """The state's memory is reused at once, and the checkpoint holds what was there before."""
    moving = np.zeros((2, 300), np.float32)
    with Checkpoints(tmp_path) as checkpoints:
        manager, moments = checkpoints._open(), itertools.count()
        save = manager.save

        def slowly(*arguments, **options):
            moving[:] = 7
            next(moments)
            return save(*arguments, **options)

        monkeypatch.setattr(manager, "save", slowly)
        checkpoints.save(1, dataclasses.replace(state(1), params={"w": moving}), {})
        checkpoints.wait()
        restored = checkpoints.restore(state(0))[1]
    assert next(moments) == 1 and (moving == 7).all() and not restored.params["w"].any()


def test_the_replay_of_a_complete_run_is_left_out(folder):
    with Checkpoints(folder) as checkpoints:
        checkpoints.save(3, state(3), {}, replay="replay", last=True)
        stored = checkpoints.read(wanted, "replay")
        assert stored.iteration == 3 and stored.lacks_replay and stored.items["state"].replay == ()
    assert not list(folder.glob("*/replay"))  # nor in the one before, which is still read for its parameters
    assert json.loads((folder / "2" / "info" / "metadata").read_text())["stored"]["replay"] == "kept"


def test_a_state_of_a_version_with_another_replay_is_told(tmp_path, monkeypatch):
    """Early versions kept the replay within the state; one of the same form is read, another one is refused."""
    with Checkpoints(tmp_path) as checkpoints:
        checkpoints.save(1, state(1), {})
        checkpoints.wait()
        monkeypatch.setattr(checkpoints, "_info", lambda _: {})  # which said nothing of replay
        assert checkpoints.read(wanted, "replay").items["state"].replay["obs"].shape == (2, 50)
        other = dataclasses.replace(state(0), replay={"obs": jnp.zeros((2, 50)), "filled": jnp.zeros((2, 50))})
        with pytest.raises(CheckpointError, match=r"(?s)earlier version.*but not trained further"):
            checkpoints.read(lambda _: {"state": other}, "replay")


def test_what_is_said_of_left_loops_is_dropped_and_other_errors_are_heard(monkeypatch):
    heard = []
    monkeypatch.setattr(sys, "unraisablehook", heard.append)
    ours = sys.unraisablehook
    left, other = (SimpleNamespace(exc_value=error) for error in (RuntimeError(LEFT_LOOP), RuntimeError("another")))

    def say():
        for unraisable in (left, other):
            sys.unraisablehook(unraisable)

    with quiet_left_loops():
        say()
    assert heard == [other] and sys.unraisablehook == ours
    for _ in range(2):  # threads go on to say it
        with pytest.raises(OSError, match="full"), quiet_left_loops():
            raise OSError("full")
    say()
    assert heard == [other, other]


@pytest.mark.parametrize(("before", "begins"), [(0, "RESOURCE"), (400, "No space left on device: RESOURCE")])
def test_the_cause_of_a_long_message_is_told_wherever_it_stands(before, begins):
    message = f"RESOURCE_EXHAUSTED: {'x' * before} No space left on device [{'y' * 500}]"
    said = checkpoints._reason(OSError(message))
    assert said.startswith(begins) and said.count("No space left on device") == 1 and len(said) < 400


RESTORES = """
import sys, warnings
from pathlib import Path
from t2tl_jax.runs.checkpoints import Checkpoints
from tests.runs.test_checkpoints import state, wanted
warnings.simplefilter("ignore")
with Checkpoints(Path(sys.argv[1])) as checkpoints:
    print(checkpoints.read(wanted, "replay").iteration)
"""


@pytest.mark.parametrize("damage", [cut_off, lose])
def test_many_damaged_arrays_are_told_without_tracebacks(folder, damage):
    """In a process of its own: what is said of reads that were left goes by the interpreter's hook, not by pytest's."""
    for path in files_of(folder / "2", "state"):
        if path.parent.name == "d":
            damage(path)
    done = subprocess.run([sys.executable, "-c", RESTORES, str(folder)], capture_output=True, text=True, timeout=120)
    assert done.stdout.split() == ["1"] and "Traceback" not in done.stderr, done.stderr
