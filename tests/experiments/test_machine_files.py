"""A run whose task is a reward machine from a file keeps its own copy, which counts from then on."""

import dataclasses
import shutil
from pathlib import Path

import fake_learner
import pytest
from t2tl_jax.runs.build import make_table

from envs import registry
from experiments import evaluate, run
from experiments.compare import differences
from experiments.configs import CONFIGS, PRETRAINING, Config
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.convergence import ConvergenceConfig

MACHINE = "start -> a\notherwise -> stay\n\na -> b : Red\nb -> done : Black / 1\n"
OTHER = MACHINE.replace("Black", "Yellow")
FLAGS = ("--frames", "200", "--run.evaluation-episodes", "0", "--task", "mine.rm")


@pytest.fixture
def machine(tmp_path, monkeypatch) -> Path:
    """The file, in the current directory."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.rm"
    path.write_text(MACHINE)
    return path


@pytest.fixture
def met():
    """A way to build the fake learner, and what it finds in the files of the tasks it is given."""
    texts: list[str] = []

    def build(config: Config):
        texts.append(Path(config.task).read_text())
        return fake_learner.build(config)

    return build, texts


@pytest.mark.slow
def test_later_changes_of_the_file_are_changes_of_no_run(train, machine, met, read_json, tmp_path, monkeypatch):
    folder = train(*FLAGS)
    machine.write_text(OTHER)
    moved = Path(shutil.move(folder, tmp_path / "moved"))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    build, texts = met
    assert run.main(["--resume", str(moved), "--frames", "300"], build=build) == 0
    assert evaluate.main([str(moved), "--episodes", "4"], build=build) == 0
    assert texts == [MACHINE, MACHINE]
    assert read_json(moved / "config.json")["task"] == "mine.rm" and (moved / "mine.rm").read_text() == MACHINE
    # Whoever asks for the changed file gets it.
    assert evaluate.main([str(moved), "--episodes", "4", "--task", str(machine)], build=build) == 0
    assert texts[-1] == OTHER
    tasks = [entry["settings"]["task"] for entry in read_json(moved / "evaluation.json")["evaluations"]]
    assert tasks == ["mine.rm", str(machine)]


def test_the_copy_is_what_gets_compiled(machine, tmp_path):
    config = dataclasses.replace(CONFIGS["zone_ppo_closed_form"][0], task="mine.rm")
    _, own = run_folder.open_existing(run_folder.create(tmp_path / "runs", "zone", config, {}).path)
    machine.unlink()
    table = make_table(own, registry.make(own.env))
    assert table.states == ("done", "fail", "mine.a", "mine.b")


def test_runs_are_compared_by_what_their_machines_say(machine, tmp_path):
    config = dataclasses.replace(Config(), task="mine.rm")

    def stored() -> Config:
        return run_folder.open_existing(run_folder.create(tmp_path / "runs", "zone", config, {}).path)[1]

    first, same = stored(), stored()
    assert first.task != same.task and not list(differences(first, same))
    machine.write_text(OTHER)
    other = stored()
    assert list(differences(first, other)) == [f"task={other.task}"]
    assert list(differences(first, Config())) == ["task=phi_zone"]


@pytest.mark.slow
def test_its_own_pretraining_keeps_a_copy_too(train, resume, machine, monkeypatch):
    small = dataclasses.replace(PRETRAINING, frames=200, convergence=ConvergenceConfig())
    monkeypatch.setattr(pretraining, "PRETRAINING", small)
    folder = train(*FLAGS, "--pretrained", "auto:own")
    machine.unlink()
    assert (folder / "pretraining" / "mine.rm").read_text() == MACHINE
    shutil.rmtree(folder / "checkpoints")  # so that the resumed run needs the pre-training again
    assert resume(folder) == 0


def test_a_run_from_before_copies_reads_the_file_as_it_was_named(machine, tmp_path):
    folder = run_folder.create(tmp_path / "runs", "zone", dataclasses.replace(Config(), task="mine.rm"), {})
    (folder.path / "mine.rm").unlink()
    assert run_folder.open_existing(folder.path)[1].task == "mine.rm"


def test_a_file_that_is_not_there_is_explained_before_anything_is_written(tmp_path, capsys):
    flags = ["--config", "zone_ppo_closed_form", "--run.folder", str(tmp_path / "runs"), "--run.compilation-cache", ""]
    assert run.main([*flags, "--pretrained", "", "--task", str(tmp_path / "none.rm")]) == 2
    assert "cannot read the reward machine" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
