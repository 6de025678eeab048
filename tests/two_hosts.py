"""Pairs of processes that train as one, and the same in one process; ``python -m tests.two_hosts FOLDER``.

Modules are loaded once, before any child is made, and JAX computes in the children only. What each child said lies in
``FOLDER/NAME.log``, and its exit code in ``FOLDER/NAME.code``.
"""

import contextlib
import os
import random
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import tensorboardX  # noqa: F401, which every run loads, as the next two

import experiments.run
import t2tl_jax
import t2tl_jax.evaluation.report
import t2tl_jax.runs.train
import tests.fake_learner  # noqa: F401
from experiments.cli import hosts
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.registry import named_config
from t2tl_jax.runs.config import SelectionConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.devices import fetched, over_envs, seed_sharding
from t2tl_jax.training.program import params_of_seeds, trace
from tests.agents.sizes import PPO
from tests.agents.test_ppo import ONE_HOT
from tests.fake_agent import make_agent
from tests.parameters import begun_quickly
from tests.probe import ProbeEnv

CONFIG = replace(
    named_config("fake"), seeds="0,3,4", frames=400, selection=SelectionConfig(points=2, episodes=2), pretrained=""
)
"""Three seeds, so that two devices are filled up to four."""

DYING = ("--config", "fake", "--seeds", "4", "--frames", "2000", "--run.checkpoint-period", "0")
"""Of a run that loses a process."""

REFUSED = ("--config", "fake", "--seeds", "2")
"""Of a run whose seeds are too few for two processes of two devices each."""

LIMIT = 400
"""Seconds until a child that hangs is ended, as nobody else would."""


def environments_of_one_seed(over: int) -> list[np.ndarray]:
    """What a little learner with one seed comes to, its environments spread over so many devices.

    It has what PPO has: environments with a state of their own, and the gradient of a mean over all of them.
    """

    def init(key: jax.Array, env_params: Any) -> dict[str, jax.Array]:
        return {"key": key, "envs": over_envs(jax.random.normal(key, (16, 3))), "params": jnp.ones(3)}

    def iterate(state: dict[str, jax.Array], env_params: Any) -> tuple[dict[str, jax.Array], jax.Array]:
        key, draw = jax.random.split(state["key"])
        envs = over_envs(jnp.sin(state["envs"] + jax.random.normal(draw, (16, 3))))
        value, gradient = jax.value_and_grad(lambda params: jnp.tanh(envs @ params).mean())(state["params"])
        return {"key": key, "envs": envs, "params": state["params"] - gradient}, value

    agent = make_agent()._replace(init=init, iterate=iterate, restart=None, num_envs=16)
    probe = ProbeEnv()
    env = TaskEnv(probe, compile_tasks(["F Up"], probe.propositions, probe.alphabet))
    program = trace(agent, (5,), params_of_seeds(env, (5,)), sharding=seed_sharding(1, 16, over))
    state = program.lowered_init.compile()(program.keys, program.env_params)
    iterations = program.lowered_iterate.compile()
    assert ("all-reduce" in iterations.as_text()) == (over > 1)
    for _ in range(3):
        state, metrics = iterations(state, program.env_params)
    return [np.asarray(x) for x in jax.tree.leaves(fetched((state["envs"], state["params"], metrics)))]


def ppo_of_one_seed(over: int) -> list[np.ndarray]:
    """What PPO comes to with one seed, its environments and minibatches spread over so many devices."""
    probe = ProbeEnv()
    env = TaskEnv(probe, compile_tasks(["F(Up & F(Down & F Up))"], probe.propositions, probe.alphabet))
    # Adam divides by the gradient's size: with the usual epsilon it would show the rounding of vanishing gradients.
    config = replace(PPO, network=ONE_HOT, epochs=1, adam_epsilon=1.0, learning_rate=0.3)
    agent = begun_quickly(make_ppo(env, config, episode_length=20, iterations=60))
    sharding = seed_sharding(1, agent.num_envs, over)
    program = trace(agent, (5,), params_of_seeds(env, (5,)), sharding=sharding)
    state = program.lowered_init.compile()(program.keys, program.env_params)
    iterate = program.lowered_iterate.compile()
    assert ("all-reduce" in iterate.as_text()) == (over > 1)
    for _ in range(2):
        state, metrics = iterate(state, program.env_params)
    return [np.asarray(x) for x in jax.tree.leaves(fetched((state.params, metrics)))]


