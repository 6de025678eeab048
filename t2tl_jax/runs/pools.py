"""The tasks of a configuration as tables: one for a fixed task, one after another for a family of random ones."""

from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from itertools import islice
from typing import Any, Protocol, TypeAlias

import numpy as np

from t2tl_jax.ltl import (
    AT_MOST_ONE,
    Curriculum,
    Formula,
    TaskFamily,
    TaskTable,
    TooLargeError,
    compile_named,
    compile_pool,
    is_family,
    renaming,
    resolve,
    resolve_tasks,
    row_languages,
)
from t2tl_jax.ltl.compiler.automaton import build
from t2tl_jax.ltl.errors import UnknownPropositionError
from t2tl_jax.ltl.family_trees import MAX_LISTED
from t2tl_jax.ltl.languages import Language, of_rows
from t2tl_jax.ltl.padding import padded
from t2tl_jax.ltl.pool import compile_weighted
from t2tl_jax.ltl.turns import in_turns
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.lessons import Lesson

LessonOf: TypeAlias = Callable[[int], Lesson]
"""What each pool is drawn from, by its number."""


class Letters(Protocol):
    """What tables are to know of an environment."""

    @property
    def propositions(self) -> tuple[str, ...]:
        """Names of the propositions, in their order."""
        ...

    @property
    def alphabet(self) -> str:
        """Which of them can be true together."""
        ...


DRAWS_PER_POOL = 10
"""How often a pool is drawn until its formulas fit into the table; after that, the first pool comes again."""


class Pools:
    """The pools of a family. Which formulas they hold depends on the configuration alone, so a resumed run meets the
    same ones.

    No formula of the evaluation is trained on, neither as a task nor as what is left of one: it is no row of the first
    pool of training, and formulas that can become it are kept out of all later pools. Formulas are the same if their
    languages are, however they are written. Tasks that are held out by name share no row at all with training.
    """

    def __init__(self, config: Config, env: Letters) -> None:
        self._config, self._env = config, env
        self._draw = lru_cache(maxsize=4)(self._drawn)  # the one before, the present one and the next one
        self._held_out = cache(lambda: kept_out(config, env))
        self._first = cache(lambda: self._of_lesson(Lesson(), "0", held_out=self._held_out()))
        self._evaluation = cache(self._make_evaluation)

    def training(self, number: int, lesson: LessonOf = lambda number: Lesson()) -> TaskTable:
        """What is trained on, by number: a pool, or with `pool.finish` a pool beside the one before.

        `lesson` says of a curriculum what a pool is drawn from; it is asked of this one and of the one before.

        Asking for pool 0 raises ``TooLargeError`` where the caps are too small. Later pools always come: a run that
        could begin does not end because of an unlucky draw.
        """
        pool, _ = self._draw(number, lesson(number))
        if not self._config.pool.finish:
            return pool
        before = self._draw(number - 1, lesson(number - 1))[0] if number else None
        return in_turns(pool, before, number, self._config.pool.nodes, self._config.limits)

    def names(self, number: int, lesson: LessonOf) -> list[list[str]]:
        """What the tasks of a pool are called, and those of the pool before, if there is one."""
        return [list(self._draw(which, lesson(which))[1]) for which in (number, number - 1) if which >= 0]

    def _drawn(self, number: int, lesson: Lesson) -> tuple[TaskTable, tuple[str, ...]]:
        """A pool and what its tasks are called."""
        if number == 0:
            return self._first()
        table = self.evaluation
        held_out = _languages(table, np.asarray(table.initial_row))
        for which in (str(number), *(f"{number} again {draw}" for draw in range(1, DRAWS_PER_POOL))):
            try:
                return self._of_lesson(lesson, which, without=held_out, held_out=self._held_out())
            except TooLargeError:
                continue
        return self._first()

    def _of_lesson(self, lesson: Lesson, which: str, **kept_out: Any) -> tuple[TaskTable, tuple[str, ...]]:
        config, env, task = self._config, self._env, self._config.task
        if not isinstance(task, Curriculum):
            return _pool(config, env, which, **kept_out), ()
        stage = task.stages[lesson.stage]
        if not stage.temperature:
            return self._named(_pool(config, env, which, stage.family, least=1, fill=True, **kept_out))
        tasks = _listed(stage.family, env.propositions)
        names = [str(formula) for formula in tasks]
        weights = stage.weights(names, dict(lesson.success))
        table, drawn = compile_weighted(
            tasks, weights, env.propositions, env.alphabet, f"{config.pool.seed} {which}", **_caps(config), **kept_out
        )
        return table, tuple(names[number] for number in drawn)

    def _named(self, table: TaskTable) -> tuple[TaskTable, tuple[str, ...]]:
        if not isinstance(self._config.task, Curriculum):
            return table, ()
        return table, tuple(table.text(row) for row in np.asarray(table.initial_row).tolist())

    @property
    def evaluation(self) -> TaskTable:
        """What results are reported on: formulas that training never has. A small family has fewer of them than a pool
        has places.

        Raises:
            TooLargeError: where the caps are too small, or the first pool of training holds the whole family.
        """
        return self._evaluation()

    def selection(self) -> TaskTable:
        """What parameters are chosen by: formulas that the evaluation does not have; training may. Nor has it rows of
        the tasks that are held out."""
        table = self.evaluation
        reported = _languages(table, np.asarray(table.initial_row))
        return _pool(self._config, self._env, "selection", least=1, unlike=reported, held_out=self._held_out())

    def _make_evaluation(self) -> TaskTable:
        first, _ = self._first()
        trained_on = _languages(first, np.flatnonzero(np.asarray(first.verdict) == 0))
        return _pool(self._config, self._env, "evaluation", least=1, unlike=trained_on)


