"""Speed of an environment: random actions, observation, labels, progression and automatic reset in one scan.

    python -m experiments.benchmark_env --physics mjx closed_form --num-envs 64 8192 65536
    python -m experiments.benchmark_env --env waterworld --num-envs 1024 65536

Counts environment steps of all environments together (one of the zone environment is ten physics substeps).
Compilation is timed apart.
"""

import dataclasses
import json
import platform
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Literal

import jax
import jax.numpy as jnp
import tyro

from experiments.quiet import quiet_imports

with quiet_imports():
    from envs import waterworld, zones
    from envs.base import LabelledEnv, State
    from t2tl_jax.ltl import compile_tasks, resolve_task
    from t2tl_jax.task_env import TaskEnv

Physics = Literal["mjx", "closed_form", "straight_flight"]

ZONE_PHYSICS: tuple[Physics, ...] = ("mjx", "closed_form")
WATER_PHYSICS: tuple[Physics, ...] = ("straight_flight",)


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig:
    """What is measured."""

    env: Literal["zones", "waterworld"] = "zones"
    """The environment."""
    physics: tuple[Physics, ...] = ()
    """Physics to compare; by default all that the environment has."""
    num_envs: tuple[int, ...] = (64, 8192, 65536)
    """Batch sizes to compare."""
    layout: Literal["fixed", "random"] = "fixed"
    """The published map, or a new one at every reset."""
    steps: int = 100
    """Environment steps of one timed call."""
    repeats: int = 5
    """Timed calls; their median is reported."""
    task: str = ""
    """Formula, or name of a task, whose progression is part of the step; by default phi_zone or phi_water."""
    episode_length: int = 0
    """Steps after which an environment is reset, if its task is not decided before; 0 means the published limit."""
    json: Path | None = None
    """Also write the results to this file."""


@dataclasses.dataclass(frozen=True)
class Result:
    """One row of the report."""

    physics: Physics
    """What moved the bodies."""
    num_envs: int
    """Batch size."""
    compile_s: float
    """Seconds to trace and compile."""
    steps_per_s: float
    """Environment steps per second, median of the repeats."""
    slowest: float
    """The same in the slowest repeat."""
    fastest: float
    """The same in the fastest repeat."""


def resolve(config: BenchmarkConfig) -> BenchmarkConfig:
    """The same with every default filled in; ValueError for a physics that the environment does not have."""
    water = config.env == "waterworld"
    known = WATER_PHYSICS if water else ZONE_PHYSICS
    unknown = [name for name in config.physics if name not in known]
    if unknown:
        raise ValueError(f"{config.env} has no physics {', '.join(unknown)}; known: {', '.join(known)}")
    return dataclasses.replace(
        config,
        physics=config.physics or known,
        task=config.task or ("phi_water" if water else "phi_zone"),
        episode_length=config.episode_length or (waterworld.EPISODE_LENGTH if water else zones.EPISODE_LENGTH),
    )


def make_env(config: BenchmarkConfig, physics: Physics) -> LabelledEnv:
    """The environment without a task."""
    if physics == "straight_flight":
        return waterworld.WaterWorld(waterworld.WaterWorldConfig(layout=config.layout))
    return zones.ZoneEnv(zones.ZoneConfig(physics=physics, layout=config.layout))


def random_actions(key: jax.Array, env: TaskEnv, num_envs: int) -> jax.Array:
    """Uniform actions for a batch, discrete or continuous."""
    if env.num_actions is not None:
        return jax.random.randint(key, (num_envs,), 0, env.num_actions)
    return jax.random.uniform(key, (num_envs, env.action_size), minval=-1.0, maxval=1.0)


def make_rollout(env: TaskEnv, num_envs: int, steps: int, episode_length: int) -> Callable[..., tuple]:
    """A function ``(states, ages, key) -> (states, ages, total reward)`` that takes ``steps`` random actions each."""

    def step(carry: tuple[State, jax.Array, jax.Array], key: jax.Array) -> tuple[tuple, None]:
        states, ages, total = carry
        action_key, reset_key = jax.random.split(key)
        actions = random_actions(action_key, env, num_envs)
        states = jax.vmap(env.step)(states, actions)
        total += states.reward.sum()
        ages += 1
        ended = (states.done > 0.0) | (ages >= episode_length)
        fresh = jax.vmap(env.reset)(jax.random.split(reset_key, num_envs))
        states = jax.vmap(lambda end, new, old: jax.tree.map(lambda a, b: jnp.where(end, a, b), new, old))(
            ended, fresh, states
        )
        return (states, jnp.where(ended, 0, ages), total), None

    def rollout(states: State, ages: jax.Array, key: jax.Array) -> tuple[State, jax.Array, jax.Array]:
        return jax.lax.scan(step, (states, ages, jnp.zeros(())), jax.random.split(key, steps))[0]

    return rollout


def measure(config: BenchmarkConfig, physics: Physics, num_envs: int) -> Result:
    """Compile, warm up and time one physics at one batch size."""
    world = make_env(config, physics)
    env = TaskEnv(world, compile_tasks(resolve_task(config.task), world.propositions, world.alphabet))
    states = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), num_envs))
    ages = jnp.arange(num_envs, dtype=jnp.int32) % config.episode_length  # spread the resets over time
    rollout = make_rollout(env, num_envs, config.steps, config.episode_length)

    started = time.perf_counter()
    compiled = jax.jit(rollout, donate_argnums=(0, 1)).lower(states, ages, jax.random.key(0)).compile()
    compile_s = time.perf_counter() - started

    seconds = []
    for repeat in range(config.repeats + 1):
        started = time.perf_counter()
        states, ages, total = compiled(states, ages, jax.random.key(repeat))
        jax.block_until_ready((states, total))
        seconds.append(time.perf_counter() - started)
    speeds = [num_envs * config.steps / s for s in seconds[1:]]  # the first call warms up
    return Result(physics, num_envs, compile_s, statistics.median(speeds), min(speeds), max(speeds))


def main(config: BenchmarkConfig) -> list[Result]:
    """Measure every combination, print a table, and write it to a file on request."""
    config = resolve(config)
    device = jax.devices()[0]
    where = {
        "device": f"{jax.device_count()} x {device.device_kind} ({device.platform}); one is used",
        "python": platform.python_version(),
        **{name: version(name) for name in ("jax", "mujoco", "mujoco-mjx", "brax")},
    }
    print(", ".join(f"{name} {value}" for name, value in where.items()))
    print(f"{config.env}, layout {config.layout}, task {config.task}")
    print(f"{config.steps} steps per call, {config.repeats} calls")
    print(f"{'physics':16} {'envs':>8} {'compile s':>10} {'env steps/s':>14} {'min':>14} {'max':>14}")
    results = []
    for physics in config.physics:
        for num_envs in config.num_envs:
            result = measure(config, physics, num_envs)
            results.append(result)
            print(
                f"{physics:16} {num_envs:8,} {result.compile_s:10.1f} {result.steps_per_s:14,.0f} "
                f"{result.slowest:14,.0f} {result.fastest:14,.0f}",
                flush=True,
            )
    if config.json is not None:
        settings = {**dataclasses.asdict(config), "json": str(config.json)}
        report = {"where": where, "config": settings, "results": [dataclasses.asdict(result) for result in results]}
        config.json.write_text(json.dumps(report, indent=2) + "\n")
    return results


if __name__ == "__main__":
    main(tyro.cli(BenchmarkConfig, prog="python -m experiments.benchmark_env", description=__doc__))
