"""Evaluate the policies of a run: ``python -m experiments.evaluate RUN``; also on another task or in other physics."""

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro

from experiments.cli.errors import guarded
from experiments.cli.plugins import import_modules
from t2tl_jax import checks
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """Play complete episodes with the policies of a run, and store the rates, steps and returns in evaluation.json."""

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    episodes: int = 1000
    """Episodes per seed, policy and task; the deterministic policy plays one where all would be the same."""
    which: Literal["both", "final", "best"] = "both"
    """The parameters at the end of training, those that did best in the episodes played for selection, or both."""
    task: str | None = None
    """Evaluate another task, by name or as a formula; the run's own by default."""
    tasks: str | None = None
    """Evaluate several tasks in one table: names or formulas separated by commas, or a file with one on each line."""
    pools: int = 1
    """How many of the pools of formulas drawn in training to count rows of, to tell how much of --tasks training met
    where the run's folder does not say; each takes seconds, and 0 counts none."""
    certify: int = 0
    """Instead of the table, play this many episodes of each task with one policy, and bound its rates exactly."""
    seed: int | None = None
    """With --certify, the seed whose policy is certified; the first one by default."""
    policy: Literal["sampled", "deterministic"] | None = None
    """With --certify, which policy is certified, the sampled one by default; of the final parameters unless --which
    says best."""
    physics: Literal["mjx", "closed_form"] | None = None
    """Use other physics than the run did (ZoneEnv only)."""
    episode_length: int | None = None
    """Time limit of an episode in steps; that of the run by default."""
    plan: Literal["none", "critic"] | None = None
    """Whether the critic's value chooses among the ways that a task leaves open; as in the run by default."""
    gif: bool = False
    """Also draw an episode (episode.gif), in place of the last one drawn."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used, 130 after Ctrl-C.

    Args:
        arguments: of the command line, without the program's name; by default those of this process.
    """
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(
        Arguments, import_modules(texts), prog="python -m experiments.evaluate", description=Arguments.__doc__
    )
    with explained():
        checks.episodes(arguments, "episodes")
    if arguments.task is not None and arguments.tasks is not None:
        raise UserError("give one task (--task) or a list of them (--tasks), not both")
    if arguments.certify < 0:
        raise UserError(f"--certify is a number of episodes, 0 or more, got {arguments.certify}")
    for name in ("seed", "policy"):
        if getattr(arguments, name) is not None and not arguments.certify:
            raise UserError(
                f"--{name} belongs to --certify, and without it every seed that is kept is evaluated with both "
                f"policies: leave --{name} out, or add --certify EPISODES, such as --certify 10000"
            )
    if arguments.pools < 0:
        raise UserError(f"--pools is a number of pools, 0 or more, got {arguments.pools}")
    if arguments.gif and (arguments.tasks is not None or arguments.certify):
        raise UserError(
            "--gif draws one evaluated task, without --tasks or --certify; python -m experiments.play draws any"
        )
    # Imported late: loading JAX and MuJoCo takes seconds, which --help and mistakes need not wait for.
    from t2tl_jax.runs.interrupts import Interrupted, StopRequest

    with StopRequest(notice="stopping; nothing will be stored") as stop:
        try:
            stop.call(lambda: _evaluate(arguments, texts), "while evaluating")
        except Interrupted:
            return stop.leave(0)
    return 0


