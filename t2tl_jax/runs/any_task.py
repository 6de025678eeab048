"""Any formulas for a trained run: tables of equal shapes that its network reads, and what training met of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from t2tl_jax.env import LabelledEnv
from t2tl_jax.errors import UserError, explained
from t2tl_jax.ltl import (
    Curriculum,
    Formula,
    LTLError,
    Share,
    TaskTable,
    is_family,
    languages_of_each,
    resolve,
    resolve_tasks,
    share,
    tasks_of,
)
from t2tl_jax.ltl.compiler.automaton import build
from t2tl_jax.ltl.languages import Language
from t2tl_jax.ltl.padding import NODES_PER_ROW, needed_nodes, padded
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.runs.pools import check_open, kept_out

ROWS, TOKENS = 32, 64
"""The least room of a table. Nearly every named task fits; for larger ones both double until they do."""


def check_reads_formulas(experiment: Experiment) -> None:
    """Refuse a network whose codes of tasks mean nothing for a formula that it was not trained on.

    Raises:
        UserError: saying so, and what could read formulas.
    """
    reader = experiment.config.learner.task_encoder
    if reader is not None and not reader.carries_over:
        raise UserError(
            f"the network of this run cannot read a new formula: it was trained on {experiment.config.task} with a "
            f"code of {type(reader).__name__}, which tells its rows apart by their places; train with a task encoder "
            "that reads formulas, such as transformer or gru"
        )


def compile_formulas(experiment: Experiment, formulas: Sequence[Formula]) -> TaskTable:
    """All formulas in one table, padded so that the next formulas will most likely have the same shapes.

    An encoder that reads padding, as published, gets as much of it as in training.

    Raises:
        ValueError: for a formula that does not fit the environment or the network, or is decided from the start.
    """
    env, config = experiment.env, experiment.config
    limits = config.limits
    automaton = build(formulas, env.propositions, env.alphabet, limits=limits, progression=config.progression)
    rows, length = _room(ROWS, len(automaton.tokens)), _room(TOKENS, max(map(len, automaton.tokens)))
    reader = config.learner.task_encoder
    if reader is not None and reader.reads_padding:
        length = experiment.table.tokens.shape[-1]
    nodes = _room(NODES_PER_ROW * rows, needed_nodes(automaton, rows))
    return padded(automaton, rows, length, nodes, limits)


def compile_each(experiment: Experiment, tasks: Sequence[str]) -> dict[str, TaskTable]:
    """Compile a list of tasks to tables that are the same but for the task that starts in them.

    Args:
        experiment: of the run.
        tasks: names or formulas.

    Returns:
        By what each task is called in the list.

    Raises:
        UserError: for a network that cannot read formulas, or a task that does not fit; the message names it.
    """
    check_reads_formulas(experiment)
    with explained():
        found = resolve_tasks(tasks)
        try:
            table = compile_formulas(experiment, list(found.values()))
        except LTLError as error:
            raise UserError(_culprit(experiment, found) or str(error)) from error
        tables = {
            name: replace(table, initial_row=table.initial_row[number : number + 1])
            for number, name in enumerate(found)
        }
        for name, own in tables.items():
            check_open(name, own)
        return tables


@dataclass(frozen=True)
class Met:
    """How many of the open rows of a task training met."""

    exactly: Share
    """The same in meaning."""
    renamed: Share
    """The same under other names of propositions, too."""


def met_in_training(config: Config, env: LabelledEnv, tasks: Sequence[str]) -> dict[str, Met] | None:
    """What training met of some tasks; see `t2tl_jax.ltl.split`. Pre-training is not counted.

    Of a family as many tasks are looked at as `tasks_of` gives; where it has more, the shares may be too low.

    Args:
        config: of the run.
        env: its environment.
        tasks: names or formulas.

    Returns:
        By what each task is called in the list; None for a training on reward machines or with other progression,
        whose rows are not compared.
    """
    names, alphabet = env.propositions, env.alphabet
    trained = _trained_on(config, names)
    if trained is None:
        return None
    exactly, renamed, held_out = set[Language](), set[Language](), kept_out(config, env)
    for rows in languages_of_each(trained, names, alphabet):
        if held_out.isdisjoint(rows.values()):
            exactly |= rows.keys()
            renamed |= set(rows.values())
    shares = {}
    for name, formula in resolve_tasks(tasks).items():
        (rows,) = languages_of_each([formula], names, alphabet)
        shares[name] = Met(share(list(rows), exactly), share(list(rows.values()), renamed))
    return shares


def _trained_on(config: Config, names: Sequence[str]) -> list[Formula] | None:
    """The formulas that a training draws from, and those it leaves out; None where it has none that can be compared."""
    if config.progression != "exact":
        return None
    if not is_family(config.task, names):
        task = resolve(str(config.task))
        return [task] if isinstance(task, Formula) else None
    stages = [stage.family for stage in config.task.stages] if isinstance(config.task, Curriculum) else [config.task]
    return list(dict.fromkeys(task for family in stages for task in tasks_of(family, names)))


def _room(least: int, needed: int) -> int:
    """`least`, doubled until it is enough."""
    return least if needed <= least else _room(2 * least, needed)


def _culprit(experiment: Experiment, formulas: Mapping[str, Formula]) -> str:
    """Which task cannot be compiled, and why; '' if each of them can by itself."""
    for name, formula in formulas.items():
        try:
            compile_formulas(experiment, [formula])
        except LTLError as error:
            return f"{name}: {error}"
    return ""
