"""Reward machines: tasks written as states and guarded transitions instead of one formula.

The text of a machine, one statement per line, `#` begins a comment:

    start -> 1              # the first state
    otherwise -> fail       # when no line of the present state applies: stay, fail, done or a state, with any reward
    1 -> 1 : !(a | b)
    1 -> 2 : a & !b
    2 -> done : b / 1       # `/ 1`: this transition pays 1; without it, 0

Each step reads the set of true propositions and tries the lines of the present state from top to bottom; the first
whose guard holds is taken, so a machine is deterministic whatever its guards. Guards are formulas without temporal
operators. `done` and `fail` end the task, as a success and as a failure; what that pays is up to the lines.
States are numbered in the order in which they first stand to the left of an arrow.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from t2tl_jax.ltl.errors import (
    LTLError,
    LTLSyntaxError,
    MachineSyntaxError,
    TooLargeError,
    UnknownPropositionError,
    caret,
    nearest,
)
from t2tl_jax.ltl.formula import TRUE, Formula
from t2tl_jax.ltl.parser import parse

START, OTHERWISE, STAY, DONE, FAIL = "start", "otherwise", "stay", "done", "fail"
RESERVED_STATES = (START, OTHERWISE, STAY, DONE, FAIL)
"""Words of the format; no state can have such a name."""

_MAX_REWARD = 1e30  # fits into float32 with room for sums


@dataclass(frozen=True)
class Transition:
    """One line of a machine.

    Attributes:
        source: a state.
        target: a state, `done` or `fail`.
        guard: a formula without temporal operators.
        reward: what taking it pays.
        position: index into the machine's text at which the guard begins (not compared).
    """

    source: str
    target: str
    guard: Formula
    reward: float = 0.0
    position: int = field(default=0, compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.source} -> {self.target} : {self.guard}{_reward_text(self.reward)}"


@dataclass(frozen=True)
class RewardMachine:
    """A machine as `parse_machine` reads it; `str` gives text that parses back to an equal machine.

    Attributes:
        name: for listings and errors.
        start: the first state.
        otherwise: where a step leads that no line applies to: `stay`, `done`, `fail` or a state.
        otherwise_reward: what such a step pays.
        transitions: the lines, in their order.
        text: the text that was read (not compared).
    """

    name: str
    start: str
    otherwise: str
    otherwise_reward: float
    transitions: tuple[Transition, ...]
    text: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        states = self.states
        targets = {transition.target for transition in self.transitions} - {DONE, FAIL}
        for name in (self.start, *sorted(targets), *({self.otherwise} - {STAY, DONE, FAIL})):
            if name not in states:
                raise LTLError(f'{self.name}: "{name}" is none of its states: {", ".join(states)}')

    @property
    def states(self) -> tuple[str, ...]:
        """The states other than `done` and `fail`, in their order."""
        return tuple(dict.fromkeys(transition.source for transition in self.transitions))

    def propositions(self) -> tuple[str, ...]:
        """Return the names of the propositions in the guards, each once, in order of first use."""
        return tuple(dict.fromkeys(name for transition in self.transitions for name in transition.guard.propositions()))

    def lines_of(self, state: str) -> tuple[Transition, ...]:
        """Return the transitions from a state, in the order in which they are tried."""
        return tuple(transition for transition in self.transitions if transition.source == state)

    def step(self, state: str, label: Collection[str]) -> tuple[str, float]:
        """Return the state that follows when exactly the propositions of `label` are true, and the reward.

        Nothing follows `done` and `fail`: they stay and pay 0.

        Raises:
            LTLError: when the machine has no such state.
        """
        if state in (DONE, FAIL):
            return state, 0.0
        if state not in self.states:
            raise LTLError(
                f'{self.name} has no state "{state}"; known: {", ".join(self.states)}{nearest(state, self.states)}'
            )
        values = {name: np.bool_(name in label) for name in self.propositions()}
        for transition in self.lines_of(state):
            if truth(transition.guard, values):
                return transition.target, transition.reward
        return (state if self.otherwise == STAY else self.otherwise), self.otherwise_reward

    def check_propositions(self, known: Sequence[str]) -> None:
        """Refuse guards over other propositions than `known`.

        Raises:
            UnknownPropositionError: shows the first such guard.
        """
        for transition in self.transitions:
            for name in transition.guard.propositions():
                if name not in known:
                    raise UnknownPropositionError(
                        f'{self.name}: unknown proposition "{name}"; known: {", ".join(known) or "none"}'
                        f"{nearest(name, known)}\n{self._place(transition, name)}"
                    )

    def _place(self, transition: Transition, name: str) -> str:
        if not self.text:
            return f"  {transition}"
        found = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)").search(self.text, transition.position)
        return caret(self.text, found.start() if found else transition.position)

    def __str__(self) -> str:
        lines = [
            f"{START} -> {self.start}",
            f"{OTHERWISE} -> {self.otherwise}{_reward_text(self.otherwise_reward)}",
            "",
        ]
        return "\n".join([*lines, *map(str, self.transitions)]) + "\n"


def truth(guard: Formula, values: Mapping[str, np.ndarray | np.bool_]) -> np.ndarray | np.bool_:
    """Evaluate a formula without temporal operators.

    Args:
        guard: the formula.
        values: per proposition bool `[...]`, all of one shape.

    Returns:
        bool of that shape; a scalar when the guard has no proposition.
    """
    if guard.op == "prop":
        return values[guard.name]
    if not guard.args:
        return np.bool_(guard.op == "True")
    operands = [truth(arg, values) for arg in guard.args]
    match guard.op:
        case "not":
            return ~operands[0]
        case "and":
            return operands[0] & operands[1]
        case "or":
            return operands[0] | operands[1]
        case "implies":
            return ~operands[0] | operands[1]
        case "iff":
            return operands[0] == operands[1]
    raise LTLError(f"a guard cannot use {guard.op!r}: {guard}")


def parse_machine(text: str, name: str = "machine") -> RewardMachine:
    """Read the text of a machine; the module's docstring describes the format.

    Args:
        text: the lines.
        name: what errors and listings call the machine.

    Raises:
        MachineSyntaxError: shows the line, the place, and what could stand there.
        TooLargeError: for a guard beyond the limits of formulas.
    """
    return _Parser(text, name).parse()


# A line up to its comment: quoted names may hold `#`.
_CODE = re.compile(r'(?:"(?:[^"\\\n]|\\.)*"|[^"#\n])*')
_SPACE = re.compile(r"[^\S\n]*")
_STATE = re.compile(r"\w+")
_ARROW = re.compile(r"->")
_COLON = re.compile(r":")
# The last slash of a line, when neither `/\` nor `\/` nor inside a quoted name.
_REWARD = re.compile(r'(?<!\\)/(?!\\)\s*(?P<number>[^\s/"]*)\s*$')


@dataclass
class _Target:
    """Where a line leads, and where that stands in the text."""

    name: str
    position: int
    reward: float


class _Parser:
    def __init__(self, text: str, name: str) -> None:
        if not isinstance(text, str):
            raise TypeError(f"parse_machine takes a string, got {type(text).__name__}")
        self.text, self.name = text, name
        self.position = self.end = 0
        self.heads: dict[str, _Target] = {}
        self.lines: list[tuple[str, _Target, Formula, int]] = []
        self.closed: set[str] = set()

    def parse(self) -> RewardMachine:
        """Read all lines, then check what they say about each other."""
        start = 0
        for line in self.text.split("\n"):
            self._read_line(start, start + len(line))
            start += len(line) + 1
        for word, example in ((START, "start -> STATE"), (OTHERWISE, "otherwise -> stay, or otherwise -> fail")):
            if word not in self.heads:
                raise self._error(f'the line "{word} -> ..." is missing', len(self.text.rstrip()), example)
        states = dict.fromkeys(source for source, *_ in self.lines)
        for target in [self.heads[START], self.heads[OTHERWISE], *(line[1] for line in self.lines)]:
            self._check_target(target, list(states))
        transitions = tuple(
            Transition(source, target.name, guard, target.reward, position)
            for source, target, guard, position in self.lines
        )
        otherwise = self.heads[OTHERWISE]
        return RewardMachine(
            self.name, self.heads[START].name, otherwise.name, otherwise.reward, transitions, self.text
        )

    def _read_line(self, start: int, end: int) -> None:
        code = _CODE.match(self.text, start, end)
        if code is not None and self.text[code.end() : code.end() + 1] == "#":
            end = code.end()
        self.position, self.end = start, end
        self._skip_space()
        if self.position == self.end:
            return
        begin = self.position
        source = self._take(_STATE, 'a state, "start" or "otherwise"')
        self._take(_ARROW, "->")
        place = self.position
        target = _Target(self._take(_STATE, "a state, done or fail"), place, 0.0)
        if source in (START, OTHERWISE):
            if source in self.heads:
                raise self._error(f'a second line "{source} -> ..."', begin, "only one")
            if source == OTHERWISE:
                target.reward = self._take_reward()
            if self.position < self.end:
                raise self._error(
                    f"{self.text[self.position]!r} follows a complete line", self.position, "the end of the line"
                )
            self.heads[source] = target
            return
        if source in RESERVED_STATES:
            reason = "the task is over there" if source in (DONE, FAIL) else "the word is reserved"
            raise self._error(f'no line can begin with "{source}": {reason}', begin, "a state")
        self._take(_COLON, ": and a guard")
        target.reward = self._take_reward()
        if source in self.closed:
            raise self._error(f"this line is never reached: an earlier line of state {source} always holds", begin)
        guard, position = self._guard(), self.position
        if guard == TRUE:
            self.closed.add(source)
        self.lines.append((source, target, guard, position))

    def _guard(self) -> Formula:
        try:
            return parse(self.text[self.position : self.end], co_safe=False, temporal=False)
        except LTLSyntaxError as error:
            raise self._error(error.problem, self.position + error.position, error.expected) from None
        except TooLargeError as error:
            raise TooLargeError(f"{self.name}: {error}") from None

    def _take_reward(self) -> float:
        """Cut `/ number` off the end of the line and return the number, 0 when there is none."""
        found = _REWARD.search(self.text[self.position : self.end])
        if found is None:
            return 0.0
        place, word = self.position + found.start("number"), found["number"]
        self.end = self.position + found.start()
        while self.end > self.position and self.text[self.end - 1].isspace():
            self.end -= 1
        try:
            reward = float(word)
        except ValueError:
            reward = math.nan
        if not abs(reward) <= _MAX_REWARD:
            raise self._error(
                f"the reward {word!r} is no number between -{_MAX_REWARD:g} and {_MAX_REWARD:g}", place, "/ 1"
            )
        return reward

    def _check_target(self, target: _Target, states: list[str]) -> None:
        """Refuse a target that is no state, or a reserved word out of place."""
        if target.name in states:
            return
        if target is self.heads[OTHERWISE]:
            words = [STAY, DONE, FAIL]
        else:
            words = [] if target is self.heads[START] else [DONE, FAIL]
        if target.name not in words:
            known = [*states, *words]
            raise self._error(
                f'no line leads from "{target.name}"{nearest(target.name, known)}',
                target.position,
                f"one of {', '.join(known)}" if known else 'a line "STATE -> STATE : GUARD"',
            )

    def _take(self, pattern: re.Pattern[str], expected: str) -> str:
        found = pattern.match(self.text, self.position, self.end)
        if found is None:
            at = self.text[self.position : self.position + 1] if self.position < self.end else ""
            raise self._error(f"cannot read {at!r}" if at else "the line ends here", self.position, expected)
        self.position = found.end()
        self._skip_space()
        return found.group()

    def _skip_space(self) -> None:
        found = _SPACE.match(self.text, self.position, self.end)
        self.position = found.end() if found else self.position

    def _error(self, problem: str, position: int, expected: str = "") -> MachineSyntaxError:
        return MachineSyntaxError(self.name, problem, self.text, position, expected)


def _reward_text(reward: float) -> str:
    return f" / {reward!r}".removesuffix(".0") if reward else ""