def _evaluate(arguments: Arguments, texts: Sequence[str]) -> None:
    with quiet_imports():
        import experiments.configs  # noqa: F401, registers what runs are made of
        from experiments import evaluate_tasks, fuller_maps
        from experiments.cli import compilation_cache
        from t2tl_jax.evaluation.report import table
        from t2tl_jax.ltl import TaskFamily
        from t2tl_jax.runs import evaluations
        from t2tl_jax.runs.differences import in_short
        from t2tl_jax.runs.folder import open_existing
        from t2tl_jax.training.seeds import parse_seeds

    folder, stored = open_existing(arguments.run)
    evaluations.stored(folder)  # tells of a damaged file before the work
    compilation_cache.use(stored.run.compilation_cache)
    tasks = None if arguments.tasks is None else evaluate_tasks.listed(arguments.tasks)
    given = tasks or ([] if arguments.task is None else [arguments.task])
    played = fuller_maps.load(arguments.run, stored, given, _changes(stored, arguments))
    if played.note:
        print(f"note: {played.note}", flush=True)
    if tasks is not None or arguments.certify:
        _evaluate_tasks(arguments, texts, folder, stored, played, tasks)
        return
    result = played.result
    chosen = tuple(result.params) if arguments.which == "both" else (arguments.which,)
    length = result.config.episode_length

    def settings(which: Any) -> Any:
        of_run = evaluations.settings(folder, result.experiment, which, result.iteration, arguments.episodes)
        return of_run | played.settings

    shown = settings(arguments.which)
    if isinstance(result.config.task, TaskFamily):
        shown["task"] = in_short(result.config.task)
    print("  ".join(f"{name}: {value}" for name, value in shown.items()), flush=True)
    reader = stored.learner.task_encoder
    if result.config.task != stored.task and reader is not None and not reader.carries_over:
        print("note: a one-hot code does not carry over to another task; its rows now mean other sub-tasks")
    params = {which: result.params_of(which) for which in chosen}
    reports = evaluations.evaluate_policies(result.experiment, params, arguments.episodes, length)
    print(table(evaluations.lines(reports)), flush=True)
    if result.seeds == parse_seeds(stored.seeds):
        for which, report in reports.items():
            evaluations.store(folder, settings(which), report)
        print(f"stored: {folder.evaluation}", flush=True)
    else:  # of a run that is kept without its checkpoints
        print(_not_stored(result.seeds, parse_seeds(stored.seeds)))
    if arguments.gif and evaluations.draw_episode(result.experiment, result.params[chosen[0]], folder):
        print(f"drawn: {folder.gif}")


def _evaluate_tasks(
    arguments: Arguments, texts: Sequence[str], folder: Any, stored: Any, played: Any, tasks: Sequence[str] | None
) -> None:
    """Play a list of tasks, or certify them; what is printed is stored as well, certificates with what was typed."""
    from experiments import evaluate_tasks
    from t2tl_jax.runs import evaluations, provenance
    from t2tl_jax.training.seeds import parse_seeds

    result = played.result

    def settings(which: Any, episodes: int) -> Any:
        of_run = evaluations.settings(folder, result.experiment, which, result.iteration, episodes)
        return of_run | played.settings

    if arguments.certify or tasks is None:
        one: Any = "best" if arguments.which == "best" else "final"
        where = provenance.describe(["python", "-m", "experiments.evaluate", *texts])
        made = evaluate_tasks.certify(
            result,
            stored,
            tasks,
            one,
            arguments.seed,
            arguments.policy or "sampled",
            arguments.certify,
            arguments.pools,
        )
        evaluate_tasks.store_certificates(folder, settings(one, arguments.certify), {"where": where, **made})
        print(f"stored: {folder.certificates}")
        return
    chosen = tuple(result.params) if arguments.which == "both" else (arguments.which,)
    shown = settings(arguments.which, arguments.episodes) | {"task": f"{len(tasks)} of a list"}
    print("  ".join(f"{name}: {value}" for name, value in shown.items()), flush=True)
    reports = evaluate_tasks.evaluate(result, stored, tasks, chosen, arguments.episodes, arguments.pools)
    if result.seeds != parse_seeds(stored.seeds):
        print(_not_stored(result.seeds, parse_seeds(stored.seeds)))
        return
    for which, by_task in reports.items():
        for task, report in by_task.items():
            evaluations.store(folder, settings(which, arguments.episodes) | {"task": task}, report)
    print(f"stored: {folder.evaluation}")


def _not_stored(kept: Sequence[int], trained: Sequence[int]) -> str:
    """Why the evaluation of a run that lacks the parameters of some seeds is not stored."""
    from experiments.tuning import in_words

    seeds, all_of_them = (in_words(of).replace("-", " to ") for of in (kept, trained))
    subject, verb = ("seed", "is") if len(kept) == 1 else ("seeds", "are")
    return f"not stored: only {subject} {seeds} of {all_of_them} {verb} kept with parameters"


def _changes(stored: Any, arguments: Arguments) -> dict[str, Any]:
    """What the flags change: fields of the configuration, and the environment itself."""
    from envs.zones import ZoneConfig
    from t2tl_jax.registry import make_env

    changes: dict[str, Any] = {}
    if arguments.task is not None:
        changes["task"] = arguments.task
    if arguments.physics is not None:
        if not isinstance(stored.env, ZoneConfig):
            raise UserError("--physics chooses the physics of ZoneEnv; the environment of this run offers no choice")
        changes["env"] = make_env(dataclasses.replace(stored.env, physics=arguments.physics))
    if arguments.episode_length is not None:
        changes["episode_length"] = arguments.episode_length
    if arguments.plan is not None:
        changes["plan"] = arguments.plan
    return changes


if __name__ == "__main__":
    sys.exit(main())
