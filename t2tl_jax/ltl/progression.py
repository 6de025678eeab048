"""Progression of a single formula: what remains to be done after one step."""

from collections.abc import Collection

from t2tl_jax.ltl.compiler.alphabet import EVERY_SUBSET
from t2tl_jax.ltl.compiler.budget import Budget
from t2tl_jax.ltl.compiler.core import Core
from t2tl_jax.ltl.compiler.diagrams import LEAF, Diagrams
from t2tl_jax.ltl.compiler.display import Display
from t2tl_jax.ltl.compiler.normal_form import negation_normal_form
from t2tl_jax.ltl.compiler.states import EXACT, PAPER, PROGRESSIONS, Leaves, Progression
from t2tl_jax.ltl.errors import LTLError, nearest
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.tokens import decode


def progress(formula: Formula, label: Collection[str], progression: str = EXACT) -> Formula:
    """Return the formula that the rest of the word has to satisfy, in canonical form.

    A word `w` satisfies `f` exactly when `w` without its first letter satisfies `progress(f, w[0])`. The rules are the
    usual ones: `prog(X f) = f`, `prog(F f) = prog(f) | F f`, `prog(f U g) = prog(g) | (prog(f) & (f U g))`. The result
    is in negation normal form, free of what syntactic implication shows to be redundant, with operands in a fixed
    order; repeated progression therefore reaches finitely many formulas. `compile_tasks` also merges what only
    reasoning about time shows to be equal.

    Args:
        formula: any syntactically co-safe formula.
        label: the propositions that are true in this step; others are ignored.
        progression: "exact", or "paper" for the last case of the paper's definition 2, which drops a satisfied
            proposition and with it the first sentence above; see `compile_tasks`.

    Raises:
        LTLError: for an unknown progression, a formula that is not co-safe, or what is no formula or no label.
    """
    if not isinstance(formula, Formula):
        raise LTLError(f"progress takes a formula, such as parse('F a'), got {formula!r}")
    if isinstance(label, str):  # a collection of letters
        raise LTLError(f"a label is a set of propositions, such as {{{label!r}}}, got the text {label!r}")
    if not isinstance(label, Collection):
        raise LTLError(f"a label is a set of propositions, such as {{'a'}}, got {label!r:.100}")
    if progression not in PROGRESSIONS:
        raise LTLError(
            f"unknown progression {progression!r}; known: {', '.join(PROGRESSIONS)}"
            f"{nearest(str(progression), PROGRESSIONS)}"
        )
    normal = negation_normal_form(formula)
    propositions = sorted(normal.propositions())
    core = Core(propositions)
    budget = Budget()
    diagrams = Diagrams(EVERY_SUBSET, budget)
    leaves = Leaves(diagrams)
    rules = Progression(core, core.add(normal), leaves, budget, progression == PAPER)
    node = rules.successors(rules.root)
    while diagrams.variable[node] != LEAF:
        is_true = propositions[diagrams.variable[node]] in label
        node = diagrams.high[node] if is_true else diagrams.low[node]
    display = Display(core, list(range(len(propositions))))
    return decode(display.tokens(display.shortest(rules, leaves.state_of[node])), propositions)
