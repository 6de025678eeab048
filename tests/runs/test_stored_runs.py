"""What a run leaves behind, and that stopping and resuming changes nothing of it."""

import csv
import json
import shutil
from pathlib import Path

import jax
import numpy as np
import pytest
from PIL import Image

from experiments import run
from t2tl_jax.registry import AGENTS, Kind
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.experiment import build
from t2tl_jax.runs.folder import open_existing
from tests import fake_agent


def restored(folder):
    """The iteration and the training state of a run's newest checkpoint, keys as their data."""
    with Checkpoints(folder / "checkpoints") as checkpoints:
        iteration, state = checkpoints.restore(build(open_existing(folder)[1]).program.stored)
    data = jax.tree.map(
        lambda x: jax.random.key_data(x) if jax.dtypes.issubdtype(x.dtype, jax.dtypes.prng_key) else x, state
    )
    return iteration, jax.tree.map(np.asarray, data)


def assert_same_run(one, other):
    assert (one / "metrics.csv").read_bytes() == (other / "metrics.csv").read_bytes()
    (a, left), (b, right) = restored(one), restored(other)
    assert a == b
    jax.tree.map(np.testing.assert_array_equal, left, right)


@pytest.mark.slow
def test_files_of_a_run(train, read_json, drawn):
    # Later tests evaluate as many episodes, so that they share a program.
    folder = train("--frames", "1e3", "--seeds", "0,5", "--run.evaluation-episodes", "400")
    assert read_json(folder / "config.json")["frames"] == 1000
    assert read_json(folder / "versions.json")["started"]["packages"]["jax"] == jax.__version__
    assert read_json(folder / "status.json")["state"] == "finished"
    assert (folder / "tensorboard" / "seed_5").is_dir()
    with Image.open(folder / "learning_curve.png") as picture:
        picture.load()
    rows = list(csv.DictReader((folder / "metrics.csv").open()))
    assert [(row["iteration"], row["seed"]) for row in rows] == [(str(i), s) for i in range(1, 11) for s in "05"]
    assert {row["frames"] for row in rows if row["iteration"] == "3"} == {"300"}
    assert any(row["episodes"] == "0" for row in rows)
    for row in rows:
        assert "nan" not in row.values()
        assert (row["success_rate"] == "") == (row["episodes"] == "0")
    policies = read_json(folder / "evaluation.json")["evaluations"][0]["policies"]
    assert [seed["seed"] for seed in policies["sampled"]["seeds"]] == [0, 5]


def test_frames_are_rounded_up_and_explained(train, capsys):
    folder = train("--frames", "250", "--run.evaluation-episodes", "0")
    assert "300 frames per seed = 3 iterations x 100 (asked for 250: +50" in capsys.readouterr().out
    assert restored(folder)[0] == 3


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """A run of two seeds and twelve iterations that nothing disturbed. Not to be changed."""
    base = tmp_path_factory.mktemp("long")
    flags = ["--config", "fake", "--run.folder", str(base), "--frames", "1200", "--seeds", "2"]
    assert run.main([*flags, "--run.evaluation-episodes", "0"]) == 0
    (folder,) = (base / "fake").iterdir()
    return folder


@pytest.mark.slow
def test_training_longer_equals_training_long(long, train, resume):
    """Also after a process that was killed before its next checkpoint, whose rows behind the last one are dropped."""
    short = train("--frames", "600", "--seeds", "2", "--run.evaluation-episodes", "0")
    killed = Path(shutil.copytree(short, short.parent / "killed"))
    with (killed / "metrics.csv").open("a") as file:
        file.write("7,700,0,1,1,0,0,0,0.5,1,10,7,0.1,0.2\n7,700,1,1,1,0,0,0,0.5,1,10,7,0.1,0.2\n8,800,0,1")
    for folder in (short, killed):
        assert resume(folder, "--frames", "1200") == 0
        assert_same_run(long, folder)


@pytest.mark.slow
def test_a_run_without_checkpoint_starts_over(long, resume, tmp_path):
    broken = Path(shutil.copytree(long, tmp_path / "broken"))
    shutil.rmtree(broken / "checkpoints")
    assert resume(broken) == 0
    assert_same_run(long, broken)


