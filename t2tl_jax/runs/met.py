"""What the training of a run met of some tasks: the rows of the pools that it drew, which can be made again."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import (
    Curriculum,
    Formula,
    Share,
    TaskTable,
    compile_tasks,
    is_family,
    languages,
    languages_of_each,
    renaming,
    resolve,
    resolve_tasks,
    row_languages,
    share,
)
from t2tl_jax.ltl.languages import Language
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.pools import Letters, make_pools

MOST_POOLS = 1
"""The rows of so many pools are counted where nothing else is said. A pool of hundreds of formulas takes seconds, and
the second one asks for that of the evaluation, too."""

_DECIDED = 2
"""The first pools of a curriculum, which do not depend on success in training and can be made again without it."""


Rows: TypeAlias = tuple[Set[Language], Set[Language]]
"""By language, and up to renaming of propositions."""


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
        env: that of the training.
        tasks: names or formulas, perhaps over other propositions, too; see `met_elsewhere`.
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
        if others := [other for other in formula.propositions() if other not in names]:
            found[name] = Met(*met_elsewhere(formula, (*names, *others), env, (exactly, renamed), part))
            continue
        (rows,) = languages_of_each([formula], names, alphabet)
        found[name] = Met(share(list(rows), exactly, part), share(list(rows.values()), renamed, part))
    return MetInTraining(found, counted, drawn)


def met_elsewhere(
    formula: Formula, there: Sequence[str], here: Letters, known: Rows, at_least: bool = False
) -> tuple[Share, Share]:
    """What a training in one world met of a task of another, of more propositions: by language, and up to renaming.

    What a row does not read is to it as if nothing were true, so that its language is compared in the world of the
    training; a row that reads more propositions than that one has was not met.

    Args:
        formula: the task.
        there: the propositions of its world.
        here: the world of the training.
        known: what training met.
        at_least: whether `known` is only a part of that.
    """
    table = compile_tasks([formula], there, here.alphabet)
    rows = np.flatnonzero(np.asarray(table.verdict) == 0).tolist()
    met, names = [0, 0], here.propositions
    for row in rows:
        (left,) = resolve_tasks([table.text(row)]).values()
        read = left.propositions()
        if set(read) <= set(names):
            met[0] += row_languages([left], names, here.alphabet, renamed=False)[0] in known[0]
        if len(read) <= len(names):
            others = [name for name in names if name not in read]
            in_place = (*read, *others)[: len(names)]
            met[1] += row_languages([left], in_place, here.alphabet)[0] in known[1]
    return Share(met[0], len(rows), at_least), Share(met[1], len(rows), at_least)


def new_rows(table: TaskTable, known: Mapping[Language, Language]) -> dict[Language, Language]:
    """The open rows of a table that are not known: their languages, and what these are up to renaming."""
    automaton = table.automaton()
    rows = np.flatnonzero(automaton.verdict == 0).tolist()
    found = languages.of_rows(automaton.every_letter(), automaton.verdict, rows)
    new = {language: row for language, row in zip(found, rows, strict=True) if language not in known}
    return dict(zip(new, renaming.of_rows(automaton.steps, automaton.verdict, new.values()), strict=True))
