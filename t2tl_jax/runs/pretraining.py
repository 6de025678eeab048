"""Pre-trained task encoders: which configuration trains one, whether one fits, what it cost."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from envs import registry
from envs.single_state import SingleStateConfig
from t2tl_jax.runs import folder as run_folder, stored_params
from t2tl_jax.runs.build import Experiment, make_table
from experiments.compare import differences, ending
from experiments.configs import PRETRAINING, Config
from t2tl_jax.errors import UserError, explained
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.ltl import is_family
from t2tl_jax.networks.task_encoders import TaskEncoderConfig
from t2tl_jax.training import transfer
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.metrics_file import MetricsFileError
from t2tl_jax.training.seeds import parse_seeds

AUTO = "auto"
OWN = "own"
"""Behind ``auto:``, the task of the run itself."""

FOLDER = "pretraining"
"""Folder inside a run in which its own pre-training lies, an ordinary run."""

LAST = 0.1
"""Share of the pre-training, at its end, over which its final figures are averaged."""


def is_auto(config: Config) -> bool:
    """Whether the run does its pre-training itself."""
    return config.pretrained.partition(":")[0] == AUTO


def located(config: Config) -> Config:
    """The configuration with its pre-training run as an absolute path, which is the same from every directory."""
    if not config.pretrained or is_auto(config):
        return config
    return replace(config, pretrained=str(Path(config.pretrained).expanduser().resolve()))


def matching(config: Config) -> Config:
    """The configuration that pre-trains a task encoder for `config`: same encoder, same propositions, same seeds.

    An encoder that reads padding also gets as much of it, as far as `config` says how much.
    """
    encoder = {field.name: getattr(config.network, field.name) for field in fields(TaskEncoderConfig)}
    propositions = _propositions(config)
    _, _, named = config.pretrained.partition(":")
    task = config.task if named == OWN else named or PRETRAINING.task
    length = _set_length(config, propositions) if _reads_padding(config) else 0
    random = is_family(task, propositions)
    return replace(
        PRETRAINING,
        env=SingleStateConfig(propositions),
        task=task,
        task_length=0 if random else length,
        pool=replace(PRETRAINING.pool, length=length) if random and length else PRETRAINING.pool,
        network=replace(PRETRAINING.network, **encoder | {"freeze_task_encoder": False}),
        seeds=config.seeds,
        run=replace(config.run, gif=False),
    )


def open_fitting(config: Config) -> tuple[RunFolder, Config]:
    """The pre-training run that `config.pretrained` names.

    Raises:
        UserError: if it is no run, has no checkpoint, or its encoder cannot be that of `config`; all this before
            anything is traced or written.
    """
    folder, stored = run_folder.open_existing(Path(config.pretrained).expanduser())
    kind, wanted = stored.network.task_encoder, config.network.task_encoder
    if kind != wanted:
        raise UserError(
            f"{folder.path} trained a task encoder of kind {kind}, and this run has {wanted}; "
            f"set --network.task-encoder {kind}, or pre-train another"
        )
    departures = list(differences(getattr(stored.network, kind), getattr(config.network, kind), f"network.{kind}."))
    if departures:
        raise UserError(
            f"the task encoder of {folder.path} was made with other settings; this run has {', '.join(departures)}"
        )
    theirs, ours = _propositions(stored), _propositions(config)
    if theirs != ours:
        raise UserError(
            f"the task encoder of {folder.path} reads formulas over {', '.join(theirs)}, in this order; "
            f"this environment has {', '.join(ours)}"
        )
    check_padding(stored, config, str(folder.path))
    _seed_index(stored, config)
    with Checkpoints(folder.checkpoints) as checkpoints:
        if checkpoints.latest_iteration() is None:
            raise UserError(
                f"{folder.checkpoints} holds no complete checkpoint, so there is no encoder to start with; finish that "
                f"run with --resume {folder.path}, or give --pretrained auto to pre-train now"
            )
    return folder, stored


def check_padding(first: Config, config: Config, source: str) -> None:
    """Refuse an encoder that reads padding where there will be more or less of it than in its pre-training.

    Args:
        first: configuration of the pre-training.
        config: of the run that goes on with the encoder.
        source: what to call the pre-training in messages.

    Raises:
        UserError: says which flag makes the lengths equal.
    """
    if not _reads_padding(config):
        return
    theirs, ours = _row_length(first), _row_length(config)
    if theirs != ours:
        flag = "--pool.length" if is_family(config.task, _propositions(config)) else "--task-length"
        raise UserError(
            "a Transformer with network.transformer.masked=False reads the padding of its formulas too, so they need "
            f"as many tokens here as in its pre-training: {theirs} in {source}, {ours} in this run; "
            f"set {flag} {theirs}, or another length with --pretrained auto, which then pre-trains with that length too"
        )


def load(folder: RunFolder, stored: Config, experiment: Experiment, config: Config) -> Any:
    """The best task encoder of every seed of `config`, leading axis [seeds].

    Args:
        folder: of the pre-training run.
        stored: its configuration.
        experiment: what that stands for.
        config: of the run that goes on with the encoder.

    Raises:
        UserError: if there is no checkpoint, or a seed is missing.
    """
    _, params = stored_params.restore(folder, stored, experiment, "best")
    return transfer.task_encoder(params, _seed_index(stored, config))


def summary(folder: RunFolder, stored: Config) -> dict[str, Any]:
    """What the pre-training cost, and how it ended, as far as is known: for ``status.json``."""
    status = run_folder.read_json(folder.status)
    return {
        "folder": str(folder.path),
        "task": stored.task,
        "seeds": list(parse_seeds(stored.seeds)),
        "frames_per_seed": status.get("frames_per_seed", 0),
        **{name: status.get("all_sessions", {}).get(name, 0.0) for name in ("compile_seconds", "training_seconds")},
        **_ending(folder, stored),
    }


def _ending(folder: RunFolder, stored: Config) -> dict[str, list[float | None]]:
    """Figures of every seed, None for those that are not known: its encoder can be used all the same."""
    try:
        end = ending(folder.metrics, LAST)
    except MetricsFileError as error:
        print(f"note: how the pre-training ended is not known: {error}")
        unknown: list[float | None] = [None] * len(parse_seeds(stored.seeds))
        return {"success_rate": unknown, "discounted_return": unknown, "length": unknown}

    def rounded(values: np.ndarray, digits: int) -> list[float | None]:
        return [round(float(x), digits) if np.isfinite(x) else None for x in values]

    return {
        "success_rate": rounded(end.success, 4),
        "discounted_return": rounded(end.discounted_return, 4),
        "length": rounded(end.length, 3),
    }


def in_words(summary: dict[str, Any]) -> str:
    """The summary as one line."""
    seconds = summary["compile_seconds"] + summary["training_seconds"]
    return (
        f"{summary['frames_per_seed']:,} frames per seed on {summary['task']} in {seconds:.0f} s, "
        f"discounted return {_mean(summary['discounted_return'], 3)}, length {_mean(summary['length'], 2)}"
    )


def _mean(values: list[float | None], digits: int) -> str:
    known = [value for value in values if value is not None]
    return f"{np.mean(known):.{digits}f}" if known else "-"


def _propositions(config: Config) -> tuple[str, ...]:
    return tuple(registry.make(config.env).propositions)


def _reads_padding(config: Config) -> bool:
    return config.network.task_encoder == "transformer" and not config.network.transformer.masked


def _set_length(config: Config, propositions: tuple[str, ...]) -> int:
    """Tokens of a row as far as the configuration sets them; 0 where they are as many as the longest formula has."""
    return config.pool.length if is_family(config.task, propositions) else config.task_length


def _row_length(config: Config) -> int:
    """Tokens of a row."""
    env = registry.make(config.env)
    return _set_length(config, tuple(env.propositions)) or make_table(config, env).tokens.shape[-1]


def _seed_index(stored: Config, config: Config) -> np.ndarray:
    with explained():
        return transfer.seed_index(parse_seeds(stored.seeds), parse_seeds(config.seeds))
