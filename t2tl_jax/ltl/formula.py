"""Formulas of linear temporal logic as immutable trees, their text and their nested tuples."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from t2tl_jax.ltl.errors import LTLError, TooLargeError

MAX_DEPTH = 200
"""Deepest nesting of a formula: every recursive function of this package stays inside Python's recursion limit."""

MAX_SIZE = 10_000
"""Most nodes of one formula, counted as a tree."""

ARITY = {
    "prop": 0, "True": 0, "False": 0,
    "not": 1, "next": 1, "eventually": 1, "always": 1,
    "and": 2, "or": 2, "implies": 2, "iff": 2,
    "until": 2, "release": 2, "weak_until": 2, "strong_release": 2,
}  # fmt: skip
"""Operands of each operator. The names are those of LTL2Action where it has the operator."""

SYMBOL = {
    "True": "true", "False": "false",
    "not": "!", "next": "X ", "eventually": "F ", "always": "G ",
    "and": "&", "or": "|", "implies": "->", "iff": "<->",
    "until": "U", "release": "R", "weak_until": "W", "strong_release": "M",
}  # fmt: skip

BINDING = {"iff": 1, "implies": 2, "or": 3, "and": 4, "until": 5, "release": 5, "weak_until": 5, "strong_release": 5}
"""How tightly a binary operator binds; unary operators bind tighter than all of them."""

RIGHT_ASSOCIATIVE = frozenset({"implies", "until", "release", "weak_until", "strong_release"})

RESERVED = frozenset({
    "X", "F", "G", "U", "R", "W", "M", "true", "false", "True", "False",
    "not", "and", "or", "implies", "iff", "next", "eventually", "always", "until", "release",
})  # fmt: skip
"""Words that the parser reads as operators or literals; a proposition so named has to be quoted."""

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Formula:
    """One formula: an operator over operand formulas, a literal, or a proposition.

    Equal when the trees are equal (no rewriting). `str` gives text that parses back to an equal formula.
    `&`, `|` and `~` build conjunctions, disjunctions and negations.

    Attributes:
        op: a key of `ARITY`.
        args: the operands.
        name: the proposition's name, empty for every other operator.
        size: nodes of the tree.
        depth: nesting; 0 for a proposition or a literal.
    """

    op: str
    args: tuple[Formula, ...] = ()
    name: str = ""
    size: int = field(init=False)
    depth: int = field(init=False)
    _hash: int = field(init=False)

    def __post_init__(self) -> None:
        if self.op not in ARITY:
            raise LTLError(f"unknown operator {self.op!r}; known: {', '.join(ARITY)}")
        if len(self.args) != ARITY[self.op]:
            raise LTLError(f"{self.op!r} takes {ARITY[self.op]} operands, got {len(self.args)}")
        if (self.op == "prop") != bool(self.name):
            raise LTLError("a proposition needs a non-empty name, and only a proposition has one")
        size = depth = 0
        for arg in self.args:
            size += arg.size
            depth = max(depth, arg.depth + 1)
        if depth > MAX_DEPTH:
            raise TooLargeError(
                f"the formula is nested {depth} deep; the limit is {MAX_DEPTH} (formula.MAX_DEPTH, no flag); a list "
                "such as a | b | c | ... is as deep as it is long: put its halves in parentheses"
            )
        if size >= MAX_SIZE:
            raise TooLargeError(
                f"the formula has {size + 1} nodes, with the copies of their operands that <-> and M make; the limit "
                f"is {MAX_SIZE} (formula.MAX_SIZE, no flag)"
            )
        object.__setattr__(self, "size", size + 1)
        object.__setattr__(self, "depth", depth)
        object.__setattr__(self, "_hash", hash((self.op, self.name, self.args)))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, Formula):
            return NotImplemented
        if self._hash != other._hash or self.size != other.size:
            return False
        return self.op == other.op and self.name == other.name and self.args == other.args

    def __and__(self, other: Formula) -> Formula:
        return Formula("and", (self, other))

    def __or__(self, other: Formula) -> Formula:
        return Formula("or", (self, other))

    def __invert__(self) -> Formula:
        return Formula("not", (self,))

    def __str__(self) -> str:
        return _text(self)

    def __repr__(self) -> str:
        return f"parse({_text(self)!r})"

    def propositions(self) -> tuple[str, ...]:
        """Return the names of the propositions, each once, in order of first use."""
        return tuple(dict.fromkeys(node.name for node in self.nodes() if node.op == "prop"))

    def nodes(self) -> Iterator[Formula]:
        """Yield every node of the tree, parents before operands, left before right."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.args))

    def to_tuple(self) -> Any:
        """Return LTL2Action's nested tuples: `("until", ("not", "a"), "b")`; propositions and literals are strings."""
        if self.op == "prop":
            return self.name
        if not self.args:
            return self.op
        return (self.op, *(arg.to_tuple() for arg in self.args))


