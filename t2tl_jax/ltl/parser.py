"""Text to formula: an operator-precedence parser with an explicit stack, so no nesting can exhaust Python's.

Precedence, loosest first: `<->`, `->`, `|`, `&`, then `U R W M` on one level, then `! X F G`. `->` and the temporal
binary operators associate to the right, as in Spot. Unlike Spot, the longest identifier is taken first: `Gray` is one
proposition.
"""

import re
from typing import NamedTuple

from t2tl_jax.ltl.co_safety import find_offence
from t2tl_jax.ltl.errors import LTLError, LTLSyntaxError, NotCoSafeError, TooLargeError, caret
from t2tl_jax.ltl.formula import BINDING, FALSE, MAX_DEPTH, MAX_SIZE, RIGHT_ASSOCIATIVE, TRUE, Formula, prop

_UNARY = {
    "!": "not", "~": "not", "not": "not",
    "X": "next", "next": "next",
    "F": "eventually", "<>": "eventually", "eventually": "eventually",
    "G": "always", "[]": "always", "always": "always",
}  # fmt: skip

_BINARY = {
    "&": "and", "&&": "and", "/\\": "and", "and": "and",
    "|": "or", "||": "or", "\\/": "or", "or": "or",
    "->": "implies", "=>": "implies", "implies": "implies",
    "<->": "iff", "<=>": "iff", "iff": "iff",
    "U": "until", "until": "until", "R": "release", "release": "release",
    "W": "weak_until", "M": "strong_release",
}  # fmt: skip

_LITERAL = {"true": TRUE, "True": TRUE, "1": TRUE, "false": FALSE, "False": FALSE, "0": FALSE}

_TOKEN = re.compile(
    r"""(?P<space>\s+)
      | (?P<word>[A-Za-z_][A-Za-z0-9_]*)
      | (?P<quoted>"(?:[^"\\]|\\.)*")
      | (?P<symbol><->|<=>|->|=>|&&|\|\||/\\|\\/|<>|\[\]|[!~&|()]|[01](?![A-Za-z0-9_]))""",
    re.VERBOSE | re.DOTALL,
)

_BOOLEAN = frozenset({"prop", "True", "False", "not", "and", "or", "implies", "iff"})

_OPERAND = "a proposition, true, false, ( or one of ! X F G"
_OPERATOR = "& | -> <-> U R W M"


class _Token(NamedTuple):
    text: str
    position: int
    quoted: bool = False


class _Pending(NamedTuple):
    """An operator or an open parenthesis that waits for its (right) operand."""

    op: str  # an operator's name, or "("
    binding: int
    position: int


def parse(text: str, *, co_safe: bool = True, temporal: bool = True) -> Formula:
    """Read a formula.

    Args:
        text: for example `!Red U (Black & F "light on")`.
        co_safe: also check that the formula is syntactically co-safe, which `compile_tasks` needs.
        temporal: allow operators that speak of later steps; the guards of reward machines have none.

    Raises:
        LTLError: anything that is no text.
        LTLSyntaxError: malformed text; the message shows the place and what could stand there.
        NotCoSafeError: some operator makes the formula unsatisfiable by finite words; the message names it.
        TooLargeError: beyond `MAX_SIZE` nodes or `MAX_DEPTH` levels.
    """
    return _Parser(text).parse(co_safe, temporal)


