"""Train, resume and load: the runs of this library from Python. Nothing here prints; callbacks see what happens."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

from t2tl_jax.env import EnvConfig, LabelledEnv
from t2tl_jax.errors import UserError, explained
from t2tl_jax.evaluation.report import Report
from t2tl_jax.registry import named_config
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import machine_files, pretraining
from t2tl_jax.runs.callbacks import Callback
from t2tl_jax.runs.checkpoints import CheckpointError, Checkpoints
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import Experiment, build
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.given_env import GivenEnv
from t2tl_jax.runs.interrupts import Interrupted, NeverStop, Stoppable
from t2tl_jax.runs.metrics_file import MetricsFileError, history
from t2tl_jax.runs.provenance import describe
from t2tl_jax.runs.result import Result
from t2tl_jax.runs.training import Training
from t2tl_jax.training.types import LearnerConfig

CHANGEABLE = ("frames", "convergence", "until_solved", "run")
"""Fields of a configuration that may change when a run is resumed."""


def train(
    config: str | Config | LabelledEnv,
    task: str | None = None,
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
        chosen, env = _configuration(config, task, learner, seeds, changes)
        stop = stop or NeverStop()
        first = pretrained if isinstance(pretrained, Result) else None
        if pretrained is not None:
            source = pretrained if first is None else (first.folder or "given")
            chosen = replace(chosen, pretrained=str(source))
        chosen = pretraining.located(chosen)
        experiment = stop.call(lambda: _checked(chosen, env, first), "while preparing")
        run = None
        if folder is not None:
            run = run_folder.create(Path(folder), chosen, describe(command and list(command)))
            experiment = replace(experiment, config=machine_files.with_copy(chosen, run.path))


        def pretrain() -> Result:
            inner = None if run is None else run.path / pretraining.FOLDER
            return first or _pretrain(chosen, experiment.env, inner, pretraining_callbacks, stop, command)

        return Training(experiment, stop, callbacks, run, pretrain if chosen.pretrained else None).run()


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

    Args:
        folder: of the run.
        env: the environment itself, for a run that was given one instead of naming it.
        callbacks, pretraining_callbacks, stop, command: as for `train`.
        **changes: of the fields `frames`, `convergence`, `until_solved` and `run`.

    Raises:
        UserError: if the folder or the changes cannot be used.
        Interrupted: as for `train`.
    """
    stop = stop or NeverStop()
    with explained():
        run, stored = run_folder.open_existing(Path(folder))
        config = replace(stored, **changes)
        changed = [
            field.name
            for field in fields(Config)
            if field.name not in CHANGEABLE and getattr(config, field.name) != getattr(stored, field.name)
        ]
        if changed:
            raise UserError(
                "a resumed run keeps its configuration; only --frames, --until-solved, --convergence.* and --run.* "
                f"apply, not {', '.join(changed)}"
            )
        with Checkpoints(run.checkpoints) as checkpoints:
            begun = checkpoints.latest_iteration() is not None
        experiment = stop.call(lambda: _checked(config, env, None, begun), "while preparing")
        with run_folder.locked(run):
            _log_session(run, config, command)

        def pretrain() -> Result:
            inner = run.path / pretraining.FOLDER
            return _pretrain(config, experiment.env, inner, pretraining_callbacks, stop, command)

        return Training(experiment, stop, callbacks, run, pretrain if config.pretrained else None).run()


def load(
    folder: str | Path,
    *,
    env: LabelledEnv | None = None,
    checkpoint: Literal["best", "latest"] = "best",
    **changes: Any,
) -> Result:
    """The result of a run on disk, finished or not.

    Args:
        folder: of the run.
        env: the environment itself, for a run that was given one instead of naming it.
        checkpoint: which parameters: with the highest discounted return in training, or the latest ones.
        **changes: of fields of the configuration, such as ``task``, for an experiment on another task.

    Raises:
        UserError: if it is no run, holds no checkpoint, or does not fit this version or the changes.
    """
    with explained():
        run, stored = run_folder.open_existing(Path(folder))
        experiment = build(replace(stored, **changes), env)
        try:
            shapes = experiment.params_shapes
        except (ValueError, TypeError) as error:
            raise UserError(
                f"the network of {run.path} cannot read {experiment.config.task}: {error}\n"
                "A trained network keeps the kind and the sizes that it was made with: choose a task within them, or "
                "train another run for this one."
            ) from error
        try:
            with Checkpoints(run.checkpoints) as checkpoints:
                iteration, params = checkpoints.restore_params(checkpoint, shapes)
        except CheckpointError as error:
            raise UserError(str(error)) from error
        try:
            metrics = history(run.metrics)
        except MetricsFileError:  # the parameters can be used without
            metrics = {}
        ended = run_folder.read_json(run.status).get("state", "unknown")
        return Result(experiment, params, metrics, iteration, ended, run.path)


