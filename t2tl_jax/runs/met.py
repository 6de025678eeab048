"""What the training of a run met of some tasks: the rows of the pools that it drew, which can be made again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import (
    Curriculum,
    Formula,
    Share,
    TaskTable,
    is_family,
    languages,
    languages_of_each,
    renaming,
    resolve,
    resolve_tasks,
    share,
)
from t2tl_jax.ltl.languages import Language
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.pools import make_pools

MOST_POOLS = 1
"""The rows of so many pools are counted where nothing else is said. A pool of hundreds of formulas takes seconds, and
the second one asks for that of the evaluation, too."""

_DECIDED = 2
"""The first pools of a curriculum, which do not depend on success in training and can be made again without it."""


@dataclass(frozen=True)
class Met:
    """How many of the open rows of a task training met."""

    exactly: Share
    """The same in meaning."""
    renamed: Share
    """The same under other names of propositions, too."""


@dataclass(frozen=True)
class MetInTraining:
    """What training met of some tasks; at least so much, where not all of its pools were counted."""

    by_task: Mapping[str, Met]
    """By what each task is called in the list."""
    counted: int
    """Pools whose rows were counted; 0 for a training on one task."""
    drawn: int
    """Pools that training drew; 0 for a training on one task."""


def pools_drawn(config: Config, iterations: int) -> int:
    """How many pools a training of a family draws in so many iterations."""
    return -(-iterations // config.pool.period)


def pools_counted(config: Config, iterations: int, most: int) -> int:
    """Of how many of them `met_in_training` counts the rows."""
    most = min(most, _DECIDED) if isinstance(config.task, Curriculum) else most
    return min(most, pools_drawn(config, iterations))


def can_be_compared(config: Config, env: LabelledEnv) -> bool:
    """Whether the rows of a training are compared: not those of reward machines, or of other progression."""
    if config.progression != "exact":
        return False
    return is_family(config.task, env.propositions) or isinstance(resolve(str(config.task)), Formula)


def met_in_training(
    config: Config, env: LabelledEnv, tasks: Sequence[str], iterations: int, most: int = MOST_POOLS
) -> MetInTraining | None:
    """What training met of some tasks; see `t2tl_jax.ltl.split`. Pre-training is not counted.

    The pools of a family are those that it trained on. All seeds share them.

    Args:
        config: of the run.
        env: its environment.
        tasks: names or formulas.
        iterations: that it trained for.
        most: the first pools, at most, whose rows are counted; where training drew more, the shares are at least so
            high.

    Returns:
        None for a training whose rows are not compared.

    Raises:
        TooLargeError: for a row of which too many propositions play the same part.
    """
    if not can_be_compared(config, env):
        return None
    names, alphabet = env.propositions, env.alphabet
    known: dict[Language, Language] = {}
    counted = drawn = 0
    pools = make_pools(config, env)
    if pools is None:
        (known,) = languages_of_each(resolve_tasks([str(config.task)]).values(), names, alphabet)
    else:
        counted, drawn = pools_counted(config, iterations, most), pools_drawn(config, iterations)
        for number in range(counted):
            known.update(new_rows(pools.training(number), known))
    exactly, renamed, part = known.keys(), frozenset(known.values()), counted < drawn
    found = {}
    for name, formula in resolve_tasks(tasks).items():
        (rows,) = languages_of_each([formula], names, alphabet)
        found[name] = Met(share(list(rows), exactly, part), share(list(rows.values()), renamed, part))
    return MetInTraining(found, counted, drawn)


def new_rows(table: TaskTable, known: Mapping[Language, Language]) -> dict[Language, Language]:
    """The open rows of a table that are not known: their languages, and what these are up to renaming."""
    automaton = table.automaton()
    rows = np.flatnonzero(automaton.verdict == 0).tolist()
    found = languages.of_rows(automaton.every_letter(), automaton.verdict, rows)
    new = {language: row for language, row in zip(found, rows, strict=True) if language not in known}
    return dict(zip(new, renaming.of_rows(automaton.steps, automaton.verdict, new.values()), strict=True))
