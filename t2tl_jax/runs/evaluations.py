"""Evaluating the policies of a run, and keeping the results beside it."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Literal

import jax
import numpy as np

from t2tl_jax.env import EnvParams
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.animation import captions, record, save_gif
from t2tl_jax.evaluation.episodes import distinct, player_of_seeds
from t2tl_jax.evaluation.report import Report, summarise
from t2tl_jax.evaluation.statistics import Estimate
from t2tl_jax.ltl import TaskTable
from t2tl_jax.runs import machine_files, status_form
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from t2tl_jax.runs.policy import seed_slice
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.seeds import ANIMATION, EVALUATION, stream_keys
from t2tl_jax.training.types import Params

POLICIES = {"deterministic": True, "sampled": False}
"""The mode of the policy's distribution, and draws from it (what was trained)."""

Which = Literal["final", "best"]
"""Which parameters of a run: those at its end, or those that were selected (see `t2tl_jax/runs/selection.py`)."""

WHICH: tuple[Which, ...] = ("final", "best")

Settings = dict[str, str | int]
"""What an evaluation was of; two results with equal settings replace each other."""


def settings(folder: RunFolder, experiment: Experiment, which: Which, iteration: int, episodes: int) -> Settings:
    """Everything that tells one evaluation of a run from another, wherever its folder is moved."""
    config = experiment.config
    own: Settings = {
        "task": machine_files.name_of(config.task, folder.path),
        "physics": experiment.env.backend,
        "checkpoint": which,
        "iteration": iteration,
        "episodes": episodes,
        "episode_length": config.episode_length,
    }
    return own if config.plan == "none" else own | {"plan": config.plan}


def evaluate_policies(
    experiment: Experiment, params: Mapping[Which, Params], episodes: int, episode_length: int
) -> dict[Which, dict[str, Report]]:
    """Play complete episodes with both policies of every seed, on the key stream kept for that.

    Both policies are compiled and run side by side, each once for all parameters.

    Where every episode of a task starts alike, a deterministic policy plays each task once: more would be the same.

    Args:
        experiment: environment, task and learner.
        params: by their name, each with leading axis [seeds]. Equal ones play once.
        episodes: per seed and policy, at most.
        episode_length: time limit in steps.

    Returns:
        By the name of the parameters, then of the policy.
    """
    played = evaluate_tables(experiment, params, [experiment.table], episodes, episode_length)
    return {name: reports[0] for name, reports in played.items()}


def evaluate_tables(
    experiment: Experiment,
    params: Mapping[Which, Params],
    tables: Sequence[TaskTable],
    episodes: int,
    episode_length: int,
    worlds: Sequence[EnvParams] | None = None,
) -> dict[Which, list[dict[str, Report]]]:
    """As `evaluate_policies`, on one table after another. Where they have equal shapes, nothing compiles anew.

    Every table meets the same random numbers, so that what it gives does not depend on the others.

    Args:
        experiment: environment and learner.
        params: as in `evaluate_policies`.
        tables: the tasks, at least one table.
        episodes: per seed, policy and table, at most.
        episode_length: time limit in steps.
        worlds: for each table the environment's parameters, such as its map, with leading axis [seeds]; by default
            those that are kept for evaluation.

    Returns:
        By the name of the parameters, in the order of the tables, by the name of the policy.
    """
    experiment = experiment.with_table(tables[0])
    seeds, discount = experiment.seeds, experiment.config.learner.discount
    keys, env_params = stream_keys(seeds, EVALUATION), experiment.env_params("evaluation")
    worlds = [env_params.env] * len(tables) if worlds is None else worlds
    given = [replace(env_params, table=table, env=world) for table, world in zip(tables, worlds, strict=True)]

    def one(deterministic: bool) -> dict[Which, list[Report]]:
        count = distinct(experiment.task_env, episodes, deterministic)
        play = player_of_seeds(experiment.task_env, experiment.player, count, episode_length, discount, deterministic)

        def report(own: Params, tasks: TaskParams) -> Report:
            machines = tasks.table.pays is not None
            return summarise(jax.device_get(play(own, tasks, keys)), seeds, episode_length, machines)

        reports: dict[Which, list[Report]] = {}
        for name, own in params.items():
            same = [other for other in reports if _equal(own, params[other])]
            reports[name] = reports[same[0]] if same else [report(own, tasks) for tasks in given]
        return reports

    with ThreadPoolExecutor(max_workers=len(POLICIES)) as threads:
        found = dict(zip(POLICIES, threads.map(one, POLICIES.values()), strict=True))
    return {
        name: [{policy: found[policy][name][k] for policy in POLICIES} for k in range(len(tables))] for name in params
    }


