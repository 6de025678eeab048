"""Pools that several processes draw: the same ones, the same training, and processes that never outlive it."""

import dataclasses
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future
from importlib import import_module
from pathlib import Path

import jax
import numpy as np
import pytest

import t2tl_jax
from t2tl_jax.agents.dp_config import DPConfig
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import Chains, Mixture, Named, TooLargeError, families
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs import pool_workers
from t2tl_jax.runs.config import PoolConfig, RunConfig, SelectionConfig
from t2tl_jax.runs.convergence import ConvergenceConfig
from t2tl_jax.runs.pools import make_pools
from t2tl_jax.runs.prefetch import Prefetch
from tests.agents.sizes import GRAPH
from tests.fake_runs import StopAfter

PRETRAINING = named_config("pretrain_zone")
CONFIG = dataclasses.replace(
    PRETRAINING,
    task=Mixture((Chains(depth=(1, 2)), Named("Until_1_2_1_1"))),
    learner=DPConfig(dataclasses.replace(PRETRAINING.learner.network, task_encoder=GRAPH), minibatch_size=16),
    pool=PoolConfig(size=4, rows=48, length=32, period=1),
    frames=160,
    convergence=ConvergenceConfig(),
    selection=SelectionConfig(points=0),
    run=RunConfig(evaluation_episodes=0, gif=False, progress=False, pool_processes=2),
)
ONE = dataclasses.replace(CONFIG, run=dataclasses.replace(CONFIG.run, pool_processes=1))
"""Where a single pool is drawn, which one process does however many there are: the others would only import."""
TESTS = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def path_of_others(monkeypatch):
    """Processes import what registered any family, so also what other tests have imported from here."""
    monkeypatch.syspath_prepend(TESTS / "extension")


def assert_equal(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


@pytest.mark.slow
@pytest.mark.parametrize("finish", [False, True])
def test_processes_draw_the_pools_of_their_numbers(finish):
    """Also those that hold the pool before as well."""
    config = dataclasses.replace(CONFIG, pool=dataclasses.replace(CONFIG.pool, finish=finish), episode_length=1)
    env = make_env(config.env)
    pools = make_pools(config, env)
    with pool_workers.executor(config, env) as workers:
        drawn = list(workers.map(pool_workers.draw, range(4)))
    for number, table in enumerate(drawn):
        assert_equal(table, pools.training(number))
    assert len({table.tokens.tobytes() for table in drawn}) == 4


@pytest.mark.slow
def test_a_run_is_the_same_whoever_draws_and_so_is_one_that_was_stopped(tmp_path, begins_quickly):
    """Five iterations, each with its pool; one run has a thread, one two processes, and one those after a stop."""
    thread = dataclasses.replace(CONFIG, run=dataclasses.replace(CONFIG.run, pool_processes=0))
    whole = t2tl_jax.train(thread, folder=tmp_path / "thread")
    assert whole.iteration == 5
    part = t2tl_jax.train(CONFIG, folder=tmp_path / "processes", callbacks=[StopAfter(2)])
    assert part.iteration == 2
    resumed = t2tl_jax.resume(tmp_path / "processes")
    assert_equal(whole.params["final"], resumed.params["final"])
    both = [(tmp_path / name / "metrics.csv").read_text() for name in ("thread", "processes")]
    assert both[0] == both[1] and ",agreement," in both[0]


@pytest.mark.slow
def test_families_of_somebody_else_are_drawn_there_too(monkeypatch):
    """Registered by a module that the process has imported; its processes import it for themselves."""
    import somebody.family  # noqa: F401

    config, env = dataclasses.replace(ONE, task="Lights"), make_env(ONE.env)
    monkeypatch.setenv("PYTHONPATH", str(TESTS / "extension"), prepend=os.pathsep)
    with pool_workers.executor(config, env) as workers:
        assert_equal(workers.submit(pool_workers.draw, 1).result(), make_pools(config, env).training(1))


@pytest.mark.slow
@pytest.mark.parametrize("draw", ["draw", "partial(draw)"])
def test_families_are_known_there_wherever_their_function_is_from(draw, tmp_path, monkeypatch):
    """Of another module that registers nothing, or a callable of no module of its own."""
    name = "Imported" if draw == "draw" else "Partial"
    (tmp_path / f"drawing_{name}.py").write_text(DRAWING)
    (tmp_path / f"registering_{name}.py").write_text(
        f"from functools import partial\n\nfrom drawing_{name} import draw\nfrom t2tl_jax import register_family\n\n"
        f"register_family({name!r}, {draw}, least=2)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(families, "_FAMILIES", dict(families._FAMILIES))  # other tests shall not know it
    import_module(f"registering_{name}")
    assert f"registering_{name}" in families.modules_of_families()
    config, env = dataclasses.replace(ONE, task=name), make_env(ONE.env)
    with pool_workers.executor(config, env) as workers:
        assert_equal(workers.submit(pool_workers.draw, 1).result(), make_pools(config, env).training(1))


DRAWING = """
from t2tl_jax import parse


def draw(rng, propositions):
    first, second = rng.sample(propositions, 2)
    return parse(f"F({first} & {rng.choice(['F', ''])} {second})")
"""

SCRIPT = """
import time
from t2tl_jax.quiet import quiet_imports

with quiet_imports():
    from t2tl_jax.registry import make_env
    from t2tl_jax.runs import pool_workers
    from tests.runs.test_pool_workers import CONFIG

if __name__ == "__main__":
    workers = pool_workers.executor(CONFIG, make_env(CONFIG.env))
    for made in [workers.submit(pool_workers.draw, number) for number in range(4)]:
        made.result()
    print(*workers._processes, flush=True)
    time.sleep(600)
"""


def lives(process: int) -> bool:
    status = Path(f"/proc/{process}/status")
    return status.exists() and "State:\tZ" not in status.read_text()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="processes are looked up in /proc")
def test_processes_end_with_the_one_that_trains_even_if_it_is_killed(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    root = str(TESTS.parent)
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "script.py")], env={**os.environ, "PYTHONPATH": root}, stdout=subprocess.PIPE
    ) as parent:
        assert parent.stdout is not None
        drawing = [int(process) for process in parent.stdout.readline().split()]
        assert len(drawing) == 2 and all(map(lives, drawing))
        parent.send_signal(signal.SIGKILL)
    end = time.monotonic() + 20
    while any(map(lives, drawing)) and time.monotonic() < end:
        time.sleep(0.1)
    assert not any(map(lives, drawing))


