"""What the page says of loops as CUDA graphs: rates before and after, and the trial."""

import json

import pytest

from experiments.reproduction import graphs
from experiments.reproduction.stored import REPOSITORY

RESULTS = REPOSITORY / "results"


@pytest.fixture
def benchmark(tmp_path):
    """Writes a benchmark of one training."""

    def write(name, time, rate, devices=("GPU",), memory=100.0, **where):
        row = {"part": "training", "what": "a", "size": "12 seeds", "unit": "frames/s", "devices": len(devices)}
        row |= dict.fromkeys(("rate", "slowest", "fastest"), rate) | {"memory_mib": memory}
        about = {"time": time, "devices": devices, "git_revision": time * 8, "packages": {"jax": "1"}} | where
        (tmp_path / name).write_text(json.dumps({"version": 1, "where": about, "settings": {}, "rows": [row]}))

    return write


def test_a_rate_stands_beside_the_newest_one_before_on_the_same_devices(tmp_path, benchmark):
    benchmark("benchmark_a.json", "1" * 5, 10.0)
    benchmark("benchmark_b.json", "2" * 5, 20.0)
    benchmark("benchmark_changed.json", "3" * 5, 25.0, git_modified=True)
    benchmark("benchmark_two.json", "3" * 5, 30.0, ("GPU", "GPU"))
    benchmark("benchmark_later.json", "9" * 5, 90.0)
    benchmark(graphs.AFTER[0], "5" * 5, 50.0, memory=200.0)
    shown = graphs.graphs(tmp_path)
    assert "| a | 12 seeds | 1 | 20 frames/s | 2222222 | 50 frames/s | 2.50 | 100 -> 200 | - |" in shown
    assert shown.count("| a |") == 1


def test_without_a_counterpart_nothing_is_shown(tmp_path, benchmark):
    benchmark(graphs.AFTER[0], "5" * 5, 50.0)
    assert graphs.graphs(tmp_path) == "Not measured yet."


def test_the_trial_is_shown_with_its_ratios(tmp_path):
    stored = json.loads((RESULTS / graphs.TRIAL).read_text())
    stored["iterations"] = [
        {"what": "a", "seeds": 1, "machine": 4, "seconds": {"JAX": [0.2, 0.1, 0.3], "both": [0.1, 0.1, 0.1]}}
    ]
    stored["same"]["deterministic_seconds"] = {}
    (tmp_path / graphs.TRIAL).write_text(json.dumps(stored))
    shown = graphs.graphs(tmp_path)
    assert "| `a` | 1 seed | 4 | 200 (100, 300) | - | - | 100 (100, 100), 2.00 |" in shown
    assert "which is not kept" in shown