@pytest.mark.slow
def test_a_damaged_checkpoint_is_said_and_changes_nothing(train, resume, evaluate_run, capsys):
    """The one before it is taken, to be evaluated and to go on from."""
    whole = train("--frames", "300", "--run.evaluation-episodes", "0", "--run.checkpoint-period", "0")
    broken = train("--frames", "300", "--run.evaluation-episodes", "0", "--run.checkpoint-period", "0")
    for path in (broken / "checkpoints" / "3" / "latest").rglob("*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[:-1])
    capsys.readouterr()
    assert evaluate_run(broken, "--episodes", "4") == 0
    assert "note: cannot read 'latest' of checkpoint" in capsys.readouterr().out
    for path in (broken / "checkpoints" / "3" / "state").rglob("*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[:-1])
    assert resume(broken, "--run.evaluation-episodes", "0") == 0
    shown = capsys.readouterr().out
    assert "note: cannot read 'state' of checkpoint" in shown and "resuming after iteration 2" in shown
    assert_same_run(whole, broken)
    assert (broken / "damaged_checkpoints" / "3").is_dir()


@pytest.mark.slow
def test_replay_goes_with_the_end_of_a_run_unless_it_is_to_go_on(train, resume, monkeypatch, capsys):
    """A learner whose optimiser's state is called its replay."""

    def make(*given):
        return fake_agent.make_agent(*given)._replace(replay="opt_state")

    monkeypatch.setitem(AGENTS._kinds, "fake", Kind(fake_agent.FakeConfig, make))
    plain = ("--run.evaluation-episodes", "0", "--run.checkpoint-period", "0")
    whole = train("--frames", "400", *plain)
    assert not list(whole.glob("checkpoints/*/replay")) and len(list(whole.glob("checkpoints/*/state"))) == 2
    assert resume(whole, *plain) == 0  # it is complete
    before = {name: (whole / name).read_bytes() for name in ("config.json", "versions.json", "status.json")}
    assert resume(whole, "--frames", "500", *plain) == 2
    assert before == {name: (whole / name).read_bytes() for name in before}  # what is refused leaves the run as it was
    assert "its replay is not kept: it can be evaluated, but not trained further" in capsys.readouterr().err
    kept = train("--frames", "300", *plain, "--run.keep-replay", "True")
    assert len(list(kept.glob("checkpoints/*/replay"))) == 2
    assert resume(kept, "--frames", "400", *plain, "--run.keep-replay", "False") == 0
    assert (kept / "metrics.csv").read_bytes() == (whole / "metrics.csv").read_bytes()
    info = "checkpoints/4/info/metadata"  # with a checksum of every array
    assert (kept / info).read_bytes() == (whole / info).read_bytes()


@pytest.mark.slow
def test_each_seed_equals_a_run_of_that_seed_alone(train):
    together = train("--frames", "500", "--seeds", "0,3,7", "--run.evaluation-episodes", "0")
    alone = train("--frames", "500", "--seeds", "3,", "--run.evaluation-episodes", "0")
    _, many = restored(together)
    _, single = restored(alone)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a[1], b[0], rtol=1e-4, atol=1e-5), many, single)


@pytest.mark.slow
def test_resuming_a_finished_run_says_so(finished, resume, capsys):
    folder = finished
    before = (folder / "metrics.csv").read_bytes()
    assert resume(folder) == 0
    assert "are done" in capsys.readouterr().out
    assert (folder / "metrics.csv").read_bytes() == before


@pytest.mark.slow
def test_evaluation_command(train, evaluate_run, read_json, capsys):
    folder = train("--frames", "200", "--seeds", "2", "--run.evaluation-episodes", "0")
    assert evaluate_run(folder, "--episodes", "400", "--which", "final") == 0
    assert evaluate_run(folder, "--episodes", "400", "--which", "best", "--task", "F Red", "--episode-length", "4") == 0
    assert evaluate_run(folder, "--episodes", "400", "--which", "final") == 0  # replaces the first
    evaluations = read_json(folder / "evaluation.json")["evaluations"]
    assert [entry["settings"]["task"] for entry in evaluations] == ["F Red", "!Black U Red"]
    assert evaluations[0]["settings"]["episode_length"] == 4
    rate = evaluations[1]["policies"]["deterministic"]["seeds"][0]["success_rate"]
    assert rate["low"] < 0.6 < rate["high"] and rate["count"] == 400
    assert "mean" in capsys.readouterr().out


