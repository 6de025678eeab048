"""Tasks as co-safe linear temporal logic or as reward machines: from text to the task table.

`parser` and `reward_machine` read text (the first into a `formula`), `compiler` makes an automaton of that, and `table`
writes it as arrays, in which `lookup` finds letters and `ahead` the best of them. `tasks` and `families` name tasks,
`family_trees`, `grammar` and `curriculum` hold random ones as data, `pool` makes tables of them, `turns` puts two of
these into one, `padding` gives tables equal shapes, `split` says what a test shares with a training, and `describe`
puts automata into words.

Everything up to the table is plain Python; JAX is imported only when `TaskTable` or a function that compiles one is
first used.
"""

from typing import TYPE_CHECKING, Any

from t2tl_jax.ltl.compiler.alphabet import ALPHABETS, AT_MOST_ONE, EVERY_SUBSET
from t2tl_jax.ltl.compiler.automaton import Automaton
from t2tl_jax.ltl.compiler.budget import Limits
from t2tl_jax.ltl.compiler.normal_form import negation_normal_form
from t2tl_jax.ltl.curriculum import DEEPLTL_ZONES, Curriculum, Stage
from t2tl_jax.ltl.errors import (
    LTLError,
    LTLSyntaxError,
    MachineSyntaxError,
    NotCoSafeError,
    TooLargeError,
    UnknownPropositionError,
    UnknownTaskError,
)
from t2tl_jax.ltl.families import (
    TaskFamily,
    is_family,
    make_sampler,
    name_family,
    named_families,
    register_family,
    sample,
)
from t2tl_jax.ltl.family_trees import Chains, Conjunction, Disjunction, Listed, Mixture, Named
from t2tl_jax.ltl.formula import FALSE, TRUE, Formula, eventually, from_tuple, next_, prop, until
from t2tl_jax.ltl.grammar import Grammar
from t2tl_jax.ltl.parser import parse
from t2tl_jax.ltl.progression import progress
from t2tl_jax.ltl.reward_machine import RewardMachine, Transition, parse_machine
from t2tl_jax.ltl.split import Share, languages_of_each, row_languages, share, tasks_of, together
from t2tl_jax.ltl.tasks import (
    NAMED_TASKS,
    PAPER_TASKS,
    REWARD_MACHINES,
    WATER_PROPOSITIONS,
    ZONE_PROPOSITIONS,
    named_machines,
    named_task,
    read_machine,
    resolve,
    resolve_task,
    resolve_tasks,
)
from t2tl_jax.ltl.tokens import vocabulary_size

if TYPE_CHECKING:
    from t2tl_jax.ltl.pool import compile_pool
    from t2tl_jax.ltl.table import TaskTable, compile_named, compile_reward_machines, compile_tasks

__all__ = [
    "ALPHABETS",
    "AT_MOST_ONE",
    "DEEPLTL_ZONES",
    "EVERY_SUBSET",
    "FALSE",
    "NAMED_TASKS",
    "PAPER_TASKS",
    "REWARD_MACHINES",
    "TRUE",
    "WATER_PROPOSITIONS",
    "ZONE_PROPOSITIONS",
    "Automaton",
    "Chains",
    "Conjunction",
    "Curriculum",
    "Disjunction",
    "Formula",
    "Grammar",
    "LTLError",
    "LTLSyntaxError",
    "Limits",
    "Listed",
    "MachineSyntaxError",
    "Mixture",
    "Named",
    "NotCoSafeError",
    "RewardMachine",
    "Share",
    "Stage",
    "TaskFamily",
    "TaskTable",
    "TooLargeError",
    "Transition",
    "UnknownPropositionError",
    "UnknownTaskError",
    "compile_named",
    "compile_pool",
    "compile_reward_machines",
    "compile_tasks",
    "eventually",
    "from_tuple",
    "is_family",
    "languages_of_each",
    "make_sampler",
    "name_family",
    "named_families",
    "named_machines",
    "named_task",
    "negation_normal_form",
    "next_",
    "parse",
    "parse_machine",
    "progress",
    "prop",
    "read_machine",
    "register_family",
    "resolve",
    "resolve_task",
    "resolve_tasks",
    "row_languages",
    "sample",
    "share",
    "tasks_of",
    "together",
    "until",
    "vocabulary_size",
]


def __getattr__(name: str) -> Any:
    """Import what needs JAX on first use, so that the command line starts fast."""
    if name == "compile_pool":
        from t2tl_jax.ltl import pool

        return pool.compile_pool
    if name in ("TaskTable", "compile_named", "compile_reward_machines", "compile_tasks"):
        from t2tl_jax.ltl import table

        return getattr(table, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
