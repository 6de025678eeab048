"""The check that a formula is syntactically co-safe, so that finitely many steps show that a word satisfies it.

Of the temporal operators only `X F U M` may stand under an even number of negations, and only `X G R W`, which negation
turns into the former, under an odd number.
"""

from typing import NamedTuple

from t2tl_jax.ltl.formula import SYMBOL, Formula

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
