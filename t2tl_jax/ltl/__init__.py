"""Co-safe linear temporal logic: from text to formula, progression, and the task table.

Everything up to the table is plain Python; JAX is imported only when `TaskTable` or `compile_tasks` is first used.
"""

from typing import TYPE_CHECKING, Any

from t2tl_jax.ltl.automaton import Automaton
from t2tl_jax.ltl.diagrams import ALPHABETS, AT_MOST_ONE, EVERY_SUBSET
from t2tl_jax.ltl.errors import (
    LTLError,
    LTLSyntaxError,
    NotCoSafeError,
    TooLargeError,
    UnknownPropositionError,
    UnknownTaskError,
)
from t2tl_jax.ltl.formula import FALSE, TRUE, Formula, eventually, from_tuple, next_, prop, until
from t2tl_jax.ltl.normal_form import negation_normal_form
from t2tl_jax.ltl.parser import parse
from t2tl_jax.ltl.progression import progress
from t2tl_jax.ltl.samplers import make_sampler, sample
from t2tl_jax.ltl.tasks import PAPER_TASKS, WATER_PROPOSITIONS, ZONE_PROPOSITIONS, named_task, resolve_task
from t2tl_jax.ltl.tokens import vocabulary_size

if TYPE_CHECKING:
    from t2tl_jax.ltl.task_table import TaskTable, compile_tasks

__all__ = [
    "ALPHABETS",
    "AT_MOST_ONE",
    "EVERY_SUBSET",
    "FALSE",
    "PAPER_TASKS",
    "TRUE",
    "WATER_PROPOSITIONS",
    "ZONE_PROPOSITIONS",
    "Automaton",
    "Formula",
    "LTLError",
    "LTLSyntaxError",
    "NotCoSafeError",
    "TaskTable",
    "TooLargeError",
    "UnknownPropositionError",
    "UnknownTaskError",
    "compile_tasks",
    "eventually",
    "from_tuple",
    "make_sampler",
    "named_task",
    "negation_normal_form",
    "next_",
    "parse",
    "progress",
    "prop",
    "resolve_task",
    "sample",
    "until",
    "vocabulary_size",
]


def __getattr__(name: str) -> Any:
    """Import what needs JAX on first use, so that the command line starts fast."""
    if name in ("TaskTable", "compile_tasks"):
        from t2tl_jax.ltl import task_table

        return getattr(task_table, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