def test_resuming_a_finished_run_keeps_its_speed(finished, resume, read_json):
    before = read_json(finished / "status.json")
    assert resume(finished) == 0
    assert read_json(finished / "status.json")["last_session"] == before["last_session"]


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda run: shutil.rmtree(run / "checkpoints"), "no complete checkpoint"),
        (lambda run: [shutil.rmtree(step / "best") for step in (run / "checkpoints").iterdir()], "cannot read 'best'"),
        (lambda run: (run / "config.json").unlink(), "is not a run"),
        (lambda run: (run / "config.json").write_text("{"), "not valid JSON"),
        (lambda run: shutil.rmtree(run), "there is no folder"),
    ],
)
def test_damaged_runs_give_a_message(finished, evaluate_run, capsys, damage, said):
    folder = finished
    damage(folder)
    capsys.readouterr()
    assert evaluate_run(folder) == 2
    message = capsys.readouterr().err
    assert said in message and message.count("\n") < 25


@pytest.mark.parametrize("linked", ["checkpoints", "metrics.csv", "checkpoints/deep/inside"])
def test_a_run_that_holds_a_link_is_refused(finished, resume, evaluate_run, tmp_path, capsys, linked):
    """From a stranger it could lead into another run, which would be read and written."""
    place, victim = finished / linked, tmp_path / "victim"
    victim.mkdir()
    if place.exists():
        place.rename(tmp_path / "aside")
    place.parent.mkdir(parents=True, exist_ok=True)
    place.symlink_to(victim)
    capsys.readouterr()
    for command in (lambda: resume(finished, "--frames", "400"), lambda: evaluate_run(finished)):
        assert command() == 2
        message = capsys.readouterr().err
        assert f"{place.name} is a link to {victim}" in message and "Traceback" not in message
    assert not any(victim.iterdir())


def test_a_run_may_be_reached_by_a_link(finished, evaluate_run, tmp_path):
    (tmp_path / "here").symlink_to(finished)
    assert evaluate_run(tmp_path / "here") == 0


def test_limits_that_a_stored_configuration_raises_are_told(finished, evaluate_run, capsys):
    data = json.loads((finished / "config.json").read_text())
    data["limits"] |= {"max_rows": 2_000_000_000, "max_cells": 2**45}
    (finished / "config.json").write_text(json.dumps(data))
    capsys.readouterr()
    assert evaluate_run(finished) == 0
    said = capsys.readouterr().out
    assert "note: " in said and "raises limits of tables" in said
    assert "max_rows=2,000,000,000 (4,096 by default)" in said and "max_tokens" not in said


def test_resume_refuses_other_settings(finished, resume, capsys):
    folder = finished
    assert resume(folder, "--learner.rate", "0.1") == 2
    assert "not --learner.rate" in capsys.readouterr().err
    data = json.loads((folder / "config.json").read_text())
    data["seeds"] = "3,"
    (folder / "config.json").write_text(json.dumps(data))
    assert resume(folder, "--frames", "400") == 2
    assert "other seeds" in capsys.readouterr().err


def test_a_folder_in_use_is_refused(finished, resume, capsys):
    from t2tl_jax.runs.folder import RunFolder, locked

    folder = finished
    with locked(RunFolder(folder)):
        assert resume(folder) == 2
    assert "another process" in capsys.readouterr().err


@pytest.mark.slow
def test_a_run_stops_when_it_has_converged(train, resume, read_json, capsys):
    flags = ("--convergence.window", "5", "--convergence.delta", "10", "--run.evaluation-episodes", "0")
    folder = train("--frames", "5e3", *flags)
    status = read_json(folder / "status.json")
    assert status["state"] == "finished" and 10 <= status["iteration"] < 50
    assert f"converged after iteration {status['iteration']} of at most 50" in capsys.readouterr().out
    assert resume(folder) == 0
    assert f"converged after iteration {status['iteration']} of at most 50" in capsys.readouterr().out
    assert read_json(folder / "status.json")["iteration"] == status["iteration"]

    stopped = train("--frames", "500", *flags)
    assert resume(stopped, "--frames", "5e3") == 0
    assert_same_run(folder, stopped)
    assert resume(folder, "--convergence.window", "0") == 0
    assert read_json(folder / "status.json")["iteration"] == 50
