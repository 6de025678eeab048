"""Certificates: how often one policy carries out each of some formulas, with exact bounds that hold together."""

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

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

    The rates are those of this seed's environment: with random maps, those of its pool of maps for evaluation. Both
    intervals of every task share the 5 %, so that all hold together.

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

    def counts(params: Params, env_params: TaskParams, key: jax.Array, counted: jax.Array) -> jax.Array:
        """Of the first `counted` episodes of a batch: int32[3], successes, violations, ends by the environment."""
        played = play(env, agent, params, env_params, key, size, episode_length, discount, deterministic)
        flags = jnp.stack([played.success, played.violation, played.env_termination])
        return (flags & (jnp.arange(size) < counted)).sum(axis=1)

    own = seed_slice(params, index)
    every = experiment.env_params("evaluation")
    env_params = replace(every, env=seed_slice(every.env, index))
    key = stream_keys(experiment.seeds, CERTIFICATE)[index]
    started = time.perf_counter()
    program = jax.jit(counts).lower(own, env_params, key, jnp.int32(size)).compile()
    compiled = time.perf_counter()
    given = {task: replace(env_params, table=table) for task, table in tables.items()}
    batches = [
        (jax.random.fold_in(key, number), jnp.int32(min(size, episodes - begun)))
        for number, begun in enumerate(range(0, episodes, size))
    ]
    totals = {task: sum(program(own, tasks, *batch) for batch in batches) for task, tasks in given.items()}
    by_task = {task: _certificate(np.asarray(total), episodes, 2 * len(tables)) for task, total in totals.items()}
    return Certificates(by_task, episodes, size, compiled - started, time.perf_counter() - compiled)


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
            f"Played in {certificates.seconds:.1f} s, after {certificates.compile_seconds:.1f} s of compiling.",
        ]
    )
