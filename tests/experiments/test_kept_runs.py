"""Runs that are kept in the repository: from clean commits, without a machine's folders, with small parameters."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest

import t2tl_jax
import tests.fake_learner  # noqa: F401
from experiments import reproduce
from experiments.reproduction import stored
from t2tl_jax.errors import UserError
from t2tl_jax.registry import named_config
from t2tl_jax.runs import config_files, source_tree

ROOT = Path(__file__).parents[2]


def git(repository, *arguments):
    who = ["-c", "user.name=Nobody", "-c", "user.email=nobody@example.org", "-c", "commit.gpgsign=false"]
    done = subprocess.run(["git", "-C", repository, *who, *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture(scope="module")
def repository(tmp_path_factory):
    """A checkout of two commits, and a third one on a branch that is not checked out."""
    path = tmp_path_factory.mktemp("repository")
    git(path, "init", "--initial-branch", "main")
    git(path, "commit", "--allow-empty", "--message", "one")
    git(path, "branch", "side")
    git(path, "commit", "--allow-empty", "--message", "two")
    git(path, "checkout", "--quiet", "side")
    git(path, "commit", "--allow-empty", "--message", "three")
    git(path, "checkout", "--quiet", "main")
    return path


@pytest.fixture
def source(tmp_path, repository):
    """The folder of a run that was made from a commit before the one that is checked out."""
    path = tmp_path / "runs" / "run"
    path.mkdir(parents=True)
    made_from(path, git(repository, "rev-parse", "main~1"))
    return path


def made_from(path, revision, modified=False, **more):
    versions = {"git_revision": revision, "git_modified": modified}
    (path / "versions.json").write_text(json.dumps({"started": versions | more}))


@pytest.mark.parametrize(
    ("versions", "why"),
    [
        ({"git_revision": None}, "commit is not known"),
        ({"git_revision": "abc", "git_modified": None}, "whether its tree differed"),
        ({"git_revision": "abc", "git_modified": True}, "in some files"),
        ({"git_revision": "abc", "git_modified": True, "git_changed": ["results/a.json"]}, "in results/a.json"),
    ],
)
def test_results_of_a_modified_tree_are_not_kept(source, tmp_path, repository, versions, why):
    clean = json.loads((source / "versions.json").read_text())["started"]
    for sessions in ({"started": versions}, {"started": clean, "resumed": [versions]}):
        (source / "versions.json").write_text(json.dumps(sessions))
        with pytest.raises(UserError, match=f"clean commit.*{why}"):
            stored.keep("run", source, tmp_path / "kept", repository=repository)
    (source / "versions.json").write_text(json.dumps({"started": clean}))
    stored.keep("run", source, tmp_path / "kept", repository=repository)
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["versions.json"]


@pytest.mark.parametrize(("changed", "said"), [([], ""), (["results/a.json"], "in results/a.json: --keep will refuse")])
def test_that_nothing_will_be_kept_is_said_before_a_training(changed, said, tmp_path, monkeypatch, capsys):
    tree = {"git_revision": "abc", "git_modified": bool(changed), "git_changed": changed}
    monkeypatch.setattr(source_tree, "describe", lambda: tree)
    arguments = ["--only", "rm-ql", "--minutes", "1e-9", "--folder", str(tmp_path)]  # no time to train anything
    assert reproduce.main(arguments) == 0
    told = capsys.readouterr().err
    assert said in told and ("--keep" in told) is bool(changed)


def test_results_of_commits_that_nobody_could_look_up_are_not_kept(source, tmp_path, repository, monkeypatch):
    def kept(revision):
        made_from(source, revision)
        stored.keep("run", source, tmp_path / "kept", repository=repository)

    for name in ("main", "main~1"):
        kept(git(repository, "rev-parse", name))
    with pytest.raises(UserError, match="which is not in the history of what is checked out"):
        kept(git(repository, "rev-parse", "side"))
    with pytest.raises(UserError, match="git does not know commit 0123456"):
        kept("0123456789" * 4)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match="git cannot be asked"):
        kept("0123456789" * 4)


def test_what_is_kept_names_no_folder_of_the_machine(source, tmp_path, repository):
    command = [str(repository / "experiments" / "reproduce.py"), "--folder", str(tmp_path), f"--only={source}"]
    made_from(source, git(repository, "rev-parse", "HEAD"), command=command, xla_flags="--xla_dump_to=/home/me --x=1")
    config = replace(named_config("zone_ppo"), pretrained=str(source.parent / "before"), frames=3)
    config = replace(config, run=replace(config.run, compilation_cache="/home/me/cache"))
    (source / "config.json").write_text(config_files.to_json(config))
    stored.keep("run", source, tmp_path / "kept", repository=repository)
    known = json.loads((tmp_path / "kept" / "config.json").read_text())
    assert known["pretrained"] == "../before" and known["run"]["compilation_cache"] == "" and known["frames"] == 3
    versions = json.loads((tmp_path / "kept" / "versions.json").read_text())["started"]
    assert versions["command"] == ["experiments/reproduce.py", "--folder", tmp_path.name, "--only=../run"]
    assert versions["xla_flags"] == "--xla_dump_to=me --x=1"


@pytest.mark.parametrize(
    ("name", "seeds", "why"),
    [
        ("zone_ppo", "0,100", "seeds 100, on which settings were chosen.*--seeds 0,1,2"),
        ("zone_ppo_long", "12", "seeds 0-11, on which.*--seeds 12,13"),
        ("rm_water_ql", "4,5,6", "seeds 5-6, on which"),
    ],
)
def test_results_on_seeds_that_settings_were_chosen_on_are_not_kept(source, tmp_path, repository, name, seeds, why):
    """But for worlds of which there are no others: the page says which of them a search had."""
    config = replace(named_config(name), seeds=seeds)
    (source / "config.json").write_text(config_files.to_json(config))
    with pytest.raises(UserError, match=why):
        stored.keep("run", source, tmp_path / "kept", repository=repository)
    assert not (tmp_path / "kept").exists()
    stored.keep("run", source, tmp_path / "kept", repository=repository, every_world=True)
    assert (tmp_path / "kept" / "config.json").is_file()


def test_a_reproduction_on_tuning_seeds_is_refused_before_it_trains(capsys):
    arguments = ["--only", "fig-zone", "--scale", "full", "--seeds", "12,100", "--keep", "True"]
    assert reproduce.main(arguments) == 2
    assert "seeds from 100 on are kept for tuning" in capsys.readouterr().err


def test_what_is_stored_names_no_folder_of_a_machine():
    for file in reproduce.RESULTS.glob("*/*.json"):
        text = file.read_text(encoding="utf-8")
        assert '"/' not in text and "=/" not in text and "~/" not in text, file


def test_the_agent_of_the_first_seed_is_kept_where_it_is_small(tmp_path, repository, monkeypatch):
    source, said = tmp_path / "run", []
    result = t2tl_jax.train("fake", seeds=[7, 1], folder=source)
    made_from(source, git(repository, "rev-parse", "HEAD"))

    def kept():
        stored.keep("run", source, tmp_path / "kept", agent=True, say=said.append, repository=repository)
        return tmp_path / "kept"

    assert kept().joinpath("params.npz").stat().st_size < 10_000 and not said
    again = t2tl_jax.load(tmp_path / "kept")
    assert again.seeds == (7,) and again.iteration == result.iteration
    for which in ("final", "best"):
        jax.tree.map(
            lambda one, all_: np.testing.assert_array_equal(one, all_[:1]), again.params[which], result.params[which]
        )
    sizes = iter([2.1, 1.9])
    monkeypatch.setattr(stored, "_mebibytes", lambda file: next(sizes))
    final = t2tl_jax.load(kept()).params
    assert set(final) == {"final"} and "run: the final parameters alone are kept, in half precision, 1.9 MiB" in said[0]
    jax.tree.map(
        lambda one, all_: np.testing.assert_allclose(one, all_[:1], rtol=2**-11),
        final,
        {"final": result.params["final"]},
    )
    monkeypatch.setattr(stored, "_mebibytes", lambda file: 2.1)
    assert not kept().joinpath("params.npz").exists() and "run: parameters are not kept" in said[1]


def test_the_stored_sizes_are_those_of_the_networks(tmp_path):
    run = stored.Stored(ROOT / "results" / "paper" / "water-rm")
    shutil.copyfile(run.path / "config.json", tmp_path / "config.json")
    stored.keep_sizes(tmp_path)
    assert stored.Stored(tmp_path).sizes == run.sizes and run.sizes.code == 16
