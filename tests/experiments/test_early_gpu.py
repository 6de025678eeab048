"""The GPU is made ready while modules load: when, and what becomes of its errors."""

import subprocess
import sys
from importlib.metadata import EntryPoint

import jax
import pytest

from experiments import run, sweep
from experiments.cli import early_gpu, hosts
from experiments.sweeps import work
from t2tl_jax import registry
from t2tl_jax.errors import UserError
from t2tl_jax.runs import train
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


COMMANDS = {run: (), sweep: ("--grid", "learner.discount=0.9,0.95")}
"""With the flags of their own."""


@pytest.fixture
def trained(begun, monkeypatch):
    """What was begun, waited for and trained, in order; nothing is trained in truth."""

    def training(*_, **__):
        begun.append("trained")
        raise KeyboardInterrupt

    monkeypatch.setattr(train, "train", training)
    monkeypatch.setattr(work.Work, "train", training)
    return begun


@pytest.mark.parametrize("command", COMMANDS)
def test_a_run_and_a_sweep_wait_for_it_before_they_train(command, trained, tmp_path):
    assert command.main(["--config", "zone_ppo", "--run.folder", str(tmp_path), *COMMANDS[command]]) == 130
    assert trained == ["begun", "waited", "trained"]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_run_and_a_sweep_end_with_its_error_before_they_train(command, trained, tmp_path, monkeypatch):
    def wait():
        raise RuntimeError("this GPU fails")

    monkeypatch.setattr(early_gpu, "begin", lambda: wait)
    with pytest.raises(RuntimeError, match="this GPU fails"):
        command.main(["--config", "zone_ppo", "--run.folder", str(tmp_path), *COMMANDS[command]])
    assert not trained and not list(tmp_path.rglob("*.json"))


def test_mistakes_in_the_flags_of_a_sweep_are_found_before_it_is_begun(begun, capsys):
    assert sweep.main(["--config", "zone_ppo", "--batch", "many"]) == 2
    assert not begun and "--batch" in capsys.readouterr().err


def test_a_run_over_several_hosts_does_not_begin_before_they_have_met(begun, monkeypatch):
    def joined(given):
        raise UserError(f"{given.count} processes would meet here")

    monkeypatch.setattr(hosts, "joined", joined)
    assert run.main(["--config", "zone_ppo", "--hosts", "localhost:1234,2,0"]) == 2
    assert not begun


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


def in_a_process(script, *arguments):
    """What a process of its own says, and its exit code."""
    return subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True, timeout=120)


@pytest.mark.slow
def test_a_process_with_a_mistake_ends_with_its_exit_code_although_the_gpu_takes_longer():
    done = in_a_process("""
import sys, time
import jax
from experiments import run
put = jax.device_put
jax.device_put = lambda x: (time.sleep(6), print("ready"), put(x))[-1]
code = run.main(["--config", "zone_pqo"])
print("told")
sys.exit(code)
""")
    assert done.returncode == 2 and done.stdout.split() == ["told", "ready"] and "zone_ppo" in done.stderr


@pytest.mark.slow
def test_programs_are_kept_although_some_were_compiled_before_it_was_said_where(tmp_path):
    done = in_a_process(
        """
import os, sys
os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)
from experiments.cli import early_gpu
wait = early_gpu.begin()
import jax
jax.jit(lambda x: x + 1)(1)
from experiments.cli import compilation_cache
compilation_cache.use(sys.argv[1])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
wait()
jax.jit(lambda x: x * 3 + 1)(2)
""",
        str(tmp_path),
    )
    assert done.returncode == 0 and list(tmp_path.glob("*-cache")), done.stderr