class Stop(t2tl_jax.Callback):
    """One process stops after two iterations; the other one has to follow."""

    def __init__(self, index: int) -> None:
        self.index = index

    def on_iteration(self, progress, rows) -> None:
        assert progress.devices == 2 and len(rows) == 3
        progress.stop = "enough" if progress.done == 2 and self.index == 1 else ""


def alone(folder: Path) -> None:
    assert len(jax.devices()) == 2
    t2tl_jax.train(CONFIG, folder=folder / "alone")


def together(folder: Path, job: int, index: int) -> None:
    """As two tasks of SLURM, which says so in variables."""
    said = {"JOB_ID": job, "PROCID": index, "LOCALID": index, "NTASKS": 2, "STEP_NODELIST": "localhost"}
    os.environ.update({f"SLURM_{name}": str(value) for name, value in said.items()})
    _, given = hosts.read(["--hosts", "slurm"])
    with hosts.joined(given):
        assert (len(jax.devices()), len(jax.local_devices())) == (2, 1)
        t2tl_jax.train(CONFIG, folder=folder / "together", callbacks=[Stop(index)])
        result = t2tl_jax.resume(folder / "together")
        assert all(x.shape[0] == 3 for x in jax.tree.leaves((result.params["final"], result.params["best"])))
        np.savez(folder / f"envs{index}", *environments_of_one_seed(over=2))
        np.savez(folder / f"ppo{index}", *ppo_of_one_seed(over=2))


def dying(folder: Path, name: str, victim: int, address: str, index: int) -> int:
    """The command, of which one process is killed once there is a complete checkpoint."""
    os.environ["FAKE_SECONDS"] = "0.1"
    hosts.PATIENCE = 3.0

    def watch() -> None:
        while not any(path.name.isdecimal() for path in folder.glob(f"{name}/fake/*/checkpoints/*")):  # its last name
            time.sleep(0.02)
        (folder / f"{name}.killed").write_text(str(time.time()))
        os.kill(os.getpid(), signal.SIGKILL)

    if index == victim:
        threading.Thread(target=watch, daemon=True).start()
    return experiments.run.main([*DYING, "--run.folder", str(folder / name), "--hosts", f"{address},2,{index}"])


def refused(folder: Path, address: str, index: int) -> int:
    """The command, which cannot be done with so many processes; the second one is late."""
    time.sleep(index)
    return experiments.run.main([*REFUSED, "--run.folder", str(folder / "refused"), "--hosts", f"{address},2,{index}"])


def child(name: str, folder: Path, devices: int, function: Callable[..., int | None], *arguments) -> int:
    """A process of its own for a function; its id."""
    if pid := os.fork():
        return pid
    signal.alarm(LIMIT)
    log = os.open(folder / f"{name}.log", os.O_WRONLY | os.O_CREAT)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.environ["XLA_FLAGS"] += f" --xla_force_host_platform_device_count={devices}"
    try:
        code = function(folder, *arguments) or 0
    except BaseException:
        traceback.print_exc()
        code = 3
    sys.stdout.flush()
    os._exit(code)


def free_address() -> str:
    with socket.socket() as free:
        free.bind(("localhost", 0))
        return f"localhost:{free.getsockname()[1]}"


def free_job() -> int:
    """The number of a job of SLURM, which the port depends on: the number modulo 4096, counted from 61440."""
    for job in random.sample(range(4096), 100):
        with socket.socket() as free, contextlib.suppress(OSError):
            free.bind(("localhost", 61440 + job))
            return job
    raise RuntimeError("no port is free")


def main(folder: Path) -> None:
    names = {child("alone", folder, 2, alone): "alone"}
    for index, job in enumerate([free_job()] * 2):
        names[child(f"together{index}", folder, 1, together, job, index)] = f"together{index}"
    for name, victim in (("dying", 1), ("headless", 0)):
        for index, address in enumerate([free_address()] * 2):
            names[child(f"{name}{index}", folder, 1, dying, name, victim, address, index)] = f"{name}{index}"
    for index, address in enumerate([free_address()] * 2):
        names[child(f"refused{index}", folder, 2, refused, address, index)] = f"refused{index}"
    while names:
        pid, status = os.wait()
        name = names.pop(pid)
        (folder / f"{name}.code").write_text(str(os.waitstatus_to_exitcode(status)))
        (folder / f"{name}.ended").write_text(str(time.time()))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
