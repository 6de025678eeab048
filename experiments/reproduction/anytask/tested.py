"""Playing the agents of a run on other tasks than its own, and what is stored of it: small numbers by seed.

Each part (a suite, the certificates, the episodes for a picture) is written as soon as it is done.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import jax
import numpy as np

from envs.letterworld import LetterWorldParams, maps
from envs.zones import ZoneParams
from experiments.paper import fixed_set
from experiments.reproduction.anytask import suites
from experiments.reproduction.anytask.suites import Suite
from experiments.reproduction.plan import Run, ScaleName
from t2tl_jax.env import EnvParams
from t2tl_jax.evaluation.animation import recorder
from t2tl_jax.evaluation.report import COLUMNS, Report
from t2tl_jax.ltl import Formula, TaskTable, is_family, make_sampler, resolve_task
from t2tl_jax.registry import make_env
from t2tl_jax.runs import any_task, certificates, evaluations
from t2tl_jax.runs.evaluations import Which
from t2tl_jax.runs.folder import read_json, write_text
from t2tl_jax.runs.policy import seed_slice
from t2tl_jax.runs.result import Result
from t2tl_jax.training.seeds import ANIMATION, stream_keys
from t2tl_jax.training.types import Params

FILE = "tested.json"
"""In the folder of the run."""

CERTIFIED, DRAWN = "certificates", "episodes for a picture"
"""The parts that are no suites."""

CERTIFICATE_EPISODES = 100_000

POLICY = "sampled"
"""Which policy is certified."""

AT_ONCE = 4
"""Parts that are played side by side."""

FIGURES = tuple(COLUMNS.values())
"""What is stored of every task, policy and seed."""

EVERY = 5
"""Steps between two stored places of a recorded episode."""

DRAWS = 2000
"""Draws by which the tasks of a small family are found that cannot be listed."""


def parts(run: Run) -> list[str]:
    """What there is to play, by name."""
    return [suite.name for suite in run.suites] + [CERTIFIED] * bool(run.certified) + [DRAWN] * bool(run.drawn)


def is_complete(run: Run, scale: ScaleName, folder: Path) -> bool:
    """Whether all of it was played."""
    return not missing(run, scale, folder)


def missing(run: Run, scale: ScaleName, folder: Path) -> list[str]:
    """What was not played yet."""
    known = read(folder)
    return [part for part in parts(run) if known.get(part, {}).get("scale") != scale]


def read(folder: Path) -> dict[str, Any]:
    """What is stored, by part."""
    file = folder / FILE
    return read_json(file) if file.is_file() else {}


def add(
    run: Run,
    scale: ScaleName,
    result: Result,
    which: Sequence[str],
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Play some parts, and store each as soon as it is done. Their programs compile side by side.

    A part that fails leaves the others as they are; the first error is raised when they are done. Once `stopped` says
    so, no further part is begun.
    """
    assert result.folder is not None
    file, failed = result.folder / FILE, list[Exception]()

    def play(part: str) -> tuple[str, dict[str, Any]] | None:
        return None if stopped() else _made(run, scale, result, part)

    with ThreadPoolExecutor(max_workers=AT_ONCE) as threads:
        for made in as_completed([threads.submit(play, part) for part in which]):
            try:
                found = made.result()
            except Exception as error:
                failed.append(error)
                continue
            if found is not None:
                part, entry = found
                write_text(file, _compact({**read(result.folder), part: entry}))
    if failed:
        raise failed[0]


def _compact(content: dict[str, Any]) -> str:
    """JSON with a line for each part, and for each task of a suite."""

    def line(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False, allow_nan=False)

    def part(entry: dict[str, Any]) -> str:
        tasks = ",\n".join(f"{line(name)}: {line(of)}" for name, of in entry.get("tasks", {}).items())
        rest = [f"{line(name)}: {line(value)}" for name, value in entry.items() if name != "tasks"]
        return ", ".join([*rest, *([f'"tasks": {{\n{tasks}\n}}'] if tasks else [])])

    return "{\n" + ",\n".join(f"{line(name)}: {{{part(entry)}}}" for name, entry in content.items()) + "\n}\n"


def _made(run: Run, scale: ScaleName, result: Result, part: str) -> tuple[str, dict[str, Any]]:
    began, small = time.perf_counter(), scale == "smoke"
    if part == CERTIFIED:
        found = _certified(result, run.certified[:2] if small else run.certified, 20 if small else CERTIFICATE_EPISODES)
    elif part == DRAWN:
        found = _drawn(result, run.drawn)
    else:
        (suite,) = (suite for suite in run.suites if suite.name == part)
        found = _played(result, suite, small)
    return part, {"scale": scale, **found, "took": round(time.perf_counter() - began, 1)}


def _played(result: Result, suite: Suite, small: bool) -> dict[str, Any]:
    """A suite's figures; of two tasks within the training's time limit, if it is to be small."""
    if suite.env is not None:
        result = result.elsewhere(make_env(suite.env), suite.tasks)
    own, most, episodes = result.config.episode_length, 2 if small else None, 2 if small else suites.EPISODES
    length = own if small else suite.limit or own
    experiment = result.experiment
    params: dict[Which, Params] = {"final": result.params_of("final")}
    if suite.manner == "maps":
        on_map, worlds = on_maps(result, suite.tasks[0], most)
        count = min(suites.ON_OWN_MAP, episodes)
        played = evaluations.evaluate_tables(experiment, params, on_map, count, length, worlds)["final"]
        return {"episodes": count, "tasks": {name_of_maps(len(on_map)): _over_tasks(played)}}
    if suite.manner == "together":
        (name,) = suite.tasks
        formulas = every_task(name, experiment.env.propositions)
        tables = {name_of_all(name, len(formulas)): any_task.compile_formulas(experiment, formulas)}
    else:
        tables = any_task.compile_each(experiment, suite.tasks[:most])
    if suite.exchanged:
        tables = {name: exchanged(table) for name, table in tables.items()}
    played = evaluations.evaluate_tables(experiment, params, list(tables.values()), episodes, length)["final"]
    found = {name: _by_policy(reports) for name, reports in zip(tables, played, strict=True)}
    return {"episodes": episodes, "tasks": found}


