"""Certificates: how often one policy carries out each of some formulas, with exact bounds that hold together."""

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from t2tl_jax.env import EnvParams
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.episodes import play
from t2tl_jax.evaluation.report import aligned
from t2tl_jax.evaluation.statistics import CONFIDENCE, Estimate, exact_rate
from t2tl_jax.evaluation.task_report import RowsMet
from t2tl_jax.ltl import TaskTable
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.runs.policy import seed_slice
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.seeds import CERTIFICATE, stream_keys
from t2tl_jax.training.types import Params

BATCH = 25_000
"""The most episodes that are played side by side on an accelerator."""

CPU_BATCH = 250
"""The same on a CPU, where a batch costs as much for every episode until its last one has ended."""


@dataclass(frozen=True)
class Certificate:
    """One policy of one seed on one formula; the intervals of all formulas hold at once with 95 %."""

    success: Estimate
    """Share of episodes in which the formula became true."""
    violation: Estimate
    """Share of episodes in which it became false."""
    successes: int
    """Episodes in which the formula became true."""
    violations: int
    """Those in which it became false."""
    env_terminations: int
    """Those that the environment ended by itself while the task was open."""
    timeouts: int
    """Those that the time limit cut."""


@dataclass(frozen=True)
class Certificates:
    """One policy of one seed on some formulas, played with random numbers that serve nothing else."""

    by_task: Mapping[str, Certificate]
    """By what each task is called."""
    episodes: int
    """Of each task."""
    batch: int
    """So many of them were played side by side."""
    own_maps: bool
    """Whether each of them was given a map of its own, so that the rates are those over all maps; else those of the
    environment's maps for evaluation, which are all maps only where a reset draws its own."""
    map_seconds: float
    """Until these maps were drawn, once for all tasks."""
    compile_seconds: float
    """Until the program was ready."""
    seconds: float
    """Until all episodes were played."""

    def as_json(self) -> dict[str, Any]:
        """The same as nested dictionaries and numbers."""
        return asdict(self)


def certify(
    experiment: Experiment,
    params: Params,
    index: int,
    tables: Mapping[str, TaskTable],
    episodes: int,
    episode_length: int,
    deterministic: bool,
    batch: int | None = None,
) -> Certificates:
    """Play `episodes` independent episodes of every task, and bound the rates by Clopper and Pearson.

    Where maps are random, each episode has a map of its own, drawn for it alone, so that the rates are those over all
    maps. The intervals, two for every task, share the 5 %, so that all hold together.

    Args:
        experiment: environment and learner.
        params: of all seeds, leading axis [seeds].
        index: the seed's place on it.
        tables: of equal shapes, each with one task, by what the tasks are called.
        episodes: of each task.
        episode_length: time limit in steps.
        deterministic: whether to take the mode of the policy instead of a sample.
        batch: so many episodes are played side by side at most; `BATCH` by default, or `CPU_BATCH` on a CPU. Each batch
            has random numbers of its own.

    Raises:
        UserError: where every episode would be the same one.
    """
    if deterministic and experiment.env.fixed_start:
        raise UserError(
            "a deterministic policy from a fixed start repeats one episode, of which there is no rate to bound; "
            "certify the sampled policy"
        )
    experiment = experiment.with_table(next(iter(tables.values())))
    env, agent, discount = experiment.task_env, experiment.player, experiment.config.learner.discount
    size = min(batch or (CPU_BATCH if jax.default_backend() == "cpu" else BATCH), episodes)

    def counts(
        params: Params, env_params: TaskParams, maps: EnvParams, key: jax.Array, counted: jax.Array
    ) -> jax.Array:
        """Of the first `counted` episodes of a batch: int32[3], successes, violations, ends by the environment."""

        def one(key: jax.Array, own_map: EnvParams) -> jax.Array:
            given = env_params if own_map is None else replace(env_params, env=own_map)
            played = play(env, agent, params, given, key, 1, episode_length, discount, deterministic)
            return jnp.stack([played.success, played.violation, played.env_termination])[:, 0]

        flags = jax.vmap(one)(jax.random.split(key, size), maps)
        return (flags & (jnp.arange(size) < counted)[:, None]).sum(axis=0)

    own = seed_slice(params, index)
    begun = time.perf_counter()
    maps = experiment.env.independent_params(experiment.seeds[index], episodes)
    drawn = time.perf_counter()
    every = experiment.env_params("evaluation")
    env_params = replace(every, env=seed_slice(every.env, index))
    key = stream_keys(experiment.seeds, CERTIFICATE)[index]
    program = jax.jit(counts).lower(own, env_params, _batch(maps, 0, size), key, jnp.int32(size)).compile()
    compiled = time.perf_counter()
    given = {task: replace(env_params, table=table) for task, table in tables.items()}
    batches = [
        (_batch(maps, first, size), jax.random.fold_in(key, number), jnp.int32(min(size, episodes - first)))
        for number, first in enumerate(range(0, episodes, size))
    ]
    totals = {task: sum(program(own, tasks, *batch) for batch in batches) for task, tasks in given.items()}
    by_task = {task: _certificate(np.asarray(total), episodes, 2 * len(tables)) for task, total in totals.items()}
    return Certificates(
        by_task,
        episodes,
        size,
        own_maps=maps is not None,
        map_seconds=drawn - begun,
        compile_seconds=compiled - drawn,
        seconds=time.perf_counter() - compiled,
    )


def _batch(maps: EnvParams | None, first: int, size: int) -> EnvParams | None:
    """The maps of `size` episodes from number `first` on; where fewer are left, some again for those not counted."""
    return jax.tree.map(lambda part: jnp.asarray(np.take(part, range(first, first + size), axis=0, mode="wrap")), maps)


def _certificate(counts: np.ndarray, episodes: int, intervals: int) -> Certificate:
    successes, violations, ended = counts.tolist()
    return Certificate(
        success=exact_rate(successes, episodes, intervals),
        violation=exact_rate(violations, episodes, intervals),
        successes=successes,
        violations=violations,
        env_terminations=ended,
        timeouts=episodes - successes - violations - ended,
    )


_ON_MAPS = {True: "Each episode has a map of its own", False: "On the maps that the environment gives for evaluation"}


def table(certificates: Certificates, met: RowsMet | None = None) -> str:
    """A table to print: one line per task.

    Args:
        certificates: what to show.
        met: per task, as in `tasks_table`.
    """
    met = met or RowsMet()
    lines: list[tuple[str, ...]] = [("task", "rows met", "renamed", "success", "violation", "time-out", "ended by env")]
    for task, one in certificates.by_task.items():
        others = (f"{count / certificates.episodes:.5f}" for count in (one.timeouts, one.env_terminations))
        lines.append((task, *met.cells(task), one.success.text(5), one.violation.text(5), *others))
    number = 2 * len(certificates.by_task)
    return "\n".join(
        [
            *aligned(lines),
            *met.legend(),
            f"Brackets: exact binomial intervals (Clopper and Pearson) from {certificates.episodes:,} episodes a task.",
            f"All {number} hold at once with {CONFIDENCE:.0%} (Bonferroni, each {1 - (1 - CONFIDENCE) / number:.3%}).",
            f"{_ON_MAPS[certificates.own_maps]}.",
            f"Played in {certificates.seconds:.1f} s, after {certificates.compile_seconds:.1f} s of compiling"
            + (f" and {certificates.map_seconds:.1f} s of drawing maps." if certificates.own_maps else "."),
        ]
    )
