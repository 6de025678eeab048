"""The shortest text of a state: its disjunctive normal form, factored back into a nested formula."""

from functools import reduce
from operator import and_, or_

from t2tl_jax.ltl.compiler.core import AND, EVENTUALLY, LITERAL, NEXT, OR, UNTIL, Core
from t2tl_jax.ltl.compiler.states import Progression, State
from t2tl_jax.ltl.tokens import FIRST_PROPOSITION, OPERATOR_ID

Tokens = tuple[int, ...]

_MAX_FACTORING = 40
"""Levels of factoring; deeper, a formula is shown as a plain disjunction, which costs tokens but no stack."""

_PREFIX = {NEXT: OPERATOR_ID["next"], EVENTUALLY: OPERATOR_ID["eventually"], UNTIL: OPERATOR_ID["until"]}


class Display:
    """Texts of the formulas of one compilation, as token ids.

    Args:
        core: the formulas.
        token_of: per proposition index of `core`, the index of that proposition in the environment.
    """

    def __init__(self, core: Core, token_of: list[int]) -> None:
        self.core = core
        self._proposition = [FIRST_PROPOSITION + index for index in token_of]
        self._tokens: dict[int, Tokens] = {0: (OPERATOR_ID["False"],), 1: (OPERATOR_ID["True"],)}

    def tokens(self, number: int) -> Tokens:
        """Return a formula's token ids in prefix order."""
        tokens = self._tokens.get(number)
        if tokens is None:
            kind, args = self.core.kind[number], self.core.args[number]
            if kind == LITERAL:
                name = self._proposition[args[0]]
                tokens = (name,) if args[1] else (OPERATOR_ID["not"], name)
            elif kind in (AND, OR):
                tokens = _nested(OPERATOR_ID["and" if kind == AND else "or"], [self.tokens(arg) for arg in args])
            else:
                tokens = sum([self.tokens(arg) for arg in args], (_PREFIX[kind],))
            self._tokens[number] = tokens
        return tokens

    def rank(self, number: int) -> tuple[int, Tokens]:
        """Return the sort key that puts short formulas first; ties go by token ids, so the order is total."""
        tokens = self.tokens(number)
        return len(tokens), tokens

    def shortest(self, progression: Progression, state: State) -> int:
        """Return a short formula equal to the state."""
        if not state:
            return 0
        return self._factor(progression, sorted(progression.irredundant(term) for term in state))

    def _factor(self, progression: Progression, terms: list[int], depth: int = 0) -> int:
        """Return a formula equal to the disjunction of `terms`, none of which contains another."""
        parts: list[int] = []
        while terms:
            if len(terms) == 1 or depth > _MAX_FACTORING:
                parts += [self._conjunction(_atoms(progression, term)) for term in terms]
                break
            common = reduce(and_, terms)
            if common:
                rest = self._factor(progression, [term ^ common for term in terms], depth + 1)
                parts.append(self._conjunction([*_atoms(progression, common), rest]))
                break
            components = _components(terms)
            if len(components) > 1:
                parts += [self._factor(progression, component, depth + 1) for component in components]
                break
            divisor, quotient = _divide(terms)
            factors = [self._factor(progression, factor, depth + 1) for factor in (divisor, quotient)]
            parts.append(self._conjunction(factors))
            product = {d | q for d in divisor for q in quotient}
            terms = [term for term in terms if term not in product]
        return self._disjunction(parts)

    def _conjunction(self, numbers: list[int]) -> int:
        if len(numbers) == 1:
            return numbers[0]
        return self._sorted(self.core.conjunction(sorted(self.core.flatten(AND, numbers), key=self.rank)))

    def _disjunction(self, numbers: list[int]) -> int:
        if len(numbers) == 1:
            return numbers[0]
        return self._sorted(self.core.disjunction(sorted(self.core.flatten(OR, numbers), key=self.rank)))

    def _sorted(self, number: int) -> int:
        """Put operands in order of rank again, where rewriting has moved them."""
        kind = self.core.kind[number]
        if kind not in (AND, OR):
            return number
        return self.core.make(kind, tuple(sorted(self.core.args[number], key=self.rank)))


def _atoms(progression: Progression, term: int) -> list[int]:
    return [number for index, number in enumerate(progression.atoms) if term >> index & 1]


def _components(terms: list[int]) -> list[list[int]]:
    """Split terms into groups that share no atom."""
    groups: list[tuple[int, list[int]]] = []
    for term in terms:
        touching = [group for group in groups if group[0] & term]
        groups = [group for group in groups if not group[0] & term]
        bits = reduce(or_, [group[0] for group in touching], term)
        groups.append((bits, [member for group in touching for member in group[1]] + [term]))
    return [sorted(members) for _, members in groups]


def _divide(terms: list[int]) -> tuple[list[int], list[int]]:
    """Return two lists of terms, each without a common atom, whose product is among `terms`.

    The quotient is the cofactor of the most frequent atom, the divisor all that the terms hold times that quotient.
    """
    counts: dict[int, int] = {}
    for term in terms:
        while term:
            low = term & -term
            counts[low] = counts.get(low, 0) + 1
            term ^= low
    frequent = max(counts, key=lambda bit: (counts[bit], -bit))
    quotient = [term for term in terms if term & frequent]
    common = reduce(and_, quotient)
    quotient = [term ^ common for term in quotient]
    divisor = reduce(and_, [{term ^ q for term in terms if term & q == q} for q in quotient])
    return sorted(divisor), quotient


def _nested(operator: int, parts: list[Tokens]) -> Tokens:
    """Join operands by a binary operator: nested to the left, or balanced when there are too many for that."""
    if len(parts) > 64:
        half = len(parts) // 2
        return (operator, *_nested(operator, parts[:half]), *_nested(operator, parts[half:]))
    return sum(parts, (operator,) * (len(parts) - 1))
