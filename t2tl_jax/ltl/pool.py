"""Pools of random tasks: tables of many formulas of a family, all of exactly the same shapes.

Training on random formulas takes one pool after another. Since shapes do not change, neither does the compiled program.
"""

import random
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from t2tl_jax.ltl import languages, renaming
from t2tl_jax.ltl.compiler.automaton import Automaton, build
from t2tl_jax.ltl.compiler.budget import Limits, way_out
from t2tl_jax.ltl.compiler.forest import Forest
from t2tl_jax.ltl.compiler.states import EXACT
from t2tl_jax.ltl.errors import TooLargeError
from t2tl_jax.ltl.families import TaskFamily, make_sampler
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.languages import Language
from t2tl_jax.ltl.padding import Blank
from t2tl_jax.ltl.table import TaskTable

DRAWS_PER_TASK = 50
"""How often a formula may be drawn for each place of a pool before the caps count as too small; of a pool with more
places than rows, for each row, since every formula begins in a row of its own."""


def compile_pool(
    family: str | TaskFamily,
    propositions: Sequence[str],
    alphabet: str,
    seed: str | int,
    *,
    size: int,
    rows: int,
    length: int,
    nodes: int = 0,
    progression: str = EXACT,
    limits: Limits | None = None,
    least: int | None = None,
    unlike: Collection[Language] = (),
    without: Collection[Language] = (),
    held_out: Collection[Language] = (),
    fill: bool = False,
) -> TaskTable:
    """Draw `size` different formulas of a family and compile them to one table, on the host.

    Every proposition has its letter, used or not, so that tables of equal arguments but for the seed have equal shapes.
    Rows that are left over repeat the row of false, see `padding.Blank`.

    Formulas that do not fit are drawn again: those with a progressed formula of more than `length` tokens, those with
    more states than there are rows left, or more nodes than are left for their letters, and those that are too
    entangled to be compared with what is held out. The caps therefore shorten the tail of a family.

    Args:
        family: such as `Until_1_2_1_1`, see `make_sampler`; or one that is data.
        propositions: the environment's propositions, in its order.
        alphabet: as in `compile_tasks`.
        seed: equal arguments give equal tables.
        size: number of formulas, which are the tasks of the table.
        rows: rows of the table, true and false included.
        length: tokens per row.
        nodes: room for what letters over many propositions leave open, see `padding.Blank`; 0 for twice `rows`.
        progression: as in `compile_tasks`.
        limits: as in `compile_tasks`, but for the rows, of which `rows` is the limit.
        least: so few formulas will do where more cannot be found; by default `size`.
        unlike: no formula means one of these.
        without: nor does one mean or become one of these.
        held_out: nor one of these, under whatever names of propositions; classes of `renaming`.
        fill: where fewer than `size` are found, they come again until there are as many.

    Raises:
        UnknownTaskError, LTLError: for a family that does not exist or needs more propositions.
        TooLargeError: when too few of the formulas drawn fit into `rows` and `length`, or differ from each other.
    """
    names = tuple(propositions)
    draw = make_sampler(family, names)
    rng = random.Random(f"{family if isinstance(family, str) else repr(family)} {seed}")
    blank = Blank(names, alphabet, rows, length, nodes, limits)
    _check_size(size, limits or Limits())
    limits = replace(limits or Limits(), max_rows=rows)
    builder = _Builder(blank, limits, progression, frozenset(unlike), frozenset(without), frozenset(held_out))
    draws = DRAWS_PER_TASK * min(size, rows)
    for _ in range(draws):
        if len(builder.initial_row) == size:
            return builder.table()
        builder.add(draw(rng))
    if len(builder.initial_row) >= (size if least is None else least):
        return builder.table(repeated_to=size if fill else 0)
    raise TooLargeError(
        f'{len(builder.initial_row)} of {size} formulas of "{family}" were found within {draws} draws: '
        f"{builder.reasons()}; raise the caps on tokens and rows{' and nodes' * bool(blank.room[1:])}, or ask for "
        "fewer formulas"
    )


def compile_weighted(
    tasks: Sequence[Formula],
    weights: Sequence[float],
    propositions: Sequence[str],
    alphabet: str,
    seed: str | int,
    *,
    size: int,
    rows: int,
    length: int,
    nodes: int = 0,
    progression: str = EXACT,
    limits: Limits | None = None,
    without: Collection[Language] = (),
    held_out: Collection[Language] = (),
) -> tuple[TaskTable, list[int]]:
    """Draw `size` of some tasks by their weights, each as often as it comes, and compile them to one table.

    A task that does not fit or is kept out is never drawn again; arguments and shapes are those of `compile_pool`.

    Returns:
        The table, and for each of its tasks which of the given ones it is.

    Raises:
        TooLargeError: when none of the tasks fits.
    """
    rng = random.Random(f"weighted {seed}")
    blank = Blank(tuple(propositions), alphabet, rows, length, nodes, limits)
    _check_size(size, limits or Limits())
    limits = replace(limits or Limits(), max_rows=rows)
    builder = _Builder(blank, limits, progression, frozenset(), frozenset(without), frozenset(held_out))
    left = {number: weight for number, weight in enumerate(weights) if weight > 0}
    place_of: dict[int, int] = {}
    drawn: list[int] = []
    while len(drawn) < size:
        if not left:
            raise TooLargeError(f"none of {len(tasks)} tasks can be had: {builder.reasons()}; raise the caps")
        (number,) = rng.choices(list(left), list(left.values()))
        if number not in place_of:
            row = builder.row_of_task(tasks[number])
            if row is None:
                del left[number]
                continue
            place_of[number] = row
        drawn.append(number)
    builder.initial_row = [place_of[number] for number in drawn]
    return builder.table(), drawn


