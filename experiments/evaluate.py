"""Evaluate the policies of a run: ``python -m experiments.evaluate RUN``; also on another task or in other physics."""

import dataclasses
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro

from experiments.cli.errors import guarded
from experiments.cli.flags import parse
from experiments.cli.quiet import quiet_imports
from t2tl_jax.errors import UserError, explained


@dataclass(frozen=True)
class Arguments:
    """Play complete episodes with the policies of a run, and store rates, steps and returns in its evaluation.json."""

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    episodes: int = 1000
    """Episodes per seed and policy."""
    checkpoint: Literal["best", "latest"] = "best"
    """The parameters with the highest discounted return in training, or the latest ones."""
    task: str | None = None
    """Another task, by name or as a formula; the run's own by default."""
    physics: Literal["mjx", "closed_form"] | None = None
    """Other physics than the run's, in ZoneEnv."""
    episode_length: int | None = None
    """Another time limit, in steps."""
    gif: bool = False
    """Also draw an episode again (episode.gif)."""


def main(arguments: Sequence[str] | None = None, build: Callable[[Any], Any] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used, 130 after Ctrl-C.

    Args:
        arguments: of the command line, without the program's name; by default those of this process.
        build: from a ``Config`` to an ``t2tl_jax.runs.build.Experiment``; by default the one of that module.
    """
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments), build))


def _main(texts: list[str], build: Callable[[Any], Any] | None) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.evaluate", description=Arguments.__doc__)
    if arguments.episodes < 1:
        raise UserError(f"--episodes must be at least 1, got {arguments.episodes}")
    # Imported late: loading JAX and MuJoCo takes seconds, which --help and mistakes need not wait for.
    from t2tl_jax.runs.interrupts import Interrupted, StopRequest

    with StopRequest(notice="stopping; nothing is stored") as stop:
        try:
            stop.call(lambda: _evaluate(arguments, build), "while evaluating")
        except Interrupted:
            return stop.leave(0)
    return 0


def _evaluate(arguments: Arguments, build: Callable[[Any], Any] | None) -> None:
    with quiet_imports():
        from experiments.cli import compilation_cache
        from t2tl_jax.evaluation.report import table
        from t2tl_jax.runs import evaluation_run, stored_params
        from t2tl_jax.runs import folder as run_folder
        from t2tl_jax.runs.build import build as default_build
        from t2tl_jax.training.seeds import parse_seeds, place, seed_sharding

    folder, stored = run_folder.open_existing(arguments.run)
    evaluation_run.stored(folder)  # tells of a damaged file before the work
    compilation_cache.use(stored.run.compilation_cache)
    config = _changed(stored, arguments)
    experiment = (build or default_build)(config)
    iteration, params = stored_params.restore(folder, config, experiment, arguments.checkpoint)
    params = place(params, seed_sharding(len(parse_seeds(config.seeds))))
    what = evaluation_run.settings(folder, config, arguments.checkpoint, iteration, arguments.episodes)
    print("  ".join(f"{name}: {value}" for name, value in what.items()), flush=True)
    if config.task != stored.task and config.network.task_encoder == "one_hot":
        print("note: a one-hot code does not carry over to another task; its rows now mean other sub-tasks")
    reports = evaluation_run.evaluate(experiment, config, params, arguments.episodes)
    print(table(reports), flush=True)
    evaluation_run.store(folder, what, reports)
    print(f"stored: {folder.evaluation}", flush=True)
    if arguments.gif and evaluation_run.draw_episode(experiment, config, params, folder):
        print(f"drawn: {folder.gif}")


def _changed(config: Any, arguments: Arguments) -> Any:
    from envs.zones import ZoneConfig

    with explained():
        if arguments.task is not None:
            config = dataclasses.replace(config, task=arguments.task)
        if arguments.physics is not None:
            if not isinstance(config.env, ZoneConfig):
                raise UserError("--physics chooses between those of ZoneEnv; WaterWorld has only one")
            config = dataclasses.replace(config, env=dataclasses.replace(config.env, physics=arguments.physics))
        if arguments.episode_length is not None:
            config = dataclasses.replace(config, episode_length=arguments.episode_length)
        return config


if __name__ == "__main__":
    sys.exit(main())
