"""Any formulas for a trained run: tables of equal shapes that its network reads."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from t2tl_jax.errors import UserError, explained
from t2tl_jax.ltl import Formula, LTLError, TaskTable, resolve_tasks
from t2tl_jax.ltl.compiler.automaton import build
from t2tl_jax.ltl.padding import NODES_PER_ROW, needed_nodes, padded
from t2tl_jax.networks.state_encoder import StateEncoderConfig
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.runs.pools import check_open

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


def told_by_role(config: Config) -> int:
    """How many propositions an agent tells apart by nothing but what they are to its task, so that it may meet others
    than in training; 0 for one that reads names, or that has a place in its observation for each."""
    state, reader = getattr(config.learner.network, "state", None), config.learner.task_encoder
    if not isinstance(state, StateEncoderConfig) or not state.by_role or reader is None or reader.reads_tokens:
        return 0
    return reader.propositions_told or 0


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