def kept_out(config: Config, env: Letters) -> frozenset[Language]:
    """The rows that training is not to meet, up to renaming of propositions: all of some tasks, the first of others.

    Raises:
        LTLError: for a task that is none, or speaks of other propositions than those of the environment.
    """
    try:
        return _kept_out(config, env)
    except UnknownPropositionError as error:
        raise UnknownPropositionError(
            f"{error}\nTasks that are to be kept out of training speak of them, those of pool.unseen or pool.held_out: "
            "give others, or '' for none"
        ) from error


def _kept_out(config: Config, env: Letters) -> frozenset[Language]:
    names, alphabet, rows = env.propositions, env.alphabet, frozenset[Language]()
    if config.pool.held_out:
        rows |= frozenset(row_languages(resolve_tasks(config.pool.held_out).values(), names, alphabet))
    if config.pool.unseen:
        tasks = list(resolve_tasks(config.pool.unseen).values())
        automaton = build(tasks, names, alphabet, limits=config.limits)
        rows |= frozenset(renaming.of_rows(automaton.steps, automaton.verdict, automaton.initial_row.tolist()))
    return rows


def make_table(config: Config, env: Letters) -> TaskTable:
    """Compile the task of a configuration for an environment; of a family, a pool to evaluate on.

    Raises:
        ValueError: for an unknown task, a formula with mistakes, one of other propositions, one that is decided before
            the first step, or one that the room of the table is too small for.
    """
    if is_family(config.task, env.propositions):
        return Pools(config, env).evaluation
    task, length = str(config.task), config.task_length or None
    if isinstance(formula := resolve(task), Formula) and (config.run.table_rows or config.run.table_length):
        table = _with_room(config, formula, env)
    else:
        table = compile_named(
            task, env.propositions, env.alphabet, length=length, limits=config.limits, progression=config.progression
        )
    check_open(task, table)
    return table


def _with_room(config: Config, formula: Formula, env: Letters) -> TaskTable:
    """A table that has room for larger formulas."""
    run, reader = config.run, config.learner.task_encoder
    if run.table_length and reader is not None and reader.reads_padding:
        raise ValueError("run.table_length pads the formulas, which this task encoder reads; leave it at 0")
    automaton = build([formula], env.propositions, env.alphabet, limits=config.limits, progression=config.progression)
    longest = max(len(tokens) for tokens in automaton.tokens)
    rows = run.table_rows or len(automaton.tokens)
    try:
        return padded(automaton, rows, max(run.table_length, config.task_length) or longest, limits=config.limits)
    except TooLargeError as error:
        raise TooLargeError(f"{config.task}: {error}; set run.table_rows and run.table_length to more, or 0") from None


