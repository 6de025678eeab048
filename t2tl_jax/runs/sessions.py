"""One session of a run: what is checked before it, its start or its continuation, and what it left on disk."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from t2tl_jax.errors import UserError, check_type
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import machine_files, params_file, pretraining, status_form
from t2tl_jax.runs.callbacks import Callback
from t2tl_jax.runs.checkpoints import CheckpointError, Checkpoints
from t2tl_jax.runs.evaluations import Which
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.interrupts import Interrupted, Stoppable
from t2tl_jax.runs.metrics_file import MetricsFileError, history
from t2tl_jax.runs.provenance import describe
from t2tl_jax.runs.result import Result
from t2tl_jax.runs.training import Training
from t2tl_jax.training import hosts
from t2tl_jax.training.types import Params


@dataclass(frozen=True)
class Session:
    """Who watches a training, and who may stop it."""

    callbacks: Sequence[Callback]
    pretraining_callbacks: Sequence[Callback]
    stop: Stoppable
    command: Sequence[str] | None

    def __post_init__(self) -> None:
        for what, given in (("callbacks", self.callbacks), ("pretraining_callbacks", self.pretraining_callbacks)):
            check_type(what, given, list, tuple)
        for one in (*self.callbacks, *self.pretraining_callbacks):
            if not isinstance(one, Callback):
                raise UserError(f"a callback is an object of a class that derives from t2tl_jax.Callback, got {one!r}")

    @property
    def versions(self) -> dict[str, Any]:
        """For the record of the run."""
        return describe(self.command and list(self.command))

    @property
    def of_pretraining(self) -> "Session":
        """The same for the pre-training."""
        return replace(self, callbacks=self.pretraining_callbacks, pretraining_callbacks=())


Before: TypeAlias = Experiment | Result | None
"""A pre-training that is to come, one that is there, or none."""


def checked(experiment: Experiment, first: Result | None, begun: bool = False) -> tuple[Experiment, Experiment | None]:
    """Trace the program of a training and begin to compile it; everything that can be checked is checked here.

    Args:
        experiment: what to train.
        first: the pre-training, where it was given.
        begun: whether there is a checkpoint to go on from, which needs its pre-training no more.

    Returns:
        The experiment, and that of its pre-training, if it is to begin with one.

    Raises:
        UserError: for what cannot be trained.
    """
    config, before = experiment.config, None
    if not begun:
        if config.run.devices_per_seed > 1 and experiment.agent.num_envs == 1:
            one = getattr(config.learner, "num_envs", None) == 1
            raise UserError(
                ("a seed has one environment, and nothing to spread" if one else "this learner does not spread a seed")
                + f", got run.devices_per_seed={config.run.devices_per_seed}; leave it out: seeds are shared out over "
                "devices in any case. "
                + ("More environments (learner.num_envs) can be spread" if one else "PPO and DQN can spread a seed")
            )
        if config.pretrained:
            before = pretraining.check(experiment, first)
            if pretraining.is_auto(config):
                before.compilation(fresh=True)  # goes on beside the tracing below
        if experiment.pools is not None:
            experiment.pools.training(0)  # too small caps end a run here or never
    try:
        _ = experiment.program
    except TypeError as error:
        raise UserError(str(error)) from error
    if not begun:
        experiment.compilation(fresh=True)
    return experiment, before


def started(experiment: Experiment, folder: Path | None, session: Session, before: Before) -> Result:
    """A training from its start."""
    run = None
    if folder is not None:
        config = experiment.config
        if hosts.is_first():
            run_folder.create(folder, config, session.versions)
        hosts.meet()  # now it is there for all
        run = RunFolder(folder)
        experiment = experiment.with_config(machine_files.with_copy(config, run.path))
        with run_folder.locked(run) if hosts.is_first() else nullcontext():
            return trained(experiment, run, session, before)
    return trained(experiment, None, session, before)


def continued(experiment: Experiment, run: RunFolder, session: Session, before: Before) -> Result:
    """A training from its last checkpoint, or from its start if it has none."""

    def resumed() -> None:
        note_resumed(run, session)
        run_folder.write_config(run, experiment.config)

    with run_folder.locked(run) if hosts.is_first() else nullcontext():
        return trained(experiment, run, session, before, resumed)


def note_resumed(run: RunFolder, session: Session) -> None:
    """Add this session to the record of a run's sessions."""
    versions = run_folder.read_json(run.versions)
    earlier = versions.get("resumed", [])
    if not isinstance(earlier, list):
        raise UserError(f"{run.versions}: resumed should be a list, got {repr(earlier)[:40]}; move the file away")
    run_folder.write_json(run.versions, versions | {"resumed": [*earlier, session.versions]})


