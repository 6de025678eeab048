"""Formulas as token ids, in prefix order, with ids fixed by the vocabulary and never by order of first use."""

from collections.abc import Sequence

from t2tl_jax.ltl.errors import LTLError
from t2tl_jax.ltl.formula import ARITY, Formula, prop

PADDING = 0
OPERATOR_ID = {
    "next": 1, "until": 2, "and": 3, "or": 4, "eventually": 5, "always": 6, "not": 7, "True": 8, "False": 9,
}  # fmt: skip
"""Ids of the operators and literals. `always` is reserved: no co-safe normal form holds it."""

FIRST_PROPOSITION = 10
"""Id of the environment's first proposition; the others follow in the environment's order."""

_OPERATOR = {number: name for name, number in OPERATOR_ID.items()}
_BINARY = frozenset({"until", "and", "or"})
_UNARY = frozenset({"next", "eventually", "not"})

NUM_OPERANDS = (0, *(ARITY[_OPERATOR[number]] for number in range(1, FIRST_PROPOSITION)))
"""Operands of each id below the propositions; padding and propositions have none."""


def vocabulary_size(num_propositions: int) -> int:
    """Return the number of rows of an embedding table, padding included; at least the 22 of the original."""
    return max(22, FIRST_PROPOSITION + num_propositions)


def token_names(tokens: Sequence[int], propositions: Sequence[str]) -> tuple[str, ...]:
    """Return what token ids say, operators by name: `until`, `not`, `Red`, ..., and `padding`."""
    names = ("padding", *(_OPERATOR[number] for number in range(1, FIRST_PROPOSITION)), *propositions)
    return tuple(names[token] for token in tokens)


def decode(tokens: Sequence[int], propositions: Sequence[str]) -> Formula:
    """Return the formula of a row of token ids; padding at the end is skipped.

    Raises:
        LTLError: when the ids are not one formula in prefix order.
    """
    stack: list[Formula] = []
    # From the right, the operands of each operator are on the stack when it is met.
    for token in reversed([int(t) for t in tokens if t != PADDING]):
        name = _OPERATOR.get(token)
        count = 2 if name in _BINARY else 1 if name in _UNARY else 0
        if len(stack) < count or (name is None and token >= FIRST_PROPOSITION + len(propositions)):
            raise LTLError(f"the token ids {list(tokens)} are no formula in prefix order")
        args = tuple(stack.pop() for _ in range(count))
        stack.append(prop(propositions[token - FIRST_PROPOSITION]) if name is None else Formula(name, args))
    if len(stack) != 1:
        raise LTLError(f"the token ids {list(tokens)} are no single formula in prefix order")
    return stack[0]
