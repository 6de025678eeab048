"""The GPU is made ready while modules load: when, and what becomes of its errors."""

from importlib.metadata import EntryPoint

import jax
import pytest

from experiments import run, sweep
from experiments.cli import early_gpu
from t2tl_jax import registry
from t2tl_jax.training import compiler_options


@pytest.fixture
def broken(monkeypatch):
    """A GPU on which nothing can be put."""

    def fail(*_, **__):
        raise RuntimeError("Unable to initialize backend 'cuda'")

    monkeypatch.setattr(jax, "device_put", fail)


@pytest.fixture
def begun(monkeypatch):
    """What was begun, and what was waited for, in order."""
    events = []

    def begin():
        events.append("begun")
        return lambda: events.append("waited")

    monkeypatch.setattr(early_gpu, "begin", begin)
    return events


def declare(monkeypatch, value):
    """Let a package declare a plugin."""
    plugin = EntryPoint("theirs", value, registry.PLUGINS)
    monkeypatch.setattr(registry, "_plugins", lambda path: (plugin,))


def test_what_was_waited_for_is_done(monkeypatch):
    done = []
    monkeypatch.setattr(jax, "device_put", lambda x: done.append("put") or jax.numpy.asarray(x))
    monkeypatch.setattr(compiler_options, "compiler_options", lambda: done.append("options"))
    early_gpu.begin()()
    assert done == ["put", "options"]


@pytest.mark.usefixtures("broken")
def test_an_error_of_the_gpu_is_raised_where_it_is_waited_for():
    wait = early_gpu.begin()
    with pytest.raises(RuntimeError, match="Unable to initialize backend 'cuda'"):
        wait()


@pytest.mark.usefixtures("broken")
def test_a_run_and_a_sweep_end_with_that_error_and_write_nothing(tmp_path):
    flags = ["--config", "zone_ppo", "--run.folder", str(tmp_path)]
    for command in (run, sweep):
        with pytest.raises(RuntimeError, match="Unable to initialize backend 'cuda'"):
            command.main([*flags, *(["--grid", "learner.discount=0.9,0.95"] if command is sweep else [])])
    assert not list(tmp_path.rglob("*.json"))


@pytest.mark.parametrize("words", [["--import", "some_module"], ["--import=some_module"], ["--help"], ["--list"]])
def test_nothing_is_begun_with_a_module_of_the_users_or_for_help(words, begun):
    early_gpu.begin_for(["--config", "zone_ppo", *words])()
    assert not begun


def test_nothing_is_begun_where_jobs_train(begun):
    early_gpu.begin_for(["--config", "zone_ppo", "--workers=2", "--grid", "learner.discount=0.9,0.95"])()
    assert not begun


def test_nothing_is_begun_before_processes_find_each_other(begun):
    early_gpu.begin_for(["--config", "zone_ppo"], alone=False)()
    assert not begun


def test_nothing_is_begun_where_a_package_declares_a_plugin(begun, monkeypatch):
    declare(monkeypatch, "their_package.plugin")
    early_gpu.begin_for(["--config", "zone_ppo"])()
    assert not begun
    declare(monkeypatch, "experiments.configs")  # such as this project's own
    early_gpu.begin_for(["--config", "zone_ppo"])()
    assert begun == ["begun", "waited"]


def test_a_mistake_waits_for_no_gpu(begun, capsys):
    assert run.main(["--config", "zone_pqo"]) == 2
    assert begun == ["begun"] and "zone_ppo" in capsys.readouterr().err