def trained(
    experiment: Experiment,
    run: RunFolder | None,
    session: Session,
    before: Before,
    resumed: Callable[[], None] | None = None,
) -> Result:
    """A training in a folder that is there and locked, from its last checkpoint if it has one; None for no folder.

    `resumed` is called when it is known that it can go on.
    """
    first = _pretrain(experiment, run, session, before)
    return Training(experiment, session.stop, session.callbacks, run, first, resumed).run()


def loaded(experiment: Experiment, run: RunFolder) -> Result:
    """What a run on disk has come to."""
    try:
        shapes = experiment.params_shapes
    except (ValueError, TypeError) as error:
        raise UserError(
            f"the network of {run.path} cannot read {experiment.config.task}: {error}\n"
            "A trained network keeps the kind and the sizes that it was made with: choose a task within them, or "
            "train another run for this one."
        ) from error
    try:
        iteration, params = _restored(run, shapes)
    except CheckpointError as error:
        raise UserError(str(error)) from error
    try:
        metrics = history(run.metrics, experiment.seeds if params_file.stands_in(run) else None)
    except MetricsFileError:  # the parameters can be used without
        metrics = {}
    status = status_form.read(run)
    ended = status.get("ended") or status.get("state", "unknown")
    return Result(experiment, params, metrics, iteration, ended, run.path)


def _restored(run: RunFolder, shapes: Params) -> tuple[int, dict[Which, Params]]:
    """The iteration, and the final and the best parameters."""
    if params_file.stands_in(run):
        return params_file.read(run.params, shapes)
    with Checkpoints(run.checkpoints) as checkpoints:
        stored = checkpoints.read(lambda _: {"latest": shapes, "best": shapes})
    return stored.iteration, {"final": stored.items["latest"], "best": stored.items["best"]}


def _pretrain(
    experiment: Experiment, run: RunFolder | None, session: Session, before: Before
) -> Callable[[], Result] | None:
    """What gives the pre-training of a run; None where there is none."""
    if before is None or isinstance(before, Result):
        return None if before is None else lambda: before
    if not pretraining.is_auto(experiment.config):
        return lambda: loaded(before, RunFolder(Path(experiment.config.pretrained)))
    folder = None if run is None else run.path / pretraining.FOLDER
    return lambda: _pretrained(before, folder, session.of_pretraining)


def _pretrained(before: Experiment, folder: Path | None, session: Session) -> Result:
    """The pre-training that a configuration asks for: begun, taken up again, or only loaded.

    Raises:
        Interrupted: if it did not come to its end. It goes on where it stopped when the run is resumed.
    """
    wanted = before.config
    try:
        if folder is None or hosts.of_first(str((folder / "config.json").is_file())) == str(False):
            _ = before.program  # says what is wrong before a folder is made
            result = started(before, folder, session, None)
        else:
            run, stored = run_folder.open_existing(folder)
            if not pretraining.same_run(stored, wanted):
                raise UserError(f"{folder} holds a run of another configuration; move it away")
            if hosts.of_first(str(status_form.read(run).get("state"))) == "finished":
                return loaded(before, run)
            result = continued(before.with_config(replace(stored, run=wanted.run)), run, session, None)
    except Interrupted as when:
        raise Interrupted(f"during pre-training, {when}") from None
    if result.ended == "interrupted":
        raise Interrupted(f"during pre-training, after iteration {result.iteration:,} of {wanted.iterations:,}")
    return result