def name_of_maps(count: int) -> str:
    """What so many tasks with a map each are called."""
    return f"{count} tasks on their maps"


def name_of_all(family: str, count: int) -> str:
    """What all tasks of a family are called, which are played in turns."""
    return f"{family}, all {count}"


def name_elsewhere(task: str, suite: Suite) -> str:
    """What a task is called that is played in another world, or otherwise, too."""
    return f"{task} ({suite.name})"


def every_task(family: str, propositions: Sequence[str]) -> list[Formula]:
    """Every task of a small family, in an order of their texts; of a task, itself."""
    if not is_family(family, propositions):
        return [resolve_task(family)]
    draw, rng = make_sampler(family, propositions), Random(0)
    return sorted({draw(rng) for _ in range(DRAWS)}, key=str)


def exchanged(table: TaskTable) -> TaskTable:
    """The table whose open rows show each other's texts, each that of the next one; what they are stays."""
    open_rows = np.flatnonzero(np.asarray(table.verdict) == 0)
    shown = np.arange(table.num_rows)
    shown[open_rows] = np.roll(open_rows, -1)
    return replace(table, tokens=table.tokens[shown], mask=table.mask[shown])


def on_maps(result: Result, which: str, most: int | None) -> tuple[list[TaskTable], list[EnvParams]]:
    """DeepLTL's tasks in tables of equal shapes, and the map of each for every seed.

    Args:
        result: the run, in whose environment they are played.
        which: zones or letters.
        most: so many of them; None for all 50.
    """
    env, seeds = result.experiment.env, len(result.seeds)
    lines = (fixed_set.ZONES if which == "zones" else fixed_set.LETTERS)[:most]
    table = any_task.compile_formulas(result.experiment, fixed_set.formulas(which)[:most])
    tables = [replace(table, initial_row=table.initial_row[k : k + 1]) for k in range(len(lines))]
    if which == "zones":
        worlds: list[Any] = [
            ZoneParams(starts=fixed_set.start(line)[None], zones=fixed_set.discs(line)[None]) for line in lines
        ]
    else:
        worlds = [LetterWorldParams(maps.from_text(line["grid"], env.propositions)[None]) for line in lines]
    stacked = [jax.tree.map(lambda x: np.broadcast_to(x, (seeds, *np.shape(x))), world) for world in worlds]
    return tables, stacked


def _by_policy(reports: Mapping[str, Report]) -> dict[str, dict[str, list[float | None]]]:
    return {
        policy: {name: [_rounded(getattr(seed, name).value) for seed in report.seeds] for name in FIGURES}
        for policy, report in reports.items()
    }


def _over_tasks(played: Sequence[Mapping[str, Report]]) -> dict[str, dict[str, list[float | None]]]:
    """Means over tasks, of steps over those that were carried out."""
    each = [_by_policy(reports) for reports in played]
    found: dict[str, dict[str, list[float | None]]] = {}
    for policy in each[0]:
        found[policy] = {}
        for name in FIGURES:
            values = np.array([one[policy][name] for one in each], np.float64)  # [tasks, seeds]; None becomes NaN
            known = np.isfinite(values).sum(axis=0)
            sums = np.nansum(values, axis=0)
            found[policy][name] = [_rounded(s / n) if n else None for s, n in zip(sums, known.tolist(), strict=True)]
    return found


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")


def _certified(result: Result, tasks: Sequence[str], episodes: int) -> dict[str, Any]:
    made = certificates.certify(
        result.experiment,
        result.params_of("final"),
        0,
        result.tables(tasks),
        episodes,
        result.config.episode_length,
        evaluations.POLICIES[POLICY],
    )
    return {"seed": result.seeds[0], "policy": POLICY, **made.as_json()}


def _drawn(result: Result, tasks: Sequence[str]) -> dict[str, Any]:
    """An episode of the first seed's deterministic policy for each task, all from one start on one map."""
    experiment, tables = result.experiment, result.tables(tasks)
    experiment = experiment.with_table(next(iter(tables.values())))
    length, params = result.config.episode_length, seed_slice(result.params_of("final"), 0)
    every = experiment.env_params("evaluation")
    world = jax.tree.map(lambda x: x[:1], seed_slice(every.env, 0))  # one map of its pool
    play = recorder(experiment.task_env, experiment.env.view(), experiment.agent, length, deterministic=True)
    key, episodes = stream_keys(result.seeds, ANIMATION)[0], []
    for task, table in tables.items():
        seen = play(params, replace(every, env=world, table=table), key)
        kept = [*range(0, len(seen.rows) - 1, EVERY), len(seen.rows) - 1]
        places = np.asarray(seen.scenes.agent)[kept]
        changes = np.flatnonzero(np.diff(seen.rows)) + 1
        episodes.append(
            {
                "task": task,
                "outcome": seen.outcome,
                "steps": len(seen.rows) - 1,
                "way": [[round(float(x), 3) for x in place] for place in places],
                "changes": [[round(float(x), 3) for x in np.asarray(seen.scenes.agent)[step]] for step in changes],
                "discs": [[round(float(x), 3) for x in disc] for disc in np.asarray(seen.scenes.discs)[0]],
            }
        )
    return {"seed": result.seeds[0], "policy": "deterministic", "episodes": episodes}
