"""Negation normal form over the co-safe operators, and the check that a formula has one.

Pushing negations to the propositions turns each operator into itself or its dual. A formula is syntactically co-safe
when only literals, `&`, `|`, `X`, `F` and `U` remain (`M` is written with `U`).
"""

from collections.abc import Callable
from typing import NamedTuple

from t2tl_jax.ltl.errors import NotCoSafeError
from t2tl_jax.ltl.formula import FALSE, SYMBOL, TRUE, Formula, eventually, next_, until

_CO_SAFE = frozenset({"eventually", "until", "strong_release"})
_SAFE = frozenset({"always", "release", "weak_until"})
_DUAL = {"eventually": "G", "until": "R", "strong_release": "W"}


class Offence(NamedTuple):
    """A subformula that keeps a formula from being co-safe, and the sentence that says why."""

    subformula: Formula
    message: str


def find_offence(formula: Formula) -> Offence | None:
    """Return the first subformula (from the left) with the wrong polarity, or None for a co-safe formula."""
    seen: set[tuple[int, bool]] = set()

    def visit(node: Formula, positive: bool) -> Offence | None:
        if (id(node), positive) in seen:
            return None
        seen.add((id(node), positive))
        op = node.op
        if op in (_SAFE if positive else _CO_SAFE):
            return Offence(node, _explain(formula, node, positive))
        if op == "not":
            return visit(node.args[0], not positive)
        if op == "implies":
            return visit(node.args[0], not positive) or visit(node.args[1], positive)
        if op == "iff":
            for arg in node.args:
                offence = visit(arg, True) or visit(arg, False)
                if offence is not None:
                    return offence
            return None
        for arg in node.args:
            offence = visit(arg, positive)
            if offence is not None:
                return offence
        return None

    return visit(formula, True)


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


def _explain(formula: Formula, node: Formula, positive: bool) -> str:
    symbol = SYMBOL[node.op].strip()
    where = "" if node == formula else f" in `{_short(formula)}`"
    if positive:
        why = f"it stands under an even number of negations, where {symbol} needs an infinite word to hold"
    else:
        why = (
            f"it stands under an odd number of negations (or one side of <->), where {symbol} becomes {_DUAL[node.op]}"
        )
    return f"not co-safe: `{_short(node)}`{where}: {why}"


def _short(formula: Formula, width: int = 80) -> str:
    text = str(formula)
    return text if len(text) <= width else text[: width - 3] + "..."
