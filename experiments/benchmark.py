"""The speed of everything in one command: ``python -m experiments.benchmark --json now.json --against before.json``.

Progression, environments with random actions, and whole trainings, each compiled, warmed up and timed several times.
Prints the tables in Markdown. On a GPU nothing else should run on it meanwhile.

Environments and trainings use all devices that JAX sees, trainings as a run of theirs does. CUDA_VISIBLE_DEVICES=0
measures on one GPU of several; on a CPU, JAX_NUM_CPU_DEVICES says how many there are (one, and in a run every core).
"""

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

Part = Literal["progression", "environments", "training", "solve"]
PARTS: tuple[Part, ...] = ("progression", "environments", "training", "solve")

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
    """Trainings as CONFIG, CONFIG:METHOD, CONFIG:METHOD:PHYSICS or CONFIG:METHOD:PHYSICS:ENVIRONMENTS. With so many
    environments a minibatch is larger by the same factor."""
    seeds: tuple[int, ...] = (1, 12)
    """How many seeds at once."""
    one_seed: tuple[str, ...] = ()
    """More trainings, which are timed with one seed only."""
    solve: tuple[str, ...] = ("zone_ppo:t1tl", "zone_ppo:t2tl", "waterworld_dqn:t1tl", "waterworld_dqn:t2tl")
    """Trainings as above that are run once with each number of seeds until success in training stays above 95 % in all
    of them, from pre-training on."""
    devices_per_seed: int = 0
    """The most devices for one seed, as of a run; 0 for one on a GPU, and as many as there are on a CPU."""
    num_envs: tuple[int, ...] = (8192, 65536)
    """Batches of the environments."""
    rows: int = 65536
    """Batch of the progression."""
    steps: int = 100
    """Steps of one timed call of an environment, or of progression."""
    repeats: int = 5
    """Timed calls; their median is reported."""
    json: Path | None = None
    """Also write the results to this file; until all are there, to one beside it whose name ends in .part."""
    against: Path | None = None
    """A file of an earlier benchmark to compare with."""

    def __post_init__(self) -> None:
        checks.counts(self, "rows", "steps", "repeats")
        checks.counts(self, "devices_per_seed", least=0)
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

    earlier = None if arguments.against is None else measured.read(arguments.against)
    with explained():
        trainings = {"training": _trainings(arguments), "solve": _solves(arguments)}
    where = json_file.where(["python", "-m", "experiments.benchmark", *texts])
    rows: list[measured.Row] = []
    settings = {name: value.name if isinstance(value, Path) else value for name, value in asdict(arguments).items()}
    devices = f"{len(where['devices'])} x {where['devices'][0]}"
    print(f"{devices}, jax {where['packages']['jax']}; {arguments.repeats} calls each")
    for part in arguments.parts:
        print(f"\n## {part}\n", flush=True)
        new = []
        for one in MEASURE[part](arguments, trainings.get(part, [])):
            new.append(one)
            print(f"{one.what}, {one.size}: {measured.three_digits(one.rate)} {one.unit}", file=sys.stderr, flush=True)
            if arguments.json is not None:
                measured.write(json_file.unfinished(arguments.json), where, settings, [*rows, *new])
        print(measured.solved_table(new) if part == "solve" else measured.table(new))
        rows += new
    if earlier is not None:
        there, before = earlier
        devices = f"{len(there['devices'])} x {there['devices'][0]}"
        print(f"\n## Against {arguments.against} ({devices}, commit {(there['git_revision'] or '-')[:7]})\n")
        print(measured.against(rows, before))
    print(f"\n## What others say of themselves, on other hardware\n\n{measured.peers()}")
    if arguments.json is not None:
        measured.write(arguments.json, where, settings, rows)
        json_file.unfinished(arguments.json).unlink(missing_ok=True)
        print(f"\nwritten: {arguments.json}")
    print(_of_the_readme(where, rows))
    return 0


def _of_the_readme(where: Mapping[str, Any], rows: Sequence[Any]) -> str:
    """The README's table as it is with this benchmark among those that are stored; '' where these are not there."""
    from experiments.reproduction import speed

    results = Path(__file__).parents[1] / "results"
    if not all(speed.is_stored(kind, results) for kind in speed.KINDS):
        return ""
    said = f"""\
## The table of the README, by what is stored in {results.name}/ and by this

What was just measured counts as the newest for each row of trainings or environments that it has all of, on one device,
from a commit without changes.
"""
    return f"\n{said}\n{speed.short_table(results, [(where, rows)])}"


@dataclass(frozen=True)
class Timed:
    """A training that is to be timed."""

    text: str
    """As it was given."""
    config: Any
    """With its seeds, and how many devices each may have."""
    seeds: int
    """How many."""


def _trainings(arguments: Arguments) -> list[Timed]:
    wanted = [(text, count) for text in arguments.trainings for count in arguments.seeds]
    return _timed(arguments, [*wanted, *((text, 1) for text in arguments.one_seed)])


def _solves(arguments: Arguments) -> list[Timed]:
    return _timed(arguments, [(text, count) for text in arguments.solve for count in arguments.seeds])


def _timed(arguments: Arguments, wanted: Sequence[tuple[str, int]]) -> list[Timed]:
    from experiments.benchmarks.trainings import training

    found = []
    for text, count in dict.fromkeys(wanted):
        config = training(text)
        run = replace(config.run, devices_per_seed=arguments.devices_per_seed)
        found.append(Timed(text, replace(config, seeds=f"{','.join(map(str, range(count)))},", run=run), count))
    return found


def _progression(arguments: Arguments, trainings: Sequence[Timed]) -> Iterator[Any]:
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


def _environments(arguments: Arguments, trainings: Sequence[Timed]) -> Iterator[Any]:
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
                what, size = f"{name}, {physics}", f"{count:,} at once"
                yield measured.row("environments", what, size, "steps/s", rate, costs, devices=speed.devices)


def _training(arguments: Arguments, trainings: Sequence[Timed]) -> Iterator[Any]:
    from experiments.benchmarks import measured, training_speed

    for one in trainings:
        found = training_speed.measure(one.config, arguments.repeats)
        share = None if found.acting is None else found.iterate.median / found.acting.median
        size = "1 seed" if one.seeds == 1 else f"{one.seeds} seeds"
        more = {"acting_share": share, "devices": found.devices}
        yield measured.row("training", one.text, size, "frames/s", found.iterate, found.costs, **more)


def _solve(arguments: Arguments, trainings: Sequence[Timed]) -> Iterator[Any]:
    from experiments.benchmarks import measured
    from t2tl_jax.runs import train

    for one in trainings:
        begin = time.perf_counter()
        result = train.train(one.config, until_solved=True)
        seconds = time.perf_counter() - begin
        since = list(result.success_since.values())
        frames = None if None in since else max(number for number in since if number is not None)
        rate = result.iteration * result.experiment.agent.frames_per_iteration * one.seeds / seconds
        size = "1 seed" if one.seeds == 1 else f"{one.seeds} seeds"
        yield measured.Row("solve", one.text, size, "frames/s", rate, rate, rate, seconds=seconds, frames=frames)


MEASURE: dict[Part, Callable[[Arguments, Sequence[Timed]], Iterator[Any]]] = {
    "progression": _progression,
    "environments": _environments,
    "training": _training,
    "solve": _solve,
}


if __name__ == "__main__":
    sys.exit(main())
