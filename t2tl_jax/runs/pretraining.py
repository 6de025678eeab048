"""Pre-trained task encoders: an earlier training whose encoder a run starts with.

A configuration names a run (its folder) or says 'auto'; then the earlier training is done first, in a folder inside the
run, and its result is handed on like any other.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from t2tl_jax.env import LabelledEnv
from t2tl_jax.errors import UserError, explained
from t2tl_jax.ltl import is_family
from t2tl_jax.ltl.tasks import is_machine_file
from t2tl_jax.registry import TASK_ENCODERS
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import machine_files, status_form
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.differences import differences
from t2tl_jax.runs.experiment import Experiment, build
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.metrics_file import ending
from t2tl_jax.runs.pretraining_published import as_published
from t2tl_jax.runs.pretraining_schedule import SCHEDULE
from t2tl_jax.single_state import SingleStateConfig
from t2tl_jax.training import transfer
from t2tl_jax.training.types import Params

if TYPE_CHECKING:
    from t2tl_jax.runs.result import Result

AUTO = "auto"
GIVEN = "given"
"""A pre-training whose result was handed over and lies in no folder."""

OWN = "own"
"""Behind ``auto:``, the task of the run itself."""

FOLDER = "pretraining"
"""Folder inside a run in which its own pre-training lies, an ordinary run."""

LAST = 0.1
"""Share of the pre-training, at its end, over which its final figures are averaged."""


def is_auto(config: Config) -> bool:
    """Whether the run does its pre-training itself."""
    return config.pretrained.partition(":")[0] == AUTO


def elsewhere(config: Config) -> str:
    """What a pre-training reads that does not lie in the run itself: another run, or a file of a task; '' for none."""
    if is_auto(config):
        named = config.pretrained.partition(":")[2]
        return named if is_machine_file(named) else ""
    return "" if config.pretrained == GIVEN else config.pretrained


def located(config: Config, folder: Path = Path()) -> Config:
    """The configuration with its pre-training run, as seen from a folder, by default that of this process, as an
    absolute path, which is the same from every directory."""
    if is_auto(config) or not elsewhere(config):
        return config
    return replace(config, pretrained=str((folder / Path(config.pretrained).expanduser()).resolve()))


def matching(config: Config, env: LabelledEnv) -> Config:
    """The configuration that pre-trains a task encoder for `config`: same encoder, same propositions, same seeds.

    An encoder that reads padding also gets as much of it, as far as `config` says how much.
    """
    base = SCHEDULE
    if config.pretraining_schedule == "published":
        base = as_published(base)
    _, _, named = config.pretrained.partition(":")
    task = config.task if named == OWN else named or base.task
    reader = config.learner.task_encoder
    assert reader is not None  # checked with the configuration
    length = _set_length(config, env) if reader.reads_padding else 0
    random = is_family(task, env.propositions)
    network = replace(base.learner.network, task_encoder=reader, freeze_task_encoder=False)
    own = config if task == config.task else config.for_task(task)
    return replace(
        base,
        env=SingleStateConfig(tuple(env.propositions)),
        task=task,
        task_length=0 if random else length,
        pool=replace(base.pool, length=length) if random and length else base.pool,
        progression=config.progression,
        learner=replace(base.learner, network=network),
        seeds=config.seeds,
        run=replace(own.run, gif=False),
    )


def check(experiment: Experiment, first: "Result | None") -> Experiment:
    """Refuse a pre-training that cannot be that of a run, before anything is traced or written.

    Args:
        experiment: of the run that starts with its encoder.
        first: the pre-training, where its result was given.

    Returns:
        The pre-training's own environment, table and learner.

    Raises:
        UserError: if it is no run, has no checkpoint, or its encoder does not fit.
    """
    config = experiment.config
    if first is not None:
        _check_fits(first.experiment, experiment, "the given pre-training")
        return first.experiment
    if config.pretrained == GIVEN:
        raise UserError(
            "this run began with a pre-training that was given as a result and is not kept; it has no checkpoint to go "
            "on from, so begin a new run with train(..., pretrained=result)"
        )
    if not is_auto(config):
        folder, stored = run_folder.open_existing(Path(config.pretrained))
        before = build(stored)
        _check_fits(before, experiment, str(folder.path))
        with Checkpoints(folder.checkpoints) as checkpoints:
            if checkpoints.latest_iteration() is None:
                raise UserError(
                    f"{folder.checkpoints} holds no complete checkpoint, so there is no encoder to start with; finish "
                    "that run (resume), or set pretrained='auto' to pre-train now"
                )
        return before
    try:
        before = build(matching(config, experiment.env))
    except UserError as error:
        raise UserError(
            f"pretrained={config.pretrained!r} cannot be done: {error}\n"
            "In pre-training one proposition at a time is made true. pretrained='auto:TASK' takes another task for it, "
            "pretrained='' does without."
        ) from error
    _check_padding(before, experiment, f"the pre-training on {before.config.task}")
    if before.pools is not None:
        before.pools.training(0)
    return before


def encoder(experiment: Experiment, first: "Result") -> Params:
    """The task encoder of every seed of a run, from its pre-training: leading axis [seeds]."""
    return transfer.task_encoder(first.params_of("best"), transfer.seed_index(first.seeds, experiment.seeds))


def same_run(stored: Config, wanted: Config) -> bool:
    """Whether an earlier session's pre-training is the one that is wanted now."""
    same = machine_files.same_task(stored.task, wanted.task)
    return same and replace(stored, run=wanted.run, task=wanted.task) == wanted


