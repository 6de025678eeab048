"""Runs that start with a pre-trained encoder need it once: whatever becomes of its run later, they can be resumed."""

import shutil
import time

import pytest

from t2tl_jax.errors import Note
from t2tl_jax.runs import experiment, pretraining
from t2tl_jax.runs.pools import make_table
from t2tl_jax.runs.start import start_params
from t2tl_jax.runs.train import load
from t2tl_jax.single_state import SingleStateConfig
from tests.fake_learner import PRETRAINING

pytestmark = pytest.mark.slow  # every test makes a run or two

NO_EVALUATION = ("--run.evaluation-episodes", "0")


@pytest.fixture
def source(train, tmp_path, monkeypatch):
    """A finished run whose task encoder others can start with, named relative to the current directory."""
    monkeypatch.chdir(tmp_path)
    return train("--frames", "200", *NO_EVALUATION).relative_to(tmp_path)


def test_a_run_goes_on_from_elsewhere_and_without_its_pretraining_run(
    train, resume, read_json, source, tmp_path, monkeypatch, capsys
):
    folder = train("--frames", "200", *NO_EVALUATION, "--pretrained", str(source))
    assert read_json(folder / "config.json")["pretrained"] == str(tmp_path / source)
    summary = read_json(folder / "status.json")["pretraining"]
    assert summary["task"] == "!Black U Red" and summary["frames_per_seed"] == 200

    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    begun_anew = shutil.copytree(folder, tmp_path / "begun_anew", ignore=shutil.ignore_patterns("checkpoints"))
    capsys.readouterr()
    assert resume(begun_anew) == 0
    said = "has no checkpoint yet, so it begins anew, and is pre-trained by what its config.json names"
    assert f"{said}: {tmp_path / source}\n" in capsys.readouterr().out  # a stranger's run names what it likes
    assert (begun_anew / "metrics.csv").read_bytes() == (folder / "metrics.csv").read_bytes()

    shutil.rmtree(tmp_path / source)
    assert resume(folder, "--frames", "400") == 0
    assert "begins anew" not in capsys.readouterr().out
    status = read_json(folder / "status.json")
    assert status["iteration"] == 4 and status["pretraining"] == summary
    shutil.rmtree(begun_anew / "checkpoints")
    capsys.readouterr()
    assert resume(begun_anew) == 2
    assert f"there is no folder {tmp_path / source}" in capsys.readouterr().err


def test_the_start_of_a_run_whose_pretraining_run_is_gone_is_a_new_network(train, source, tmp_path):
    path = train("--frames", "200", *NO_EVALUATION, "--pretrained", str(source))
    with pytest.warns(Note, match=f"encoder of the start is read from {tmp_path / source}, which the run names"):
        assert start_params(load(path)).origin == "pre-trained encoder"
    shutil.rmtree(tmp_path / source)
    begun = start_params(load(path))
    assert begun.origin.startswith("new network") and "there is no folder" in begun.problem


def test_a_run_with_a_checkpoint_does_not_prepare_its_own_pretraining_again(train, resume, read_json, monkeypatch):
    monkeypatch.setattr(pretraining, "SCHEDULE", PRETRAINING)
    begin = time.monotonic()
    folder = train("--frames", "200", *NO_EVALUATION, "--pretrained", "auto")
    wall = time.monotonic() - begin
    session = read_json(folder / "status.json")["last_session"]
    apart = [session[f"{name}_seconds"] for name in ("pretraining", "compile_wait", "training")]
    assert apart[0] > 0 and apart[2] > 0 and sum(apart) < wall  # no second is in two of them
    assert read_json(folder / "config.json")["pretrained"] == "auto"
    summary = read_json(folder / "status.json")["pretraining"]
    assert summary["folder"] == str(folder / "pretraining")

    def make(config, env):
        assert not isinstance(config.env, SingleStateConfig), "there is nothing to pre-train"
        return make_table(config, env)

    monkeypatch.setattr(experiment, "make_table", make)
    assert resume(folder, "--frames", "300") == 0
    assert read_json(folder / "status.json")["pretraining"] == summary