TRUE = Formula("True")
FALSE = Formula("False")


def prop(name: str) -> Formula:
    """Return the proposition called `name` (any non-empty string)."""
    return Formula("prop", (), name)


def next_(operand: Formula) -> Formula:
    """Return `X operand`: it holds from the next step on."""
    return Formula("next", (operand,))


def eventually(operand: Formula) -> Formula:
    """Return `F operand`: it holds now or at some later step."""
    return Formula("eventually", (operand,))


def until(left: Formula, right: Formula) -> Formula:
    """Return `left U right`: `right` holds now or later, and `left` at every step before."""
    return Formula("until", (left, right))


def from_tuple(value: Any, _depth: int = 0) -> Formula:
    """Read nested tuples (or lists) as LTL2Action writes them.

    Unlike LTL2Action, a proposition may have a name of any length. `"True"` and `"False"` are the literals.

    Raises:
        LTLError: for an unknown operator, a wrong number of operands, or anything that is no string or tuple.
        TooLargeError: beyond `MAX_DEPTH` or `MAX_SIZE`.
    """
    if _depth > MAX_DEPTH:
        raise TooLargeError(f"the tuple is nested more than {MAX_DEPTH} deep (formula.MAX_DEPTH, no flag)")
    if isinstance(value, str):
        return {"True": TRUE, "False": FALSE}.get(value) or prop(value)
    if not isinstance(value, tuple | list) or not value or not isinstance(value[0], str):
        raise LTLError(f'expected a proposition or a tuple like ("until", x, y), got {value!r:.80}')
    if value[0] == "prop":
        raise LTLError(f"a proposition is written as a plain string, got {value!r:.80}")
    return Formula(value[0], tuple(from_tuple(arg, _depth + 1) for arg in value[1:]))


def quote(name: str) -> str:
    """Return a proposition's name as formula text: in double quotes unless it is a plain, unreserved identifier."""
    if _IDENTIFIER.fullmatch(name) and name not in RESERVED:
        return name
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _text(formula: Formula) -> str:
    op, args = formula.op, formula.args
    if op == "prop":
        return quote(formula.name)
    if not args:
        return SYMBOL[op]
    if len(args) == 1:
        inner = _text(args[0])
        if len(args[0].args) < 2:
            return SYMBOL[op] + inner
        return f"{SYMBOL[op].strip()}({inner})"
    left, right = (_operand(op, arg, is_left=index == 0) for index, arg in enumerate(args))
    return f"{left} {SYMBOL[op]} {right}"


def _operand(parent: str, operand: Formula, is_left: bool) -> str:
    """Return an operand's text, in parentheses where the parser would else build another tree."""
    text = _text(operand)
    if len(operand.args) < 2:
        return text
    inner, outer = BINDING[operand.op], BINDING[parent]
    if inner > outer and not (parent == "and" and inner == 5):
        return text
    if inner == outer and operand.op == parent and is_left != (parent in RIGHT_ASSOCIATIVE) and parent != "until":
        return text
    # Parentheses around an until inside `&` or another until are not needed, but easier on the reader.
    return f"({text})"