def _check_fits(before: Experiment, experiment: Experiment, source: str) -> None:
    theirs, ours = before.config.learner.task_encoder, experiment.config.learner.task_encoder
    if type(theirs) is not type(ours):
        kind, wanted = (TASK_ENCODERS.name_of(one) for one in (theirs, ours))
        raise UserError(
            f"{source} trained a task encoder of kind {kind}, and this run has {wanted}; "
            f"set learner.network.task_encoder to a {type(theirs).__name__}, or pre-train another"
        )
    departures = list(differences(theirs, ours, "learner.network.task_encoder."))
    if departures:
        raise UserError(
            f"the task encoder of {source} was made with other settings; this run has {', '.join(departures)}"
        )
    if before.env.propositions != experiment.env.propositions:
        raise UserError(
            f"the task encoder of {source} reads formulas over {', '.join(before.env.propositions)}, in this order; "
            f"this environment has {', '.join(experiment.env.propositions)}"
        )
    _check_padding(before, experiment, source)
    with explained():
        transfer.seed_index(before.seeds, experiment.seeds)


def _check_padding(before: Experiment, experiment: Experiment, source: str) -> None:
    """Refuse an encoder that reads padding where there will be more or less of it than in its pre-training."""
    reader = experiment.config.learner.task_encoder
    if reader is None or not reader.reads_padding:
        return
    theirs, ours = (one.table.tokens.shape[-1] for one in (before, experiment))
    if theirs != ours:
        field = "pool.length" if experiment.pools is not None else "task_length"
        raise UserError(
            "a Transformer with masked=False reads the padding of its formulas too, so they need as many tokens here "
            f"as in its pre-training: {theirs} in {source}, {ours} in this run; "
            f"set {field}={theirs}, or another length with pretrained='auto', which pre-trains with that length too"
        )


def summary(first: "Result") -> dict[str, Any]:
    """What a pre-training cost, and how it ended, as far as is known."""
    status = {} if first.folder is None else status_form.read(RunFolder(first.folder))
    spent = status.get("all_sessions", {})
    frames = first.iteration * first.experiment.agent.frames_per_iteration
    end = ending(first.metrics, LAST) if "episodes" in first.metrics else {}

    def rounded(name: str, digits: int) -> list[float | None]:
        values = end.get(name, np.full(len(first.seeds), np.nan))
        return [round(float(x), digits) if np.isfinite(x) else None for x in values]

    return {
        "folder": None if first.folder is None else str(first.folder),
        "task": str(first.config.task),
        "seeds": list(first.seeds),
        "frames_per_seed": frames,
        "compile_wait_seconds": spent.get("compile_wait_seconds", spent.get("compile_seconds", 0.0)),
        "training_seconds": spent.get("training_seconds", 0.0),
        "success_rate": rounded("success_rate", 4),
        "discounted_return": rounded("discounted_return", 4),
        "length": rounded("length", 3),
    }


def in_words(summary: dict[str, Any]) -> str:
    """The summary as one line."""
    # A status of before knows no wait, and counts all that compiling took.
    waited = summary.get("compile_wait_seconds", summary.get("compile_seconds", 0.0))
    spent = f" in {waited + summary['training_seconds']:.0f} s" if summary["folder"] else ""
    return (
        f"{summary['frames_per_seed']:,} frames per seed on {summary['task']}{spent}, "
        f"discounted return {_mean(summary['discounted_return'], 3)}, length {_mean(summary['length'], 2)}"
    )


def _mean(values: list[float | None], digits: int) -> str:
    known = [value for value in values if value is not None]
    return f"{np.mean(known):.{digits}f}" if known else "-"


def _set_length(config: Config, env: LabelledEnv) -> int:
    """Tokens of a row as far as the configuration sets them; 0 where they are as many as the longest formula has."""
    return config.pool.length if is_family(config.task, env.propositions) else config.task_length
