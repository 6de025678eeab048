"""Negation normal form over the co-safe operators.

Pushing negations to the propositions turns each operator into itself or its dual. A formula is syntactically co-safe
when only literals, `&`, `|`, `X`, `F` and `U` remain (`M` is written with `U`).
"""

from collections.abc import Callable

from t2tl_jax.ltl.co_safety import find_offence
from t2tl_jax.ltl.errors import NotCoSafeError
from t2tl_jax.ltl.formula import FALSE, TRUE, Formula, eventually, next_, until


def negation_normal_form(formula: Formula) -> Formula:
    """Return the formula over `True False prop not and or next eventually until`, with `not` only before propositions.

    Raises:
        NotCoSafeError: names the offending subformula and its polarity.
        TooLargeError: `<->` and `M` copy operands; the copies count towards `MAX_SIZE`.
    """
    offence = find_offence(formula)
    if offence is not None:
        raise NotCoSafeError(offence.message)
    memo: dict[tuple[int, bool], Formula] = {}

    def convert(node: Formula, positive: bool) -> Formula:
        key = (id(node), positive)
        result = memo.get(key)
        if result is None:
            result = memo[key] = _push_negation(node, positive, convert)
        return result

    return convert(formula, True)


def _push_negation(node: Formula, positive: bool, convert: Callable[[Formula, bool], Formula]) -> Formula:
    """Convert one node, or its negation when not `positive`; `convert` does the same for an operand."""
    op, args = node.op, node.args
    if op == "prop":
        return node if positive else ~node
    if op in ("True", "False"):
        return TRUE if (op == "True") == positive else FALSE
    if op == "not":
        return convert(args[0], not positive)
    if op == "next":
        return next_(convert(args[0], positive))
    if op in ("eventually", "always"):
        return eventually(convert(args[0], positive))
    if op in ("and", "or"):
        left, right = convert(args[0], positive), convert(args[1], positive)
        return left & right if (op == "and") == positive else left | right
    if op == "implies":
        left, right = convert(args[0], not positive), convert(args[1], positive)
        return left | right if positive else left & right
    if op == "iff":
        left, right, no_left, no_right = (convert(arg, sign) for sign in (True, False) for arg in args)
        return (left & right) | (no_left & no_right) if positive else (left & no_right) | (no_left & right)
    left, right = convert(args[0], positive), convert(args[1], positive)
    if op in ("until", "release"):  # !(a R b) = !a U !b
        return until(left, right)
    # a M b = b U (a & b), and !(a W b) = !a M !b with the operands' roles kept: !b U (!a & !b)
    return until(right, left & right)
