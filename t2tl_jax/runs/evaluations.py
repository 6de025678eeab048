"""Evaluating the policies of a run, and keeping the results beside it."""

from typing import Any

import jax

from envs.zones import ZoneConfig
from t2tl_jax.runs import machine_files
from t2tl_jax.runs.build import Experiment
from experiments.configs import Config
from t2tl_jax.errors import UserError
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from experiments.views import view_of
from t2tl_jax.evaluation.animation import captions, record, save_gif
from t2tl_jax.evaluation.episodes import evaluate_seeds
from t2tl_jax.evaluation.report import Report, summarise
from t2tl_jax.training.seeds import ANIMATION, EVALUATION, parse_seeds, stream_keys

POLICIES = {"deterministic": True, "sampled": False}
"""The mode of the policy's distribution, and draws from it (what was trained)."""

Settings = dict[str, str | int]
"""What an evaluation was of; two results with equal settings replace each other."""


def settings(folder: RunFolder, config: Config, checkpoint: str, iteration: int, episodes: int) -> Settings:
    """Everything that tells one evaluation of a run from another, wherever its folder is moved."""
    return {
        "task": machine_files.name_of(config.task, folder.path),
        **({"physics": config.env.physics} if isinstance(config.env, ZoneConfig) else {}),
        "checkpoint": checkpoint,
        "iteration": iteration,
        "episodes": episodes,
        "episode_length": config.episode_length,
    }


def evaluate(experiment: Experiment, config: Config, params: Any, episodes: int) -> dict[str, Report]:
    """Play complete episodes with both policies of every seed, on the key stream kept for that.

    Args:
        experiment: environment and learner.
        config: for seeds, time limit and discount.
        params: with leading axis [seeds].
        episodes: per seed and policy.
    """
    seeds = parse_seeds(config.seeds)
    keys = stream_keys(seeds, EVALUATION)
    return {
        name: summarise(
            evaluate_seeds(experiment.of_seed, seeds, params, keys, episodes, config.episode_length, deterministic),
            seeds,
            config.learner.discount,
        )
        for name, deterministic in POLICIES.items()
    }


def stored(folder: RunFolder) -> list[dict[str, Any]]:
    """The results in ``evaluation.json``; none if the file does not exist.

    Raises:
        UserError: if it holds something else.
    """
    try:
        found = read_json(folder.evaluation).get("evaluations", [])
        if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
            raise UserError(f"{folder.evaluation} should hold a list of evaluations")
        return found
    except UserError as error:
        raise UserError(f"{error}; move this file away, so that a new one can be written") from error


def store(folder: RunFolder, what: Settings, reports: dict[str, Report]) -> None:
    """Add results to ``evaluation.json``, in place of older ones of the same settings.

    Raises:
        UserError: if the file is damaged or cannot be written.
    """
    kept = [entry for entry in stored(folder) if entry.get("settings") != what]
    entry = {"settings": what, "policies": {name: report.as_json() for name, report in reports.items()}}
    try:
        write_json(folder.evaluation, {"evaluations": [*kept, entry]})
    except OSError as error:
        raise UserError(f"cannot write {folder.evaluation}: {error.strerror or error}") from error


def draw_episode(experiment: Experiment, config: Config, params: Any, folder: RunFolder) -> bool:
    """Write the GIF of one episode of the first seed's deterministic policy; False for environments without a view.

    Args:
        experiment: environment and learner.
        config: for seeds and time limit.
        params: with leading axis [seeds].
        folder: of the run.
    """
    view = view_of(experiment.env)
    if view is None:
        return False
    seeds = parse_seeds(config.seeds)
    key = stream_keys(seeds, ANIMATION)[0]
    env, agent = experiment.of_seed(jax.numpy.uint32(seeds[0]))
    first = jax.tree.map(lambda x: x[0], params)
    recording = record(env, view, agent, first, key, config.episode_length, deterministic=True)
    try:
        save_gif(recording, view, folder.gif, captions(experiment.row_texts))
    except OSError as error:
        raise UserError(f"cannot write {folder.gif}: {error.strerror or error}") from error
    return True