def lines(reports: Mapping[Which, Mapping[str, Report]]) -> dict[str, Report]:
    """The same by one name for both, such as ``final deterministic``, for a table."""
    return {f"{which} {policy}": report for which, of in reports.items() for policy, report in of.items()}


def _equal(one: Params, other: Params) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(a is b or np.array_equal(a, b) for a, b in pairs)


def stored(folder: RunFolder) -> list[dict[str, Any]]:
    """The results in ``evaluation.json``; none if the file does not exist.

    Raises:
        UserError: if it holds something else.
    """
    try:
        found = read_json(folder.evaluation).get("evaluations", [])
        whole = isinstance(found, list) and all(
            isinstance(entry, dict) and all(isinstance(entry.get(part), dict) for part in ("settings", "policies"))
            for entry in found
        )
        if not whole:
            raise UserError(f"{folder.evaluation} should hold a list of evaluations, each with settings and policies")
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


FINAL = ("final", "latest")
"""Words for the parameters that training ended with."""


def solved(folder: RunFolder, config: Config, physics: str) -> Estimate | None:
    """Share of seeds that solved the run's own task: success over 95 % with the final parameters, sampled policy.

    Args:
        folder: of the run, whose stored evaluations are read.
        config: its configuration.
        physics: of its environment.

    Returns:
        None if no evaluation of these parameters is stored.

    Raises:
        UserError: if the file holds something else.
    """
    own = {
        "task": machine_files.name_of(config.task, folder.path),
        "physics": physics,
        "episode_length": config.episode_length,
        "iteration": status_form.read(folder).get("iteration"),
    }
    found = None
    for entry in stored(folder):
        what = entry.get("settings", {})
        if (
            what.get("checkpoint") in FINAL
            and "colours" not in what  # those were played on other maps
            and what.get("plan", "none") == config.plan
            and all(
                what.get(name, value) == value  # older files do not name all of them
                for name, value in own.items()
            )
        ):
            try:
                found = Estimate(**entry["policies"]["sampled"]["solved"])
            except (KeyError, TypeError) as error:
                raise UserError(f"{folder.evaluation} lacks the share of solved seeds: {error!r}") from error
    return found


def draw_episode(experiment: Experiment, params: Params, folder: RunFolder) -> bool:
    """Write the GIF of one episode of the first seed's deterministic policy; False for environments without a view.

    Args:
        experiment: environment, task and learner.
        params: with leading axis [seeds].
        folder: of the run.
    """
    view = experiment.env.view()
    if view is None:
        return False
    key = stream_keys(experiment.seeds, ANIMATION)[0]
    env_params = experiment.env_params("evaluation")
    env_params = replace(env_params, env=seed_slice(env_params.env, 0))
    length = experiment.config.episode_length
    recording = record(
        experiment.task_env, view, experiment.player, seed_slice(params, 0), env_params, key, length, deterministic=True
    )
    try:
        save_gif(recording, view, folder.gif, captions(experiment.row_texts()))
    except OSError as error:
        raise UserError(f"cannot write {folder.gif}: {error.strerror or error}") from error
    return True
