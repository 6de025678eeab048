"""The tasks of a configuration as tables: one for a fixed task, one after another for a family of random ones."""

from collections.abc import Callable
from functools import cache

import numpy as np

from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import AT_MOST_ONE, TaskTable, TooLargeError, compile_named, compile_pool, is_family
from t2tl_jax.runs.config import Config

DRAWS_PER_POOL = 10
"""How often a pool is drawn until its formulas fit into the table; after that, the first pool comes again."""


def make_table(config: Config, env: LabelledEnv) -> TaskTable:
    """Compile the task of a configuration for an environment; of a family, a pool to evaluate on.

    Raises:
        ValueError: for an unknown task, a formula with mistakes, one of other propositions, or one that is decided
            before the first step.
    """
    if is_family(config.task, env.propositions):
        return _pool(config, env, "evaluation")
    length = config.task_length or None
    table = compile_named(config.task, env.propositions, env.alphabet, length=length, progression=config.progression)
    _check_open(config.task, table)
    return table


def make_pools(config: Config, env: LabelledEnv) -> Callable[[int], TaskTable] | None:
    """The pools that a family is trained on, by number; None for any other task.

    Asking for pool 0 raises ``TooLargeError`` where the caps are too small. Later pools always come: a run that could
    begin does not end because of an unlucky draw.
    """
    if not is_family(config.task, env.propositions):
        return None

    @cache
    def first() -> TaskTable:
        return _pool(config, env, "0")

    def pool(number: int) -> TaskTable:
        if number == 0:
            return first()
        # By the number alone, so that a resumed run meets the same pools.
        for which in (str(number), *(f"{number} again {draw}" for draw in range(1, DRAWS_PER_POOL))):
            try:
                return _pool(config, env, which)
            except TooLargeError:
                continue
        return first()

    return pool


def _check_open(task: str, table: TaskTable) -> None:
    """Refuse what every episode would end with at its first step, whatever the agent does."""
    verdicts = np.asarray(table.verdict)[np.asarray(table.initial_row)]
    if (verdicts > 0).any():
        raise ValueError(f"{task} is true from the start, so there is nothing to learn; give another task")
    if (verdicts < 0).any():
        reason = ""
        if table.alphabet == AT_MOST_ONE:
            reason = f": at most one of {', '.join(table.propositions)} holds at a time in this environment"
        raise ValueError(
            f"{task} can never be satisfied{reason}; give a task that can, such as one goal after another, F(a & F b)"
        )


def _pool(config: Config, env: LabelledEnv, which: str) -> TaskTable:
    reader = config.learner.task_encoder
    if reader is not None and not reader.learned:
        raise ValueError(
            f"{config.task} is a family of random tasks, and a one-hot code says nothing about a task that was not "
            "seen before; use a task encoder that reads formulas, such as transformer"
        )
    if config.task_length:
        raise ValueError(f"rows of a pool have pool.length={config.pool.length} tokens; leave task_length at 0")
    pool = config.pool
    try:
        return compile_pool(
            config.task.strip(),
            env.propositions,
            env.alphabet,
            f"{pool.seed} {which}",
            size=pool.size,
            rows=pool.rows,
            length=pool.length,
            progression=config.progression,
        )
    except TooLargeError as error:
        raise TooLargeError(f"{error}; the fields: pool.length, pool.rows, pool.size") from error
