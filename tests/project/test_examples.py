"""Every example runs, does what it says, and fits on a page."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
LINES = 80


def example(name: str):
    return importlib.import_module(f"examples.{name}")


def test_which_there_are():
    wanted = ["ltl_alone", "own_encoder", "own_environment", "own_learner", "own_logger", "quickstart"]
    assert wanted == EXAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_each_fits_on_a_page_and_says_how_it_is_run(name):
    text = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8")
    assert len(text.splitlines()) < LINES
    assert f"python examples/{name}.py" in text and 'if __name__ == "__main__":' in text


def test_ltl_alone_finds_its_way(capsys):
    left = example("ltl_alone").main(episodes=800)
    assert left[-1] == "true" and "!lava U door" in left
    assert capsys.readouterr().out.count("\n") == len(left)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_help_says_how_each_is_run(name):
    command = [sys.executable, f"examples/{name}.py", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=120)
    assert done.returncode == 0 and done.stdout.startswith(f"usage: {name}.py"), done.stdout + done.stderr
    assert f"python examples/{name}.py" in done.stdout and done.stderr == ""


@pytest.mark.slow
def test_quickstart(capsys, tmp_path):
    run = example("quickstart").main(frames=4096, folder=str(tmp_path))
    assert run.iteration == 4 and (tmp_path / "run" / "metrics.csv").exists()
    assert "the policy on the whole task" in capsys.readouterr().out


@pytest.mark.slow
def test_own_environment():
    run = example("own_environment").main(frames=4096)
    assert run.experiment.table.num_letters == 4  # every set of the two propositions
    assert run.metrics["env_distance"].shape == (1, 2)


@pytest.mark.slow
def test_own_encoder():
    run = example("own_encoder").main(frames=2048)
    assert "task_encoder" in run.params["final"]["params"]


@pytest.mark.slow
def test_own_learner_learns(capsys):
    rates = example("own_learner").main(frames=20_480)
    assert len(rates) == 20
    assert rates[0] < 0.9 < rates[-1] and capsys.readouterr().out.count("\n") == 10


@pytest.mark.slow
def test_own_logger(tmp_path):
    mlflow = pytest.importorskip("mlflow", reason="needs the extra mlflow: pip install -e '.[test]'")
    result = example("own_logger").main(frames=2048, store=str(tmp_path))
    client = mlflow.MlflowClient(tmp_path.as_uri())
    (experiment,) = (found for found in client.search_experiments() if found.name == "t2tl_jax")
    runs = client.search_runs([experiment.experiment_id])
    assert len(runs) == 2 and {run.info.status for run in runs} == {"FINISHED"}
    for run in runs:
        seed = int(run.info.run_name.rpartition(" ")[2])
        logged = client.get_metric_history(run.info.run_id, "frames")
        assert [point.value for point in logged] == list(result.metrics["frames"][seed])
