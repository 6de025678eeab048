"""Speed of an environment: random actions, observation, labels, progression and automatic reset in one scan.

    python -m experiments.benchmarks.env --physics mjx closed_form --num-envs 64 8192 65536
    python -m experiments.benchmarks.env --env waterworld --num-envs 1024 65536
    python -m experiments.benchmarks.env --env letterworld --num-envs 65536

Counts environment steps of all environments together (one of the zone environment is ten physics substeps).
Compilation is timed apart.
"""

import dataclasses
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse
from t2tl_jax.ltl import resolve_task
from t2tl_jax.quiet import quiet_imports

Physics = Literal["mjx", "closed_form", "straight_flight", "grid", "steps"]

PHYSICS: dict[str, tuple[Physics, ...]] = {
    "zones": ("mjx", "closed_form"),
    "waterworld": ("straight_flight",),
    "letterworld": ("grid",),
    "flatworld": ("steps",),
}
"""What each environment has."""

TASKS = {
    "zones": "phi_zone",
    "waterworld": "phi_water",
    "letterworld": "F(a & (!b U c)) & F d",
    "flatworld": "F((Red & Magenta) & F((Blue & Green) & F Yellow))",
}
"""The task of each environment unless another one is given."""


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig:
    """What is measured."""

    env: Literal["zones", "waterworld", "letterworld", "flatworld"] = "zones"
    """The environment."""
    physics: tuple[Physics, ...] = ()
    """Physics to compare; by default all that the environment has."""
    num_envs: tuple[int, ...] = (64, 8192, 65536)
    """Batch sizes to compare."""
    layout: Literal["fixed", "random"] = "fixed"
    """The published map, or one of a pool at every reset. Of LetterWorld, the map of seed 0 or a pool; FlatWorld has
    one map in any case."""
    steps: int = 100
    """Environment steps of one timed call."""
    repeats: int = 5
    """Timed calls; their median is reported."""
    task: str = ""
    """Formula, or name of a task, whose progression is part of the step; by default one of `TASKS`."""
    episode_length: int = 0
    """Steps after which an environment is reset, if its task is not decided before; 0 means the published limit."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        foreign = [name for name in self.physics if name not in PHYSICS[self.env]]
        if foreign:
            known = ", ".join(PHYSICS[self.env])
            raise ValueError(f"{self.env} has no physics {', '.join(foreign)}; known: {known}")
        if not self.num_envs or min(self.num_envs) < 1:
            raise ValueError(f"num_envs are batch sizes, one or more of at least 1, got {self.num_envs}")
        checks.counts(self, "steps", "repeats")
        checks.counts(self, "episode_length", least=0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    config = parse(BenchmarkConfig, texts, prog="python -m experiments.benchmarks.env", description=__doc__)
    json_file.check(config.json)
    with explained():
        resolve_task(config.task or TASKS[config.env])  # a mistake is answered before JAX is loaded
        report(config, texts)
    return 0


def resolve(config: BenchmarkConfig) -> BenchmarkConfig:
    """The same with every default filled in."""
    with quiet_imports():
        world = importlib.import_module(f"envs.{config.env}")

    return dataclasses.replace(
        config,
        physics=config.physics or PHYSICS[config.env],
        task=config.task or TASKS[config.env],
        episode_length=config.episode_length or world.EPISODE_LENGTH,
    )


def make_env(config: BenchmarkConfig, physics: Physics) -> Any:
    """The ``TaskEnv`` that is measured."""
    from envs import flatworld, letterworld, waterworld, zones
    from t2tl_jax.ltl import compile_tasks
    from t2tl_jax.task_env import TaskEnv

    world: Any
    if config.env == "waterworld":
        world = waterworld.WaterWorld(waterworld.WaterWorldConfig(layout=config.layout))
    elif config.env == "letterworld":
        by_seed = letterworld.LetterWorldConfig(layout="by_seed")
        world = letterworld.LetterWorld(by_seed if config.layout == "fixed" else letterworld.LetterWorldConfig())
    elif config.env == "flatworld":
        world = flatworld.FlatWorld()
    else:
        assert physics in ("mjx", "closed_form")
        world = zones.ZoneEnv(zones.ZoneConfig(physics=physics, layout=config.layout))
    return TaskEnv(world, compile_tasks(resolve_task(config.task), world.propositions, world.alphabet))


def report(config: BenchmarkConfig, texts: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Measure every combination, print a table, and write it to a file on request. Returns the rows of the table.

    Args:
        config: what is measured.
        texts: what was typed behind the command, for the file.
    """
    config = resolve(config)
    from experiments.benchmarks.env_speed import measure
    from t2tl_jax.runs import provenance

    envs = {physics: make_env(config, physics) for physics in config.physics}
    where = provenance.describe(["python", "-m", "experiments.benchmarks.env", *texts])
    shown = {name: where["packages"][name] for name in ("jax", "mujoco", "mujoco-mjx", "brax")}
    devices = f"device {len(where['devices'])} x {where['devices'][0]} ({where['backend']}), which share each batch"
    print(", ".join([devices, f"python {where['python']}", *(f"{name} {value}" for name, value in shown.items())]))
    print(f"{config.env}, layout {config.layout}, task {config.task}")
    print(f"{config.steps} steps per call, {config.repeats} calls")
    print(f"{'physics':16} {'envs':>8} {'compile s':>10} {'env steps/s':>14} {'min':>14} {'max':>14}")
    results: list[dict[str, Any]] = []
    for physics, env in envs.items():
        for num_envs in config.num_envs:
            speed = measure(env, num_envs, config.steps, config.repeats, config.episode_length)
            results.append({"physics": physics, "num_envs": num_envs, **dataclasses.asdict(speed)})
            print(
                f"{physics:16} {num_envs:8,} {speed.compile_s:10.1f} {speed.steps_per_s:14,.0f} "
                f"{speed.slowest:14,.0f} {speed.fastest:14,.0f}",
                flush=True,
            )
    if config.json is not None:
        settings = {**dataclasses.asdict(config), "json": str(config.json)}
        written = {"where": where, "config": settings, "results": results}
        json_file.write(config.json, written)
    return results


if __name__ == "__main__":
    sys.exit(main())
