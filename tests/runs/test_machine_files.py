"""A run whose task is a reward machine from a file keeps its own copy, which counts from then on."""

import dataclasses
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from experiments import run
from experiments.cli import request
from t2tl_jax.errors import Note, UserError
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs import config_files, experiment, pretraining
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.config import Config, RunConfig
from t2tl_jax.runs.differences import differences
from t2tl_jax.runs.pools import make_table
from tests.fake_learner import CONFIG, PRETRAINING

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
def met(monkeypatch) -> list[str]:
    """What is found in the files of the tasks of the experiments that are built."""
    texts: list[str] = []

    def make(config: Config, env):
        texts.append(Path(config.task).read_text())
        return make_table(config, env)

    monkeypatch.setattr(experiment, "make_table", make)
    return texts


@pytest.mark.slow
def test_later_changes_of_the_file_are_changes_of_no_run(
    train, resume, evaluate_run, machine, met, read_json, tmp_path, monkeypatch
):
    folder = train(*FLAGS)
    met.clear()
    machine.write_text(OTHER)
    moved = Path(shutil.move(folder, tmp_path / "moved"))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert resume(moved, "--frames", "300") == 0
    assert evaluate_run(moved, "--episodes", "4") == 0
    assert met == [MACHINE, MACHINE]
    assert read_json(moved / "config.json")["task"] == "mine.rm" and (moved / "mine.rm").read_text() == MACHINE
    # Whoever asks for the changed file gets it.
    assert evaluate_run(moved, "--episodes", "4", "--task", str(machine)) == 0
    assert met[-1] == OTHER
    tasks = [entry["settings"]["task"] for entry in read_json(moved / "evaluation.json")["evaluations"]]
    assert tasks == ["mine.rm", "mine.rm", str(machine), str(machine)]  # final and best parameters


def test_the_copy_is_what_gets_compiled(machine, tmp_path):
    config = dataclasses.replace(named_config("zone_ppo_closed_form"), task="mine.rm")
    _, own = run_folder.open_existing(run_folder.create(tmp_path / "run", config, {}).path)
    machine.unlink()
    table = make_table(own, make_env(own.env))
    assert table.states == ("done", "fail", "mine.a", "mine.b")


def test_a_configuration_from_a_file_reads_what_lies_beside_it(machine, tmp_path, monkeypatch):
    """A stranger's too: no other file of a task, no folder of compiled programs, and a note of the pre-training."""
    named = dataclasses.replace(CONFIG, task=str(machine), pretrained="/theirs")
    named = dataclasses.replace(named, run=dataclasses.replace(named.run, compilation_cache="/theirs"))
    file = tmp_path / "theirs" / "config.json"
    file.parent.mkdir()
    file.write_text(config_files.to_json(named))

    def given(*flags):
        return request.configuration(request.read(["--config", str(file), *flags]), "", "run")[0]

    with pytest.warns(Note, match="pre-trained by what .*config.json names: /theirs"), pytest.raises(UserError) as why:
        given()
    assert f"cp {machine} {file.parent / machine.name}" in str(why.value)
    asked = given("--task", str(machine), "--pretrained", "")  # what the command names is read
    assert asked.task == str(machine)
    shutil.copy(machine, file.parent)
    own = given("--pretrained", "")
    assert own.task == str(file.parent / machine.name) and own.run.compilation_cache == RunConfig().compilation_cache


