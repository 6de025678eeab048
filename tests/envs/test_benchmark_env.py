"""The benchmark measures what it says, on a tiny size."""

import json
import subprocess
import sys

import pytest

from experiments.benchmarks.env import BenchmarkConfig, main, report, resolve


@pytest.mark.slow
def test_benchmark_reports_every_combination(tmp_path):
    file = tmp_path / "speed.json"
    config = BenchmarkConfig(physics=("closed_form",), num_envs=(2, 4), steps=5, repeats=2, layout="random", json=file)
    results = report(config)
    assert [(r["physics"], r["num_envs"]) for r in results] == [("closed_form", 2), ("closed_form", 4)]
    assert all(0 < r["slowest"] <= r["steps_per_s"] <= r["fastest"] for r in results)
    written = json.loads(file.read_text())
    assert written["config"]["steps"] == 5 and written["results"] == results


@pytest.mark.slow
@pytest.mark.parametrize(
    ("env", "expected"), [("waterworld", "straight_flight"), ("letterworld", "grid"), ("flatworld", "steps")]
)
def test_benchmark_measures_other_worlds(env, expected, capsys):
    assert main(["--env", env, "--num-envs", "4", "--steps", "5", "--repeats", "2"]) == 0
    physics, num_envs, _, speed, _, _ = capsys.readouterr().out.splitlines()[-1].split()
    assert (physics, num_envs) == (expected, "4") and float(speed.replace(",", "")) > 0


def test_defaults_follow_the_environment():
    zones, water = resolve(BenchmarkConfig()), resolve(BenchmarkConfig(env="waterworld"))
    assert (zones.physics, zones.task, zones.episode_length) == (("mjx", "closed_form"), "phi_zone", 1000)
    assert (water.physics, water.task, water.episode_length) == (("straight_flight",), "phi_water", 600)
    assert resolve(BenchmarkConfig(env="letterworld")).episode_length == 75
    assert resolve(BenchmarkConfig(env="flatworld")).episode_length == 500


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--env", "waterworld", "--physics", "mjx"], "waterworld has no physics mjx; known: straight_flight"),
        (["--task", "phi_zon"], 'did you mean "phi_zone"'),
        (["--task", "F Green", "--physics", "closed_form"], 'unknown proposition "Green"; known: Black'),
        (["--num-envs", "0"], "num_envs are batch sizes, one or more of at least 1, got (0,)"),
        (["--json", "no/such/speed.json"], "there is no folder no/such; make it first"),
        (["--repeats", "0"], "repeats must be at least 1, got 0"),
        (["--step", "5"], "did you mean '--steps'"),
    ],
)
def test_mistakes_are_explained(flags, said, capsys):
    assert main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and not printed.out


def test_mistakes_are_answered_without_jax():
    code = (
        "import sys, experiments.benchmarks.env as m; m.main(['--task', 'phi_zon']); m.main(['--steps', '0']); "
        "sys.exit('jax' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stderr.count("error: ") == 2, done.stderr