def _check_size(size: int, limits: Limits) -> None:
    if size > limits.max_cells:
        raise TooLargeError(
            f"a pool of {size:,} formulas is too large; the limit is max_cells={limits.max_cells:,}: ask for fewer "
            f"(of a run --pool.size), or {way_out('max_cells', size)}"
        )


class _Builder:
    """A pool under construction. Rows of different tasks that show the same formula are one row."""

    def __init__(
        self,
        blank: Blank,
        limits: Limits,
        progression: str,
        unlike: frozenset[Language],
        without: frozenset[Language],
        held_out: frozenset[Language],
    ) -> None:
        self.unlike, self.without, self.held_out = unlike, without, held_out
        self.blank, self.limits, self.progression = blank, limits, progression
        self.rows, self.length = blank.tokens.shape
        self.forest = Forest(blank.alphabet, blank.cuts, blank.room)
        self.row_of: dict[tuple[int, ...], int] = {}
        self.initial_row: list[int] = []
        self.outcome: dict[Formula, str] = {}
        self.count: Counter[str] = Counter()
        self.renamed: dict[Language, Language] = {}

    def add(self, formula: Formula) -> str:
        """Take in a formula, or say and count why not; one that came before is not looked at again."""
        known = self.outcome.get(formula)
        outcome = self._add(formula) if known is None else "repeated" if known == "taken" else known
        self.outcome.setdefault(formula, outcome)
        self.count[outcome] += 1
        return outcome

    def _add(self, formula: Formula) -> str:
        try:
            automaton = self._build(formula)
        except TooLargeError:
            return "too many"
        start = int(automaton.initial_row[0])
        fresh = [row for row in range(2, len(automaton.tokens)) if automaton.tokens[row] not in self.row_of]
        if start < 2 or self.row_of.get(automaton.tokens[start]) in self.initial_row:
            return "repeated"
        if max(map(len, automaton.tokens)) > self.length:
            return "too long"
        if len(fresh) > self.rows - 2 - len(self.row_of):
            return "too many"
        try:
            if self._is_kept_out(automaton, start):
                return "kept out"
        except TooLargeError:
            return "entangled"
        if not self._take(automaton, fresh):
            return "too wide"
        self.initial_row.append(self.row_of[automaton.tokens[start]])
        return "taken"

    def row_of_task(self, formula: Formula) -> int | None:
        """Take in a formula that may be there already; the row it starts in, None if it cannot be had."""
        outcome = self.add(formula)
        if outcome == "taken":
            return self.initial_row[-1]
        if outcome != "repeated":
            return None
        automaton = self._build(formula)
        return self.row_of.get(automaton.tokens[int(automaton.initial_row[0])])

    def reasons(self) -> str:
        """Why formulas were not taken in."""
        count, room = self.count, self.blank.room
        wide = f"{count['too wide']} too many nodes for the {room[-1]} of their letters, " if room[1:] else ""
        return (
            f"{count['too long']} had a row of more than {self.length} tokens, {count['too many']} too many states for "
            f"the {self.rows} rows together, {wide}{count['repeated']} came twice, {count['kept out']} belong to "
            f"another pool, {count['entangled']} have too many propositions that play the same part to be compared "
            "with what is held out"
        )

    def _build(self, formula: Formula) -> Automaton:
        names, alphabet = self.blank.names, self.blank.alphabet
        return build([formula], names, alphabet, limits=self.limits, progression=self.progression)

    def _is_kept_out(self, automaton: Automaton, start: int) -> bool:
        if not (self.unlike or self.without or self.held_out):
            return False
        open_rows = range(2, len(automaton.tokens))
        found = languages.of_rows(automaton.every_letter(), automaton.verdict, open_rows)
        if found[start - 2] in self.unlike or not self.without.isdisjoint(found):
            return True
        if not self.held_out:
            return False
        new = {language: row for language, row in zip(found, open_rows, strict=True) if language not in self.renamed}
        renamed = renaming.of_rows(automaton.steps, automaton.verdict, new.values())
        self.renamed.update(zip(new, renamed, strict=True))
        return not self.held_out.isdisjoint(self.renamed[language] for language in found)

    def _take(self, automaton: Automaton, fresh: list[int]) -> bool:
        """Give fresh rows a place, unless there is no room for their letters."""
        places = {automaton.tokens[row]: 2 + len(self.row_of) + number for number, row in enumerate(fresh)}
        # Equal formulas have equal futures, so rows that were there already stay as they are.
        known = self.row_of | places
        rows = [0, 1, *(known[tokens] for tokens in automaton.tokens[2:])]
        if not self.forest.add(automaton.every_letter(), rows, fresh):
            return False
        self.row_of = known
        for row in fresh:
            self.blank.show(rows[row], automaton.tokens[row], 0)
        return True

    def table(self, repeated_to: int = 0) -> TaskTable:
        count = max(repeated_to, len(self.initial_row))
        return self.blank.table(self.forest.steps(), np.resize(np.array(self.initial_row, np.int32), count))
