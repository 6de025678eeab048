"""The speed of everything in one command: ``python -m experiments.benchmark --json now.json --against before.json``.

Progression, environments with random actions, and whole trainings, each compiled, warmed up and timed several times.
Prints the tables in Markdown. On a GPU nothing else should run on it meanwhile.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

Part = Literal["progression", "environments", "training"]
PARTS: tuple[Part, ...] = ("progression", "environments", "training")

TASKS = ("phi_zone", "phi_water", "rm_water")
"""Whose progression is timed."""


@dataclass(frozen=True)
class Arguments:
    """Time progression, environments and trainings; print tables, and write them to a file."""

    parts: tuple[Part, ...] = PARTS
    """What to time."""
    trainings: tuple[str, ...] = (
        "zone_ppo:t1tl",
        "zone_ppo:t2tl",
        "zone_ppo_long:t1tl",
        "zone_ppo_long:t2tl",
        "zone_ppo_long:t1tl:closed_form",
        "zone_ppo_long:t2tl:closed_form",
        "waterworld_dqn:t1tl",
        "waterworld_dqn:t2tl",
    )
    """Trainings as CONFIG, CONFIG:METHOD or CONFIG:METHOD:PHYSICS."""
    seeds: tuple[int, ...] = (1, 12)
    """How many seeds at once."""
    num_envs: tuple[int, ...] = (8192, 65536)
    """Batches of the environments."""
    rows: int = 65536
    """Batch of the progression."""
    steps: int = 100
    """Steps of one timed call of an environment, or of progression."""
    repeats: int = 5
    """Timed calls; their median is reported."""
    json: Path | None = None
    """Also write the results to this file."""
    against: Path | None = None
    """A file of an earlier benchmark to compare with."""

    def __post_init__(self) -> None:
        checks.counts(self, "rows", "steps", "repeats")
        for name in ("parts", "seeds", "num_envs"):
            if not getattr(self, name):
                raise ValueError(f"{name} needs one value or more")
        if min(*self.seeds, *self.num_envs) < 1:
            raise ValueError(f"seeds and num_envs are at least 1, got {self.seeds} and {self.num_envs}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: Sequence[str]) -> int:
    arguments = parse(Arguments, list(texts), prog="python -m experiments.benchmark", description=Arguments.__doc__)
    json_file.check(arguments.json)
    with quiet_imports():
        from experiments.benchmarks import measured
        from t2tl_jax.runs import provenance

    earlier = None if arguments.against is None else measured.read(arguments.against)
    with explained():
        trainings = [(text, training(text)) for text in arguments.trainings]
    where, rows = provenance.describe(), []
    devices = f"{len(where['devices'])} x {where['devices'][0]}"
    print(f"{devices}, jax {where['packages']['jax']}; {arguments.repeats} calls each")
    for part in arguments.parts:
        print(f"\n## {part}\n", flush=True)
        new = []
        for one in MEASURE[part](arguments, trainings):
            new.append(one)
            print(f"{one.what}, {one.size}: {measured.three_digits(one.rate)} {one.unit}", file=sys.stderr, flush=True)
        print(measured.table(new))
        rows += new
    if earlier is not None:
        there, before = earlier
        print(
            f"\n## Against {arguments.against} ({there['devices'][0]}, commit {(there['git_revision'] or '-')[:7]})\n"
        )
        print(measured.against(rows, before))
    print(f"\n## What others say of themselves, on other hardware\n\n{measured.peers()}")
    if arguments.json is not None:
        settings = {name: value.name if isinstance(value, Path) else value for name, value in asdict(arguments).items()}
        measured.write(arguments.json, where, settings, rows)
        print(f"\nwritten: {arguments.json}")
    return 0


def training(text: str) -> Any:
    """The configuration that CONFIG, CONFIG:METHOD or CONFIG:METHOD:PHYSICS means.

    Raises:
        UserError: for a name that is not known, or an environment that has no choice of physics.
    """
    from experiments import configs, methods  # noqa: F401, registers the configurations
    from t2tl_jax.registry import named_config

    name, method, physics, *more = (*text.split(":"), "", "")
    if any(more):
        raise UserError(f"a training is CONFIG, CONFIG:METHOD or CONFIG:METHOD:PHYSICS, got {text!r}")
    config = named_config(name)
    if method:
        config = methods.apply(config, method)
    if physics:
        if not hasattr(config.env, "physics"):
            raise UserError(f"{text}: {type(config.env).__name__} has no choice of physics")
        config = replace(config, env=replace(config.env, physics=physics))  # type: ignore[call-arg]
    return config


def _progression(arguments: Arguments, trainings: Sequence[tuple[str, Any]]) -> Iterator[Any]:
    from envs.waterworld import COLOURS, LETTERS
    from experiments.benchmarks import measured, progression_speed
    from t2tl_jax.ltl import ZONE_PROPOSITIONS, compile_named

    worlds = {"phi_zone": (ZONE_PROPOSITIONS, "at_most_one"), "phi_water": (COLOURS, "every_subset")}
    for task in TASKS:
        propositions, alphabet = worlds.get(task, (LETTERS, "every_subset"))
        table = compile_named(task, propositions, alphabet)
        speed, costs = progression_speed.measure(table, arguments.rows, arguments.steps, arguments.repeats)
        size = f"{arguments.rows:,} at once, {table.num_rows} rows"
        yield measured.row("progression", task, size, "steps/s", speed, costs)


def _environments(arguments: Arguments, trainings: Sequence[tuple[str, Any]]) -> Iterator[Any]:
    from experiments.benchmarks import env, env_speed, measured
    from experiments.benchmarks.timing import Costs, Rate

    for name, kinds in env.PHYSICS.items():
        config = env.resolve(env.BenchmarkConfig(env=name))  # type: ignore[arg-type]
        for physics in kinds:
            world = env.make_env(config, physics)
            for count in arguments.num_envs:
                speed = env_speed.measure(world, count, arguments.steps, arguments.repeats, config.episode_length)
                costs = Costs(0.0, speed.compile_s, None, None, None)
                rate = Rate(speed.steps_per_s, speed.slowest, speed.fastest)
                yield measured.row("environments", f"{name}, {physics}", f"{count:,} at once", "steps/s", rate, costs)


def _training(arguments: Arguments, trainings: Sequence[tuple[str, Any]]) -> Iterator[Any]:
    from experiments.benchmarks import measured, training_speed

    for text, config in trainings:
        for count in arguments.seeds:
            seeds = "".join(f"{seed}," for seed in range(count))
            found = training_speed.measure(replace(config, seeds=seeds), arguments.repeats)
            share = found.iterate.median / found.acting.median
            size = "1 seed" if count == 1 else f"{count} seeds"
            yield measured.row("training", text, size, "frames/s", found.iterate, found.costs, acting_share=share)


MEASURE: dict[Part, Callable[[Arguments, Sequence[tuple[str, Any]]], Iterator[Any]]] = {
    "progression": _progression,
    "environments": _environments,
    "training": _training,
}


if __name__ == "__main__":
    sys.exit(main())
