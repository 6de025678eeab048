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


HELP = """
import os, runpy, sys
import cattrs, flax, jax, mujoco, numpy, optax, scipy.spatial, scipy.stats, trimesh, tyro  # silent
assert not {"brax", "mujoco.mjx", "t2tl_jax"} & set(sys.modules)
folder, *names = sys.argv[1:]
sys.path[0] = os.path.abspath("examples")  # as for a script
for name in names:
    if os.fork() == 0:
        for number, kind in ((1, "out"), (2, "err")):
            os.dup2(os.open(os.path.join(folder, f"{name}.{kind}"), os.O_CREAT | os.O_WRONLY), number)
        sys.argv = [f"examples/{name}.py", "--help"]
        runpy.run_path(sys.argv[0], run_name="__main__")
        sys.exit()
    assert os.wait()[1] == 0, name
"""
"""Every example in a child that begins with nothing of ours and nothing that prints; what else there is, loads once."""


@pytest.fixture(scope="module")
def helped(tmp_path_factory):
    """What each example printed with --help, and what it complained of."""
    folder = tmp_path_factory.mktemp("help")
    command = [sys.executable, "-c", HELP, str(folder), *EXAMPLES]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    ends = {name: [(folder / f"{name}.{kind}").read_text() for kind in ("out", "err")] for name in EXAMPLES}
    assert done.returncode == 0, (done.stderr, ends)
    return ends


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_help_says_how_each_is_run(name, helped):
    out, err = helped[name]
    assert out.startswith(f"usage: {name}.py"), out + err
    assert f"python examples/{name}.py" in out and err == ""


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