def _configuration(
    config: str | Config | LabelledEnv,
    task: str | None,
    learner: LearnerConfig | None,
    seeds: int | Sequence[int] | None,
    changes: dict[str, Any],
) -> tuple[Config, LabelledEnv | None]:
    """The configuration that the arguments of `train` mean, and the environment if it was given as an object."""
    unknown = set(changes) - {field.name for field in fields(Config)}
    if unknown:
        raise UserError(f"a configuration has no field {', '.join(sorted(unknown))}")
    if task is not None:
        changes["task"] = task
    if learner is not None:
        changes["learner"] = learner
    if seeds is not None:
        changes["seeds"] = str(seeds) if isinstance(seeds, int) else ",".join(map(str, seeds)) + ","
    if isinstance(config, str):
        return replace(named_config(config), **changes), None
    if isinstance(config, Config):
        return replace(config, **changes), None
    if not isinstance(config, LabelledEnv):
        raise UserError(
            f"train takes the name of a configuration, a Config or a LabelledEnv, got a {type(config).__name__}"
        )
    if "task" not in changes or "learner" not in changes:
        raise UserError(
            "an environment needs a task and a learner: train(env, 'F goal', PPOConfig(...), frames=1_000_000)"
        )
    own: EnvConfig = GivenEnv(name=type(config).__name__)
    return Config(env=own, **changes), config


def _checked(config: Config, env: LabelledEnv | None, first: Result | None, begun: bool = False) -> Experiment:
    """Environment, table, learner and its traced program; everything that can be checked is checked here.

    Args:
        config: what to train.
        env: the environment, where it was given.
        first: the pre-training, where it was given.
        begun: whether there is a checkpoint to go on from, which needs its pre-training no more.
    """
    if isinstance(config.env, GivenEnv) and env is None:
        raise UserError(
            f"the environment of this run, {config.env.name}, was given as an object: give it again, as env=..."
        )
    experiment = build(config, env)
    if not begun:
        if config.pretrained:
            pretraining.check(experiment, first)
        if experiment.pools is not None:
            experiment.pools(0)  # too small caps end a run here or never
    try:
        _ = experiment.program
    except TypeError as error:
        raise UserError(str(error)) from error
    return experiment


def _log_session(run: RunFolder, config: Config, command: Sequence[str] | None) -> None:
    versions = run_folder.read_json(run.versions)
    versions.setdefault("resumed", []).append(describe(command and list(command)))
    run_folder.write_json(run.versions, versions)
    run_folder.write_config(run, config)


def _pretrain(
    config: Config,
    env: LabelledEnv,
    folder: Path | None,
    callbacks: Sequence[Callback],
    stop: Stoppable,
    command: Sequence[str] | None,
) -> Result:
    """The earlier training that a configuration names or asks for; begun, taken up again, or only loaded.

    Raises:
        Interrupted: if it did not come to its end. It goes on where it stopped when the run is resumed.
    """
    if not pretraining.is_auto(config):
        return load(config.pretrained)
    wanted = pretraining.matching(config, env)
    try:
        if folder is None or not (folder / "config.json").is_file():
            result = train(wanted, folder=folder, callbacks=callbacks, stop=stop, command=command)
        else:
            run, stored = run_folder.open_existing(folder)
            if not pretraining.same_run(stored, wanted):
                raise UserError(f"{folder} holds a run of another configuration; move it away")
            if run_folder.read_json(run.status).get("state") == "finished":
                return load(folder)
            result = resume(folder, callbacks=callbacks, stop=stop, command=command)
    except Interrupted as when:
        raise Interrupted(f"during pre-training, {when}") from None
    if result.ended == "interrupted":
        raise Interrupted(f"during pre-training, after iteration {result.iteration:,} of {wanted.iterations:,}")
    return result


def evaluate(run: Result | str | Path, **options: Any) -> dict[str, Report]:
    """Play complete episodes with the policies of a run, given as a result or as its folder: see `Result.evaluate`."""
    return (run if isinstance(run, Result) else load(run)).evaluate(**options)
