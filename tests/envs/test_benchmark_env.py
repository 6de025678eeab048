"""The benchmark measures what it says, on a tiny size."""

import json

import pytest

from experiments.benchmark_env import BenchmarkConfig, main, resolve


@pytest.mark.slow
def test_benchmark_reports_every_combination(tmp_path):
    file = tmp_path / "speed.json"
    config = BenchmarkConfig(physics=("closed_form",), num_envs=(2, 4), steps=5, repeats=2, layout="random", json=file)
    results = main(config)
    assert [(r.physics, r.num_envs) for r in results] == [("closed_form", 2), ("closed_form", 4)]
    assert all(0 < r.slowest <= r.steps_per_s <= r.fastest for r in results)
    written = json.loads(file.read_text())
    assert written["config"]["steps"] == 5 and len(written["results"]) == 2


def test_benchmark_measures_waterworld():
    (result,) = main(BenchmarkConfig(env="waterworld", num_envs=(4,), steps=5, repeats=2))
    assert result.physics == "straight_flight" and result.steps_per_s > 0


def test_defaults_follow_the_environment():
    zones, water = resolve(BenchmarkConfig()), resolve(BenchmarkConfig(env="waterworld"))
    assert (zones.physics, zones.task, zones.episode_length) == (("mjx", "closed_form"), "phi_zone", 1000)
    assert (water.physics, water.task, water.episode_length) == (("straight_flight",), "phi_water", 600)
    with pytest.raises(ValueError, match="waterworld has no physics mjx"):
        resolve(BenchmarkConfig(env="waterworld", physics=("mjx",)))