def make_pools(config: Config, env: Letters) -> Pools | None:
    """The pools of a family; None for any other task.

    Raises:
        ValueError: for pools that are to let episodes finish and change too soon for that, and for a curriculum whose
            episodes do not finish, or whose tasks cannot be drawn by their success; for more formulas than rows;
            and for a learner that cannot learn families, or none with so many rows.
    """
    if not is_family(config.task, env.propositions):
        return None
    pool, steps = config.pool, config.learner.unroll_length
    if isinstance(config.task, Curriculum):
        if not pool.finish:
            raise ValueError(
                "a curriculum counts success by task, which episodes that are cut would distort; set pool.finish=True"
            )
        for stage in config.task.stages:
            if stage.temperature:
                _listed(stage.family, env.propositions)
    elif pool.size > (most := pool.rows - 2):  # in a curriculum tasks may come again
        raise ValueError(
            f"a table of pool.rows={pool.rows:,} rows holds {most:,} formulas at most, since each is a row beside true "
            f"and false, got pool.size={pool.size:,}; ask for fewer of them, or for more rows"
        )
    if pool.finish and pool.period * steps < config.episode_length:
        raise ValueError(
            f"episodes of up to {config.episode_length} steps cannot finish while one pool lasts for pool.period x "
            f"learner.unroll_length = {pool.period} x {steps} steps; set pool.period to "
            f"{-(-config.episode_length // steps)} or more, or pool.finish=False"
        )
    if why := config.learner.refuses_family(2 * pool.rows - 2 if pool.finish else pool.rows):
        raise ValueError(why)
    return Pools(config, env)


def _languages(table: TaskTable, rows: np.ndarray) -> frozenset[Language]:
    automaton = table.automaton()
    return frozenset(of_rows(automaton.every_letter(), automaton.verdict, rows.tolist()))


def check_open(task: str, table: TaskTable) -> None:
    """Refuse what every episode would end with at its first step, whatever the agent does.

    Raises:
        ValueError: for a task that is decided before the first step.
    """
    verdicts = np.asarray(table.verdict)[np.asarray(table.initial_row)]
    if (verdicts > 0).any():
        raise ValueError(f"{task} is true from the start, so there is nothing to do; give another task")
    if (verdicts < 0).any():
        reason = ""
        if table.alphabet == AT_MOST_ONE:
            reason = f": at most one of {', '.join(table.propositions)} holds at a time in this environment"
        raise ValueError(
            f"{task} can never be satisfied{reason}; give a task that can, such as one goal after another, F(a & F b)"
        )


def _caps(config: Config) -> dict[str, Any]:
    pool = config.pool
    caps = {"size": pool.size, "rows": pool.rows, "length": pool.length, "nodes": pool.nodes}
    return caps | {"progression": config.progression, "limits": config.limits}


def _listed(family: TaskFamily, propositions: Sequence[str]) -> list[Formula]:
    """Every task of a stage whose tasks are drawn by their success.

    Raises:
        ValueError: where they cannot be listed, or are too many.
    """
    every = family.every(propositions)
    tasks = [] if every is None else list(islice(dict.fromkeys(every), MAX_LISTED + 1))
    if not 0 < len(tasks) <= MAX_LISTED:
        raise ValueError(
            f"tasks are drawn by success where they can be listed, {MAX_LISTED:,} at most, and {family} cannot be; set "
            "the temperature of its stage to 0"
        )
    return tasks


def _pool(
    config: Config, env: Letters, which: str, family: str | TaskFamily | None = None, **options: Any
) -> TaskTable:
    """One pool of the family of a configuration, or of another one."""
    reader = config.learner.task_encoder
    if reader is not None and not reader.carries_over:
        raise ValueError(
            f"{config.task} is a family of random tasks, and a one-hot code says nothing about a task that was not "
            "seen before; use a task encoder that reads formulas, such as transformer"
        )
    if config.task_length:
        raise ValueError(f"rows of a pool have pool.length={config.pool.length} tokens; leave task_length at 0")
    family = config.task if family is None else family
    try:
        return compile_pool(
            family.strip() if isinstance(family, str) else family,
            env.propositions,
            env.alphabet,
            f"{config.pool.seed} {which}",
            **_caps(config),
            **options,
        )
    except TooLargeError as error:
        raise TooLargeError(f"{error}; the fields: pool.length, pool.rows, pool.size, pool.nodes") from error