def test_a_pretraining_is_named_as_seen_from_the_file(tmp_path, monkeypatch):
    """As stored runs name it; a flag names it as seen from here. Where runs are written, no file says."""
    named = dataclasses.replace(CONFIG, pretrained="../x")
    named = dataclasses.replace(named, run=dataclasses.replace(named.run, folder="/theirs"))
    file = tmp_path / "results" / "mine" / "config.json"
    file.parent.mkdir(parents=True)
    file.write_text(config_files.to_json(named))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")

    def given(path, *flags):
        return request.configuration(request.read(["--config", str(path), *flags]), "", "run")[0]

    for path in (file, Path("../results/mine/config.json")):
        with pytest.warns(Note, match="pre-trained by what .*config.json names: /.*x"):
            assert given(path).pretrained == str(tmp_path / "results" / "x")
    own = given(file, "--pretrained", "../x")
    assert pretraining.located(own).pretrained == str(tmp_path / "x") and own.run.folder == "runs"
    assert given(file, "--pretrained", "auto", "--run.folder", "elsewhere").run.folder == "elsewhere"


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("runs/zone_ppo/2026-01-31_12-00-00/config.json", "zone_ppo"),
        ("runs/zone_ppo/2026-01-31_12-00-00_2/config.json", "zone_ppo"),
        ("runs/zone_ppo/2026-01-31_12-00-00/pretraining/config.json", "pretraining"),
        ("results/any/zones/config.json", "zones"),
        ("results/any/zones/mine.json", "mine"),
        ("/config.json", "config"),
    ],
)
def test_runs_of_a_configuration_in_a_file_are_called_as_its_run(path, name, tmp_path, monkeypatch):
    assert run_folder.name_of(tmp_path / path) == name
    if not Path(path).is_absolute():
        (tmp_path / path).parent.mkdir(parents=True)
        monkeypatch.chdir((tmp_path / path).parent)
        assert run_folder.name_of(Path(Path(path).name)) == name


@pytest.mark.parametrize(
    ("pretrained", "read"),
    [("", ""), ("given", ""), ("auto", ""), ("auto:own", ""), ("auto:a.rm", "a.rm"), ("runs/given", "runs/given")],
)
def test_what_is_read_elsewhere_for_a_pretraining_is_known(pretrained, read):
    assert pretraining.elsewhere(SimpleNamespace(pretrained=pretrained)) == read


def test_runs_are_compared_by_what_their_machines_say(machine, tmp_path):
    config = dataclasses.replace(CONFIG, task="mine.rm")

    def stored() -> Config:
        path = run_folder.new_path(tmp_path / "runs", "fake")
        return run_folder.open_existing(run_folder.create(path, config, {}).path)[1]

    first, same = stored(), stored()
    assert first.task != same.task and not list(differences(first, same))
    machine.write_text(OTHER)
    other = stored()
    assert list(differences(first, other)) == [f"task={other.task}"]
    assert list(differences(first, CONFIG)) == ["task=!Black U Red"]


@pytest.mark.slow
def test_its_own_pretraining_keeps_a_copy_too(train, resume, machine, monkeypatch):
    monkeypatch.setattr(pretraining, "SCHEDULE", PRETRAINING)
    folder = train(*FLAGS, "--pretrained", "auto:own")
    machine.unlink()
    assert (folder / "pretraining" / "mine.rm").read_text() == MACHINE
    shutil.rmtree(folder / "checkpoints")  # so that the resumed run needs the pre-training again
    assert resume(folder) == 0


LINKED = "a link"


@pytest.mark.parametrize("named", ["mine.rm", "{folder}/mine.rm", "run/../mine.rm", LINKED])
def test_a_run_without_its_copy_reads_no_other_file(machine, tmp_path, named, read_json):
    """Nor does one whose copy is a link: what a configuration names may be anything on the machine."""
    folder = run_folder.create(tmp_path / "run", dataclasses.replace(CONFIG, task="mine.rm"), {})
    (folder.path / "mine.rm").unlink()
    said = r"(?s)holds no copy of it.* cp .*mine\.rm .*run/mine\.rm"
    if named == LINKED:
        (folder.path / "mine.rm").symlink_to(machine)
        said = r"run/mine\.rm is a link to .*mine\.rm; a run holds none"
    else:
        folder.config.write_text(json.dumps(read_json(folder.config) | {"task": named.format(folder=tmp_path)}))
    with pytest.raises(UserError, match=said):
        run_folder.open_existing(folder.path)
    (folder.path / "mine.rm").unlink(missing_ok=True)
    shutil.copy(machine, folder.path)
    assert run_folder.open_existing(folder.path)[1].task == str(folder.path / "mine.rm")


def test_a_file_that_is_not_there_is_explained_before_anything_is_written(tmp_path, capsys):
    flags = ["--config", "zone_ppo_closed_form", "--run.folder", str(tmp_path / "runs"), "--run.compilation-cache", ""]
    assert run.main([*flags, "--pretrained", "", "--task", str(tmp_path / "none.rm")]) == 2
    assert "cannot read the reward machine" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
