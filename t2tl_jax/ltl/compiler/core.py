"""Hash-consed co-safe formulas in negation normal form: numbers instead of trees, rewriting on construction.

The compiler works on these numbers: equal formulas have equal numbers, and every question about a pair of formulas is
answered once. `and` and `or` take any number of operands here.
"""

from collections.abc import Iterable, Sequence

from t2tl_jax.ltl.formula import Formula

FALSE, TRUE = 0, 1
CONSTANT, LITERAL, AND, OR, NEXT, EVENTUALLY, UNTIL = range(7)


class Core:
    """All formulas of one compilation.

    Attributes:
        kind: per formula, one of the constants above.
        args: per formula, the operands' numbers; for a literal `(proposition index, 1 or 0)`, 0 when negated.
    """

    def __init__(self, propositions: Sequence[str]) -> None:
        self.index_of = {name: index for index, name in enumerate(propositions)}
        self.kind = [CONSTANT, CONSTANT]
        self.args: list[tuple[int, ...]] = [(), ()]
        self._ids: dict[tuple[int, tuple[int, ...]], int] = {}
        self._implies: dict[tuple[int, int], bool] = {}
        self._joined: dict[tuple[int, tuple[int, ...]], int] = {}

    def make(self, kind: int, args: tuple[int, ...]) -> int:
        """Return the number of a formula as it stands, without rewriting."""
        key = (kind, args)
        number = self._ids.get(key)
        if number is None:
            number = self._ids[key] = len(self.kind)
            self.kind.append(kind)
            self.args.append(args)
        return number

    def add(self, formula: Formula) -> int:
        """Return the number of a formula in negation normal form, rewritten by the rules below."""
        memo: dict[Formula, int] = {}

        def visit(node: Formula) -> int:
            number = memo.get(node)
            if number is None:
                number = memo[node] = self._add_node(node.op, node, [visit(a) for a in node.args])
            return number

        return visit(formula)

    def _add_node(self, op: str, node: Formula, args: list[int]) -> int:
        if op == "prop":
            return self.literal(self.index_of[node.name], True)
        if op == "not":
            return self.literal(self.args[args[0]][0], False)
        if op == "and":
            return self.conjunction(args)
        if op == "or":
            return self.disjunction(args)
        if op == "next":
            return self.next(args[0])
        if op == "eventually":
            return self.eventually(args[0])
        if op == "until":
            return self.until(args[0], args[1])
        return TRUE if op == "True" else FALSE

    # ----- construction with rewriting -----

    def literal(self, proposition: int, positive: bool) -> int:
        """Return a proposition or its negation."""
        return self.make(LITERAL, (proposition, int(positive)))

    def conjunction(self, operands: Iterable[int]) -> int:
        """Return the conjunction, without operands that others imply; order is kept."""
        return self._join(AND, tuple(operands))

    def disjunction(self, operands: Iterable[int]) -> int:
        """Return the disjunction, without operands that imply others; order is kept."""
        return self._join(OR, tuple(operands))

    def _join(self, kind: int, operands: tuple[int, ...]) -> int:
        key = (kind, operands)
        number = self._joined.get(key)
        if number is None:
            number = self._joined[key] = (self._conjoin if kind == AND else self._disjoin)(operands)
        return number

    def _conjoin(self, operands: tuple[int, ...]) -> int:
        kept = self._irredundant(self.flatten(AND, operands), weaker_goes=True)
        if FALSE in kept or self._complementary(kept):
            return FALSE
        if len(kept) < 2:
            return kept[0] if kept else TRUE
        merged = self._merge(AND, kept)
        return self.make(AND, tuple(kept)) if merged is None else self.conjunction(merged)

    def _disjoin(self, operands: tuple[int, ...]) -> int:
        kept = self._irredundant(self.flatten(OR, operands), weaker_goes=False)
        if TRUE in kept or self._complementary(kept):
            return TRUE
        if len(kept) < 2:
            return kept[0] if kept else FALSE
        merged = self._merge(OR, kept) or self._shorten_untils(kept)
        return self.make(OR, tuple(kept)) if merged is None else self.disjunction(merged)

    def next(self, operand: int) -> int:
        """Return `X operand`; the constants are fixed points, because words are infinite."""
        return operand if operand <= TRUE else self.make(NEXT, (operand,))

    def eventually(self, operand: int) -> int:
        """Return `F operand`, using `F F a = F a`, `F(a U b) = F b`, `F X a = X F a`, also below a disjunction."""
        if operand <= TRUE:
            return operand
        kind = self.kind[operand]
        if kind in (EVENTUALLY, UNTIL):
            return self.eventually(self.args[operand][-1])
        if kind == NEXT:
            return self.next(self.eventually(self.args[operand][0]))
        if kind == OR:
            stripped = [self.args[x][-1] if self.kind[x] in (EVENTUALLY, UNTIL) else x for x in self.args[operand]]
            if tuple(stripped) != self.args[operand]:
                return self.eventually(self.disjunction(stripped))
        return self.make(EVENTUALLY, (operand,))

    def until(self, left: int, right: int) -> int:
        """Return `left U right`, rewritten where implication between the operands allows."""
        if right <= TRUE or self.implies(left, right):
            return right
        kind = self.kind
        if left == TRUE or kind[right] == EVENTUALLY:
            return self.eventually(right)
        if kind[left] == NEXT and kind[right] == NEXT:
            return self.next(self.until(self.args[left][0], self.args[right][0]))
        if kind[right] == UNTIL and self.implies(left, self.args[right][0]):
            return right  # a U (a U b) = a U b
        if kind[right] == OR:  # a U (b | (a U c)) = a U (b | c)
            parts = [
                self.args[x][1] if kind[x] == UNTIL and self.implies(self.args[x][0], left) else x
                for x in self.args[right]
            ]
            if tuple(parts) != self.args[right]:
                return self.until(left, self.disjunction(parts))
        # Where `right` holds, `left` no longer matters: `left` need only be as strong as it is where `right` fails.
        smaller = self._assuming_not(left, right)
        if smaller != left:
            return self.until(smaller, right)
        return self.make(UNTIL, (left, right))

    def _assuming_not(self, left: int, right: int) -> int:
        """Return a shorter formula equal to `left` wherever `right` is false: `(a | b) U b` = `a U b`."""
        if self.implies(self.negated(left), right):
            return TRUE
        if self.kind[left] == OR:
            return self.disjunction([x for x in self.args[left] if not self.implies(x, right)])
        if self.kind[left] == AND:
            return self.conjunction([x for x in self.args[left] if not self.implies(self.negated(x), right)])
        if self.kind[left] == UNTIL and self.args[left][1] == right:
            return self.args[left][0]  # (a U b) U b = a U b
        return left

    def negated(self, number: int) -> int:
        """Return the negation of a literal, or of a conjunction or disjunction of literals.

        Anything else gives TRUE, which implies nothing but itself: callers only ask what the negation implies.
        """
        kind, args = self.kind[number], self.args[number]
        if kind == LITERAL:
            return self.literal(args[0], not args[1])
        if kind in (AND, OR) and all(self.kind[x] == LITERAL for x in args):
            flipped = [self.negated(x) for x in args]
            return self.disjunction(flipped) if kind == AND else self.conjunction(flipped)
        return TRUE

    def flatten(self, kind: int, operands: Iterable[int]) -> list[int]:
        """Return the operands with those of nested conjunctions (or disjunctions, by `kind`) in their place."""
        flat: list[int] = []
        for operand in operands:
            flat.extend(self.args[operand] if self.kind[operand] == kind else (operand,))
        return flat

    def _irredundant(self, operands: list[int], weaker_goes: bool) -> list[int]:
        kept: list[int] = []
        for new in operands:
            if weaker_goes:
                if not any(self.implies(old, new) for old in kept):
                    kept = [old for old in kept if not self.implies(new, old)]
                    kept.append(new)
            elif not any(self.implies(new, old) for old in kept):
                kept = [old for old in kept if not self.implies(old, new)]
                kept.append(new)
        return [x for x in kept if x != (TRUE if weaker_goes else FALSE)]

    def _merge(self, kind: int, operands: list[int]) -> list[int] | None:
        """Join operands that share an operator; None when there are none.

        `X a & X b` = `X(a & b)`, likewise `|`; `F a | F b` = `F(a | b)`; `(a U c) & (b U c)` = `(a & b) U c`;
        `(a U b) | (a U c)` = `a U (b | c)`. Each saves a token, and an atom of the states.
        """
        groups: dict[tuple[int, int], list[int]] = {}
        for x in operands:
            groups.setdefault(self._merge_key(kind, x), []).append(x)
        if len(groups) == len(operands):
            return None
        return [self._merge_group(kind, group) if len(group) > 1 else group[0] for group in groups.values()]

    def _shorten_untils(self, disjuncts: list[int]) -> list[int] | None:
        """Rewrite untils beside other disjuncts: `a | (a U b)` = `a | b`, `(!a U b) | (!b U a)` = `F(a | b)`."""
        for i, x in enumerate(disjuncts):
            if self.kind[x] != UNTIL:
                continue
            left, right = self.args[x]
            for j, y in enumerate(disjuncts):
                if i != j and self.implies(left, y):
                    return [*disjuncts[:i], right, *disjuncts[i + 1 :]]
                if j > i and self.kind[y] == UNTIL:
                    # Until the first right side holds, both left sides do.
                    other_left, other_right = self.args[y]
                    if self.implies(self.negated(left), other_right) and self.implies(self.negated(other_left), right):
                        rest = [z for z in disjuncts if z not in (x, y)]
                        return [*rest, self.eventually(self.disjunction([right, other_right]))]
        return None

    def _merge_key(self, kind: int, number: int) -> tuple[int, int]:
        kind_of, args = self.kind[number], self.args[number]
        if kind_of == NEXT or (kind_of == EVENTUALLY and kind == OR):
            return kind_of, -1
        if kind_of == UNTIL:
            return kind_of, args[1] if kind == AND else args[0]
        return -1, number

    def _merge_group(self, kind: int, group: list[int]) -> int:
        kind_of, args = self.kind[group[0]], self.args[group[0]]
        if kind_of == UNTIL and kind == AND:
            return self.until(self.conjunction(self.args[x][0] for x in group), args[1])
        join = self.conjunction if kind == AND else self.disjunction
        inner = join(self.args[x][-1] for x in group)
        if kind_of == UNTIL:
            return self.until(args[0], inner)
        return self.next(inner) if kind_of == NEXT else self.eventually(inner)

    def _complementary(self, operands: list[int]) -> bool:
        """Return whether some proposition occurs together with its negation."""
        literals = [self.args[x] for x in operands if self.kind[x] == LITERAL]
        return len({proposition for proposition, _ in literals}) < len(literals)

    # ----- implication -----

    def implies(self, a: int, b: int) -> bool:
        """Return True when a syntactic rule shows that `a` implies `b`; False says nothing.

        Each rule goes on to a pair of formulas that is smaller in sum, so the search ends.
        """
        if a in (b, FALSE) or b == TRUE:
            return True
        if a == TRUE or b == FALSE:
            return False
        key = (a, b)
        answer = self._implies.get(key)
        if answer is None:
            answer = self._implies[key] = self._find_implication(a, b)
        return answer

    def _find_implication(self, a: int, b: int) -> bool:
        # Loops, not `all` and `any`: a generator would double the recursion depth.
        implies = self.implies
        kind_a, kind_b, args_a, args_b = self.kind[a], self.kind[b], self.args[a], self.args[b]
        if kind_a == OR:
            for x in args_a:  # noqa: SIM110
                if not implies(x, b):
                    return False
            return True
        if kind_b == AND:
            for y in args_b:  # noqa: SIM110
                if not implies(a, y):
                    return False
            return True
        if kind_a == AND:
            for x in args_a:
                if implies(x, b):
                    return True
        if kind_b == OR:
            for y in args_b:
                if implies(a, y):
                    return True
        elif kind_b == EVENTUALLY:
            if implies(a, args_b[0]):
                return True
            if kind_a in (NEXT, EVENTUALLY, UNTIL):
                return implies(args_a[-1], b)
        elif kind_b == UNTIL:
            if implies(a, args_b[1]):
                return True
            if kind_a == UNTIL and implies(args_a[1], b) and self._implies_either(args_a[0], *args_b):
                return True
            if kind_a == AND and self._folds_into(a, b):
                return True
        elif kind_b == NEXT and kind_a == NEXT:
            return implies(args_a[0], args_b[0])
        if kind_a == UNTIL:
            return implies(args_a[0], b) and implies(args_a[1], b)
        return False

    def _implies_either(self, a: int, b: int, c: int) -> bool:
        if self.kind[a] == OR:
            for x in self.args[a]:  # noqa: SIM110
                if not self._implies_either(x, b, c):
                    return False
            return True
        return self.implies(a, b) or self.implies(a, c)

    def _folds_into(self, conjunction: int, until: int) -> bool:
        """Return whether `x & X y` implies `left U right`, because `x` implies `left` and `y` the until itself."""
        for x in self.args[conjunction]:
            if self.kind[x] == NEXT and self.implies(self.args[x][0], until):
                return self.implies(conjunction, self.args[until][0])
        return False
