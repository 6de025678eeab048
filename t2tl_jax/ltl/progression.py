"""Progression of a single formula: what remains to be done after one step."""

from collections.abc import Collection

from t2tl_jax.ltl.compiler.alphabet import EVERY_SUBSET
from t2tl_jax.ltl.compiler.budget import Budget
from t2tl_jax.ltl.compiler.core import Core
from t2tl_jax.ltl.compiler.diagrams import LEAF, Diagrams
from t2tl_jax.ltl.compiler.display import Display
from t2tl_jax.ltl.compiler.normal_form import negation_normal_form
from t2tl_jax.ltl.compiler.states import Leaves, Progression
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.tokens import decode


def progress(formula: Formula, label: Collection[str]) -> Formula:
    """Return the formula that the rest of the word has to satisfy, in canonical form.

    A word `w` satisfies `f` exactly when `w` without its first letter satisfies `progress(f, w[0])`. The rules are the
    usual ones: `prog(X f) = f`, `prog(F f) = prog(f) | F f`, `prog(f U g) = prog(g) | (prog(f) & (f U g))`. The result
    is in negation normal form, free of what syntactic implication shows to be redundant, with operands in a fixed
    order; repeated progression therefore reaches finitely many formulas. `compile_tasks` also merges what only
    reasoning about time shows to be equal.

    Args:
        formula: any syntactically co-safe formula.
        label: the propositions that are true in this step; others are ignored.
    """
    normal = negation_normal_form(formula)
    propositions = sorted(normal.propositions())
    core = Core(propositions)
    budget = Budget()
    diagrams = Diagrams(EVERY_SUBSET, budget)
    leaves = Leaves(diagrams)
    progression = Progression(core, core.add(normal), leaves, budget)
    node = progression.successors(progression.root)
    while diagrams.variable[node] != LEAF:
        is_true = propositions[diagrams.variable[node]] in label
        node = diagrams.high[node] if is_true else diagrams.low[node]
    display = Display(core, list(range(len(propositions))))
    return decode(display.tokens(display.shortest(progression, leaves.state_of[node])), propositions)