class _Parser:
    def __init__(self, text: str) -> None:
        if not isinstance(text, str):
            raise LTLError(f"parse takes a text, got {text!r:.100}; from_tuple reads nested tuples")
        self.text = text
        self.operands: list[Formula] = []
        self.pending: list[_Pending] = []
        self.open_parentheses = 0
        # Where each node's operator stands. Keyed by identity: equal subformulas stand at several places.
        self.positions: dict[int, int] = {}

    def parse(self, co_safe: bool, temporal: bool) -> Formula:
        wants_operand = True
        for token in self._tokens():
            wants_operand = self._read_operand(token) if wants_operand else self._read_operator(token)
        end = len(self.text.rstrip())
        if wants_operand:
            problem = f"the formula ends after {self._last()}" if self.text.strip() else "the formula is empty"
            raise LTLSyntaxError(problem, self.text, end, _OPERAND)
        while self.pending:
            if self.pending[-1].op == "(":
                raise LTLSyntaxError(
                    "this parenthesis is never closed", self.text, self.pending[-1].position, f"{_OPERATOR} or )"
                )
            self._apply()
        (formula,) = self.operands
        if not temporal:
            self._refuse_temporal(formula)
        if co_safe and (offence := find_offence(formula)) is not None:
            place = caret(self.text, self.positions.get(id(offence.subformula), 0))
            raise NotCoSafeError(f"{offence.message}\n{place}")
        return formula

    def _refuse_temporal(self, formula: Formula) -> None:
        for node in formula.nodes():
            if node.op not in _BOOLEAN:
                place = self.positions.get(id(node), 0)
                match = _TOKEN.match(self.text, place)
                written = match.group() if match else node.op
                raise LTLSyntaxError(f"{written!r} speaks of later steps", self.text, place, "only ! & | -> <->")

    def _tokens(self) -> list[_Token]:
        tokens, position = [], 0
        while position < len(self.text):
            match = _TOKEN.match(self.text, position)
            if match is None:
                character = self.text[position]
                if character == '"':
                    raise LTLSyntaxError("this quotation mark is never closed", self.text, position, 'a closing "')
                raise LTLSyntaxError(
                    f"cannot read {character!r}", self.text, position, f"{_OPERAND}, ) or one of {_OPERATOR}"
                )
            if match.lastgroup == "quoted":
                name = re.sub(r"\\(.)", r"\1", match.group()[1:-1], flags=re.DOTALL)
                if not name:
                    raise LTLSyntaxError("a proposition's name cannot be empty", self.text, position, '"a name"')
                tokens.append(_Token(name, position, quoted=True))
            elif match.lastgroup != "space":
                tokens.append(_Token(match.group(), position))
            position = match.end()
        return tokens

    def _read_operand(self, token: _Token) -> bool:
        """Take a token where an operand must begin; return whether an operand is still wanted."""
        text = token.text
        if token.quoted:
            self._push(prop(text), token.position)
            return False
        if text == "(":
            self.open_parentheses += 1
            if self.open_parentheses > MAX_DEPTH:
                place = caret(self.text, token.position)
                raise TooLargeError(f"more than {MAX_DEPTH} parentheses are open (formula.MAX_DEPTH, no flag)\n{place}")
            self.pending.append(_Pending("(", 0, token.position))
            return True
        if text in _UNARY:
            if len(self.pending) > 2 * MAX_SIZE:
                raise TooLargeError(f"the formula has more than {MAX_SIZE} operators (formula.MAX_SIZE, no flag)")
            self.pending.append(_Pending(_UNARY[text], 6, token.position))
            return True
        if text in _LITERAL:
            # A fresh node, not the shared constant: positions are kept by identity.
            self._push(Formula(_LITERAL[text].op), token.position)
            return False
        if text in _BINARY or text == ")":
            after = f" after {self._last()}" if self.pending else ""
            raise LTLSyntaxError(
                f"{text!r} stands where an operand belongs{after}", self.text, token.position, _OPERAND
            )
        self._push(prop(text), token.position)
        return False

    def _read_operator(self, token: _Token) -> bool:
        """Take a token where an operand has just ended; return whether an operand is wanted next."""
        text = token.text
        if text == ")" and not token.quoted:
            while self.pending and self.pending[-1].op != "(":
                self._apply()
            if not self.pending:
                raise LTLSyntaxError("this parenthesis was never opened", self.text, token.position, _OPERATOR)
            self.pending.pop()
            self.open_parentheses -= 1
            return False
        if text in _BINARY and not token.quoted:
            op = _BINARY[text]
            binding = BINDING[op]
            while self.pending and (
                self.pending[-1].binding > binding
                or (self.pending[-1].binding == binding and op not in RIGHT_ASSOCIATIVE)
            ):
                self._apply()
            self.pending.append(_Pending(op, binding, token.position))
            return True
        closing = " or )" if self.open_parentheses else " or the end"
        raise LTLSyntaxError(f"{text!r} follows a complete formula", self.text, token.position, _OPERATOR + closing)

    def _apply(self) -> None:
        """Build the node of the innermost pending operator."""
        op, _, position = self.pending.pop()
        count = 1 if op in ("not", "next", "eventually", "always") else 2
        args = tuple(self.operands[-count:])
        del self.operands[-count:]
        try:
            node = Formula(op, args)
        except TooLargeError as error:
            raise TooLargeError(f"{error}\n{caret(self.text, position)}") from None
        self._push(node, position)

    def _push(self, node: Formula, position: int) -> None:
        self.operands.append(node)
        self.positions[id(node)] = position

    def _last(self) -> str:
        """Name the operator that still waits for an operand, as it was written."""
        if not self.pending:
            return "nothing"
        match = _TOKEN.match(self.text, self.pending[-1].position)
        return repr(match.group()) if match else "an operator"
