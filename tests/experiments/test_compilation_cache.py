"""Where compiled programs are kept."""

import json

import jax
import pytest

from experiments import play
from experiments.cli import compilation_cache
from t2tl_jax.errors import UserError
from t2tl_jax.runs import train
from t2tl_jax.runs.folder import open_existing


@pytest.fixture
def chosen(monkeypatch):
    """The folder that JAX will use, read anew at each call; put back afterwards."""
    before = jax.config.jax_compilation_cache_dir
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    yield lambda: jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", before)


def test_the_folder_is_made_and_used(tmp_path, chosen):
    compilation_cache.use(str(tmp_path / "a" / "b"))
    assert chosen() == str(tmp_path / "a" / "b") and (tmp_path / "a" / "b").is_dir()


def test_the_way_of_jax_comes_first(tmp_path, chosen, monkeypatch):
    before = chosen()
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "elsewhere")
    for folder in ("", str(tmp_path / "a")):
        compilation_cache.use(folder)
    assert chosen() == before and not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_explained(tmp_path, chosen):
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match=r"cannot create .*file/a \(Not a directory\)"):
        compilation_cache.use(str(tmp_path / "file" / "a"))


@pytest.fixture
def opened(finished, read_json, tmp_path, chosen, monkeypatch):
    """Of a run that names a folder for compiled programs: the run, that folder, and the default one of this machine."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "mine"))
    theirs, config = tmp_path / "theirs", read_json(finished / "config.json")
    config["run"]["compilation_cache"] = str(theirs)
    (finished / "config.json").write_text(json.dumps(config))
    return finished, theirs, tmp_path / "mine" / "t2tl_jax" / "xla"


@pytest.mark.slow
def test_programs_are_not_taken_from_a_folder_that_a_stored_run_names(opened, chosen, evaluate_run, resume, read_json):
    run, theirs, mine = opened
    assert evaluate_run(run, "--episodes", "4") == 0
    assert chosen() == str(mine) and not theirs.exists()
    assert resume(run, "--frames", "300") == 0
    assert chosen() == str(mine) and not theirs.exists()
    assert read_json(run / "config.json")["run"]["compilation_cache"] == str(mine)
    asked = mine.with_name("asked")
    assert resume(run, "--frames", "400", "--run.compilation-cache", str(asked)) == 0
    assert chosen() == str(asked) and asked.is_dir()


def test_nor_does_play_take_them(opened, monkeypatch):
    run, _, mine = opened
    asked = []
    monkeypatch.setattr(compilation_cache, "use", asked.append)

    def load(*_, **__):
        raise UserError("the fake learner reads no formulas")

    monkeypatch.setattr(train, "load", load)
    assert play.main([str(run)]) == 2 and asked == [str(mine)]


def test_a_run_that_had_none_has_none(finished):
    assert open_existing(finished)[1].run.compilation_cache == ""
