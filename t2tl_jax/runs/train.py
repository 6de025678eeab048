"""Train, resume and load: the runs of this library from Python. Nothing here prints; callbacks see what happens."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, overload

from t2tl_jax.env import EnvConfig, LabelledEnv
from t2tl_jax.errors import Note, UserError, check_type, did_you_mean, explained
from t2tl_jax.evaluation.report import Report
from t2tl_jax.ltl import TaskFamily
from t2tl_jax.old_names import FIELDS
from t2tl_jax.registry import named_config
from t2tl_jax.runs import config_files, params_file, pretraining, sessions
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.callbacks import Callback
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.differences import changed_fields
from t2tl_jax.runs.experiment import build
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.given_env import GivenEnv
from t2tl_jax.runs.interrupts import NeverStop, Stoppable
from t2tl_jax.runs.migration import VERSION
from t2tl_jax.runs.result import Result
from t2tl_jax.training import hosts
from t2tl_jax.training.seeds import parse_seeds
from t2tl_jax.training.types import LearnerConfig

CHANGEABLE = ("frames", "convergence", "until_solved", "run")
"""Fields of a configuration that may change when a run is resumed."""


def train(
    config: str | Config | LabelledEnv,
    task: str | TaskFamily | None = None,
    learner: LearnerConfig | None = None,
    *,
    seeds: int | Sequence[int] | None = None,
    pretrained: Result | str | Path | None = None,
    folder: str | Path | None = None,
    callbacks: Sequence[Callback] = (),
    pretraining_callbacks: Sequence[Callback] = (),
    stop: Stoppable | None = None,
    command: Sequence[str] | None = None,
    **changes: Any,
) -> Result:
    """Train all seeds of a configuration in one program.

    Args:
        config: a configuration by name or value, or an environment object, which needs a task and a learner.
        task: a formula, a task by name, or a family; by default the configuration's own.
        learner: such as ``PPOConfig(...)``, with its network; by default the configuration's own.
        seeds: how many (4 means 0, 1, 2, 3), or which.
        pretrained: where the task encoder comes from: the result of an earlier `train`, or a folder, or the texts that
            `Config.pretrained` takes.
        folder: keep the run in this folder, which must not hold anything yet; by default nothing is written.
        callbacks: see `Callback`.
        pretraining_callbacks: the same for a pre-training that the configuration asks for ('auto').
        stop: who may ask the training to stop after an iteration; by default nobody.
        command: for the record of the run, instead of this process's own command line.
        **changes: other fields of the configuration, such as ``frames=2_000_000``.

    Raises:
        UserError: for anything that cannot be used, before any work is done.
        Interrupted: if `stop` asked for it before the first iteration was complete.
    """
    with explained():
        first = pretrained if isinstance(pretrained, Result) else None
        if pretrained is not None:
            check_type("pretrained", pretrained, Result, str, PathLike)
            changes["pretrained"] = str(pretrained if first is None else (first.folder or pretraining.GIVEN))
        chosen, env = _configuration(config, task, learner, seeds, changes)
        chosen = pretraining.located(chosen)
        if folder is not None and hosts.is_first():
            run_folder.check_new(_path(folder))
        session = sessions.Session(callbacks, pretraining_callbacks, stop or NeverStop(), command)
        experiment, before = session.stop.call(lambda: sessions.checked(build(chosen, env), first), "while preparing")
        return sessions.started(experiment, None if folder is None else _path(folder), session, first or before)


def resume(
    folder: str | Path,
    *,
    env: LabelledEnv | None = None,
    callbacks: Sequence[Callback] = (),
    pretraining_callbacks: Sequence[Callback] = (),
    stop: Stoppable | None = None,
    command: Sequence[str] | None = None,
    **changes: Any,
) -> Result:
    """Continue a run from its last checkpoint, or from the beginning if it has none: bit for bit on a CPU.

    A run that begins anew reads once more what it is pre-trained by, and a `Note` says where that lies.

    Args:
        folder: of the run.
        env: the environment itself, for a run that was given one instead of naming it.
        callbacks, pretraining_callbacks, stop, command: as for `train`.
        **changes: of the fields `frames`, `convergence`, `until_solved` and `run`.

    Raises:
        UserError: if the folder or the changes cannot be used.
        Interrupted: as for `train`.
    """
    session = sessions.Session(callbacks, pretraining_callbacks, stop or NeverStop(), command)
    with explained():
        run, stored = run_folder.open_existing(_path(folder))
        if config_files.stored_version(run.config) != VERSION:
            raise UserError(
                f"{run.path} was trained by an earlier version, whose training state this one does not know: it can be "
                "loaded, evaluated, plotted and compared, and its task encoder used, but not trained further"
            )
        if params_file.stands_in(run):
            raise UserError(
                f"{run.path} is kept without its checkpoints: it can be loaded and evaluated, but not trained further"
            )
        _check_env(env)
        config = _changed(stored, changes)
        refuse_other_changes(stored, config)
        if hosts.is_first():
            with run_folder.locked(run):
                pass  # who is in the way is told before the work of preparing
        with Checkpoints(run.checkpoints) as checkpoints:
            done = checkpoints.latest_iteration()
        begun = done is not None
        trained = (done or 0) * config.learner.frames_per_iteration
        if config.frames < trained and config.frames != stored.frames:
            raise UserError(
                f"frames={config.frames:,} is less than the {trained:,} that every "
                f"seed of {run.path} has been trained for; give more, or leave it out"
            )
        if not begun and (elsewhere := pretraining.elsewhere(config)):
            warnings.warn(
                f"{run.path} has no checkpoint yet, so it begins anew, and is pre-trained by what its "
                f"{run.config.name} names: {elsewhere}",
                Note,
                stacklevel=2,
            )
        experiment, before = session.stop.call(
            lambda: sessions.checked(build(config, env), None, begun), "while preparing"
        )
        return sessions.continued(experiment, run, session, before)


def load(
    folder: str | Path,
    *,
    env: LabelledEnv | None = None,
    **changes: Any,
) -> Result:
    """The result of a run on disk, finished or not.

    Of a run that is kept without its checkpoints these are the seeds whose parameters are (`params.npz`).

    Args:
        folder: of the run.
        env: the environment itself, for a run that was given one instead of naming it.
        **changes: of fields of the configuration, such as ``task``, for an experiment on another task.

    Raises:
        UserError: if it is no run, holds no checkpoint, or does not fit this version or the changes.
    """
    with explained():
        run, stored = run_folder.open_existing(_path(folder))
        if params_file.stands_in(run):
            stored = replace(stored, seeds=_in_words(_seeds_kept(run, stored)))
        _check_env(env)
        experiment = build(_changed(stored, changes), env)
        return sessions.loaded(experiment, run)


def _path(folder: str | Path) -> Path:
    if not isinstance(folder, str | PathLike):
        raise UserError(f"a folder is a path, such as 'runs/mine', got {folder!r}")
    return Path(folder)


def _check_env(env: object) -> None:
    check_type("env", env, LabelledEnv, type(None))


def _configuration(
    config: str | Config | LabelledEnv,
    task: str | TaskFamily | None,
    learner: LearnerConfig | None,
    seeds: int | Sequence[int] | None,
    changes: dict[str, Any],
) -> tuple[Config, LabelledEnv | None]:
    """The configuration that the arguments of `train` mean, and the environment if it was given as an object."""
    if task is not None:
        changes["task"] = task
    if learner is not None:
        changes["learner"] = learner
    if seeds is not None:
        changes["seeds"] = str(seeds) if isinstance(seeds, int) else _listed(seeds)
    if isinstance(config, str):
        return _changed(named_config(config), changes), None
    if isinstance(config, Config):
        return _changed(config, changes), None
    if not isinstance(config, LabelledEnv):
        raise UserError(
            f"train takes the name of a configuration, a Config or a LabelledEnv, got a {type(config).__name__}"
        )
    if "task" not in changes or "learner" not in changes:
        raise UserError(
            "an environment needs a task and a learner: train(env, 'F goal', PPOConfig(...), frames=1_000_000)"
        )
    _check_fields(changes)
    own: EnvConfig = GivenEnv(name=type(config).__name__)
    return Config(env=own, **changes), config


def _listed(seeds: Any) -> str:
    """The text that means these seeds; UserError if they are no list of whole numbers."""
    if isinstance(seeds, str):
        return seeds
    if not isinstance(seeds, Iterable):
        raise UserError(f"seeds are a count such as 4 or a list such as [0, 3, 7], got {seeds!r}")
    return _in_words(list(seeds))


def _changed(config: Config, changes: dict[str, Any]) -> Config:
    """The configuration with other fields; UserError for a field that it does not have."""
    _check_fields(changes)
    return replace(config, **changes)


def _check_fields(changes: dict[str, Any]) -> None:
    known = [field.name for field in fields(Config)]
    wrong = [
        f"{name!r}; since version 0.2 it is {FIELDS[name]!r}"
        if name in FIELDS
        else f"{name!r}{did_you_mean(name, known)}"
        for name in changes
        if name not in known
    ]
    if wrong:
        raise UserError(f"a configuration has no field {', '.join(wrong)}")
    task = changes.get("task", "")
    if not isinstance(task, str | TaskFamily):
        raise UserError(f"task is a formula, the name of a task, or a family of tasks, got {task!r}")
    learner = changes.get("learner")
    if learner is not None and not isinstance(learner, LearnerConfig):
        raise UserError(f"learner is the configuration of one, such as PPOConfig(...), got {learner!r}")


def refuse_other_changes(stored: Config, config: Config, as_flags: bool = False) -> None:
    """Refuse to resume a run with another configuration than the stored one, but for what may change.

    Args:
        stored: what the run was trained with.
        config: what it is to go on with.
        as_flags: whether to call fields what the command line calls them.

    Raises:
        UserError: naming what else is changed.
    """
    changed = [name for name in changed_fields(stored, config) if name.partition(".")[0] not in CHANGEABLE]
    if changed and as_flags:
        parts = [f"--{name}.*" if is_dataclass(getattr(config, name)) else f"--{name}" for name in CHANGEABLE]
        may, flags = ", ".join(parts), ", ".join(f"--{name}" for name in changed)
        raise UserError(f"a resumed run keeps its configuration; only {may} may change, not {flags}".replace("_", "-"))
    if changed:
        raise UserError(
            f"a resumed run keeps its configuration; only its fields {', '.join(CHANGEABLE)} may change, "
            f"not {', '.join(changed)}"
        )


def _seeds_kept(run: RunFolder, config: Config) -> tuple[int, ...]:
    """The seeds of a run of which there are parameters; UserError if these are none of its own."""
    kept, known = params_file.seeds(run.params), parse_seeds(config.seeds)
    if not set(kept) <= set(known):
        raise UserError(f"{run.params} is of seeds {list(kept)}, and the seeds of its run are {list(known)}")
    return kept


def _in_words(seeds: Sequence[int]) -> str:
    """The text that means these seeds, also if it is a single one."""
    return ",".join(map(str, seeds)) + ","


@overload
def evaluate(run: Result | str | Path, *, tasks: None = None, **options: Any) -> dict[str, Report]: ...


@overload
def evaluate(run: Result | str | Path, *, tasks: Sequence[str], **options: Any) -> dict[str, dict[str, Report]]: ...


def evaluate(run: Result | str | Path, **options: Any) -> Any:
    """Play complete episodes with the policies of a run, given as a result or as its folder: see `Result.evaluate`."""
    return (run if isinstance(run, Result) else load(run)).evaluate(**options)
