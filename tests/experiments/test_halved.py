"""Why one seed is not twice as fast on two GPUs, its axis, and where compiling goes, by stored measurements."""

import json

import pytest

from experiments.reproduction.compiling import compiling
from experiments.reproduction.halved import FILE, halved
from experiments.reproduction.only_seed import only_seed

WHERE = {"git_revision": "a" * 40, "devices": ["GPU"], "packages": {"jax": "1"}, "time": "2026-01-01"}


def profile(seconds, physics, frames):
    parts = {"physics": {"share": physics}, "clipping": {"share": 1 - physics - 0.001}, "resets": {"share": 0.001}}
    return {"seconds": seconds, "parts": parts, "frames": frames}


@pytest.fixture
def stored(tmp_path):
    of = {"x:mjx:8": profile(0.5, 0.8, 400), "x:mjx:4": profile(0.3, 0.5, 200)}
    (tmp_path / FILE).write_text(json.dumps({"where": WHERE, "profiles": of, "note": "Alone."}))
    return tmp_path


def benchmark(folder, name, devices, rate, commit="a"):
    row = {"part": "training", "what": "x:mjx:8", "size": "1 seed", "unit": "frames/s", "rate": rate}
    row |= {"slowest": rate, "fastest": rate, "devices": devices}
    where = WHERE | {"devices": ["GPU"] * devices, "git_revision": commit * 40}
    (folder / f"benchmark_{name}.json").write_text(json.dumps({"version": 1, "where": where, "rows": [row]}))


def test_parts_are_compared_by_their_time_and_small_ones_left_out(stored):
    said = halved(stored)
    assert "| physics | 400 ms | 150 ms | 2.67 |" in said and "| an iteration | 500 ms | 300 ms | 1.67 |" in said
    assert "resets" not in said and "Two GPUs" not in said


def test_what_two_devices_make_is_of_the_same_commit(stored):
    benchmark(stored, "one", 1, 1000.0)
    benchmark(stored, "two", 2, 1500.0)
    benchmark(stored, "other", 2, 1900.0, commit="b")
    said = " ".join(halved(stored).split())
    assert "make 1.50 times the frames/s of one" in said and "1.67 times as many" in said


def test_steps_of_compiling_follow_each_other(tmp_path):
    assert compiling(tmp_path) == halved(tmp_path) == "Not measured yet."
    stored = {"where": WHERE, "training": "x", "seeds": 2, "seconds": 10.0, "without_profiler": 9.0, "note": "Alone."}
    (tmp_path / "trial_compiling.json").write_text(json.dumps(stored | {"steps": [["a", 0.0, 4.0], ["b", 4.0, 10.0]]}))
    assert "| b | 4.0 s | 6.0 s | 60% |" in compiling(tmp_path)


def test_a_batch_is_compared_with_and_without_an_axis_of_seeds(stored):
    assert only_seed(stored) == "Not measured yet."
    took = {(0, 4): 4.0, (1, 4): 6.0, (2, 4): 5.0, (0, 8): 5.0, (1, 8): 6.0}
    rows = [{"seeds": s, "num_envs": n, "milliseconds": ms} for (s, n), ms in took.items()]
    made = {"jax": "1", "what": "a step", "device": "GPU", "environments": 4}
    forms = [{"shape": "one seed", "kernels": 3, "rows_last": 2}]
    trial = {"where": WHERE, "note": "Alone.", "rows": rows, "compiled": made | {"forms": forms}}
    (stored / "trial_only_seed.json").write_text(json.dumps(trial))
    said = " ".join(only_seed(stored).split())
    assert "| 2 x 4 | 8 | 5.00 ms | 625000 ns |" in said and "| one seed | 3 | 2 |" in said
    assert "1.50 times as long with 4 environments and 1.20 times as long with 8 environments" in said
    # 50 steps of 0.3 s and 0.5 s, of which each would be 2 ms and 1 ms shorter
    assert "`x:mjx:8` 1.11 times as fast and of `x:mjx:4` 1.50 times as fast" in said