INTERRUPTED = """
import signal, time
from t2tl_jax.quiet import quiet_imports

with quiet_imports():
    from t2tl_jax.registry import make_env
    from t2tl_jax.runs import pool_workers
    from tests.runs.test_pool_workers import CONFIG

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background inherits none
    with pool_workers.executor(CONFIG, make_env(CONFIG.env)) as workers:
        try:
            print(*workers._processes, flush=True)
            while True:
                time.sleep(0.1)  # a signal just before a sleep is heard after it
        except KeyboardInterrupt:
            print(workers.submit(pool_workers.draw, 1).result().num_rows, flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="processes are looked up in /proc")
def test_an_interrupt_of_all_processes_is_for_the_one_that_trains_alone(tmp_path):
    """Also right after they were started, while they still import."""
    (tmp_path / "script.py").write_text(INTERRUPTED)
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "script.py")],
        env={**os.environ, "PYTHONPATH": str(TESTS.parent)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as parent:
        assert parent.stdout is not None
        drawing = [int(process) for process in parent.stdout.readline().split()]
        os.killpg(parent.pid, signal.SIGINT)
        try:
            out, complaints = parent.communicate(timeout=60)
        finally:
            parent.kill()  # if it does not end; leaving the block would wait for it
    assert (out, complaints, parent.returncode) == (f"{CONFIG.pool.rows}\n", "", 0)
    assert len(drawing) == 2 and not any(map(lives, drawing))


class KillDrawing(t2tl_jax.Callback):
    """Kills the processes that draw once an iteration is done, as a machine without memory does."""

    def on_iteration(self, progress, rows):
        for process in multiprocessing.active_children():
            process.kill()
            process.join()


@pytest.mark.slow
def test_a_run_whose_processes_end_says_so_and_can_go_on(tmp_path, begins_quickly):
    often = dataclasses.replace(CONFIG, frames=640, run=dataclasses.replace(CONFIG.run, checkpoint_period=0.0))
    with pytest.raises(UserError, match=r"has ended before its work was done.*run\.pool_processes"):
        t2tl_jax.train(often, folder=tmp_path / "run", callbacks=[KillDrawing()])
    thread = dataclasses.replace(often.run, pool_processes=0)
    assert t2tl_jax.resume(tmp_path / "run", run=thread).iteration == 20


class EndsAfterOne(Executor):
    """Does one piece of work, and has ended by the time of the next."""

    def __init__(self) -> None:
        self.done: list[Future] = []

    def submit(self, fn, /, *args, **kwargs):
        if self.done:
            raise BrokenExecutor("a process has ended")
        self.done.append(Future())
        self.done[0].set_result(fn(*args, **kwargs))
        return self.done[0]


def test_processes_that_end_after_their_work_are_told_too():
    with Prefetch(str, executor=EndsAfterOne()) as made, pytest.raises(UserError, match="ended before its work was"):
        made.get(0)


def test_a_number_of_processes_is_not_negative():
    with pytest.raises(ValueError, match="pool_processes"):
        RunConfig(pool_processes=-1)


@pytest.mark.slow
def test_a_pool_that_cannot_be_drawn_is_told_as_without_processes(tmp_path):
    config = dataclasses.replace(ONE, pool=dataclasses.replace(ONE.pool, size=2, rows=4))
    with pytest.raises(UserError, match="raise the caps on tokens and rows"):
        t2tl_jax.train(config, folder=tmp_path / "run")  # before there is a process
    with pool_workers.executor(config, make_env(config.env)) as workers:
        told = workers.submit(pool_workers.draw, 0).exception()
    with pytest.raises(TooLargeError) as here:
        make_pools(config, make_env(config.env)).training(0)
    assert type(told) is TooLargeError and str(told) == str(here.value)
    assert "raise the caps on tokens and rows" in str(told)
