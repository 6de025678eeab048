"""What a test has in common with a training: rows that mean the same, also under other names of propositions.

A formula that was never drawn may still be one that training met, as what is left of another. So a task counts as
unseen only if none of its open rows is a row of training.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice
from random import Random

from t2tl_jax.ltl import languages, renaming
from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE
from t2tl_jax.ltl.compiler.automaton import build
from t2tl_jax.ltl.compiler.budget import Limits
from t2tl_jax.ltl.families import TaskFamily, make_sampler, named_families
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.languages import Language

DRAWS = 4000
"""How many tasks of a family are looked at, where it has more or cannot list them."""

_AT_ONCE = 200
"""Formulas that are compiled together."""

_ROWS_AT_ONCE = 100_000


@dataclass(frozen=True)
class Share:
    """How many of the open rows of a task training has met."""

    met: int
    rows: int
    at_least: bool = False
    """Whether only a part of the training was looked at, so that it may have met more."""

    @property
    def unseen(self) -> bool:
        """Whether it met none; never said where only a part of the training was looked at."""
        return self.met == 0 and not self.at_least

    def __str__(self) -> str:
        return f"{'>=' * (self.at_least and self.met < self.rows)}{self.met}/{self.rows}"


def share(rows: Sequence[Language], training: Collection[Language], at_least: bool = False) -> Share:
    """What part of some rows those of a training hold; both by `row_languages` with equal settings.

    `at_least` where `training` is only a part of what it met.
    """
    return Share(sum(row in training for row in rows), len(rows), at_least)


def together(shares: Iterable[Share]) -> Share:
    """The sum of the rows met over the sum of all rows; a row that two tasks share counts twice."""
    every = list(shares)
    part = any(one.at_least and one.met < one.rows for one in every)
    return Share(sum(one.met for one in every), sum(one.rows for one in every), part)


def row_languages(
    formulas: Iterable[str | Formula],
    propositions: Sequence[str],
    alphabet: str = AT_MOST_ONE,
    *,
    renamed: bool = True,
) -> list[Language]:
    """The languages of all open rows of some formulas, of what they can become too; each row once.

    Args:
        formulas: the tasks.
        propositions: the environment's propositions, in its order.
        alphabet: as in `compile_tasks`.
        renamed: whether rows that differ in the names of propositions only have equal languages.

    Raises:
        LTLError: as the formulas deserve.
    """
    found: dict[Language, Language] = {}
    for rows in languages_of_each(formulas, propositions, alphabet, renamed=renamed):
        found.update(rows)
    return list(found.values())


def languages_of_each(
    formulas: Iterable[str | Formula],
    propositions: Sequence[str],
    alphabet: str = AT_MOST_ONE,
    *,
    renamed: bool = True,
) -> Iterator[dict[Language, Language]]:
    """For each formula in turn the languages of its open rows, and what each of them is up to renaming.

    Args and errors as `row_languages`; without `renamed` a language stands for itself.
    """
    known: dict[Language, Language] = {}
    names, formulas = tuple(propositions), iter(formulas)
    while some := list(islice(formulas, _AT_ONCE)):
        automaton = build(some, names, alphabet, limits=Limits(max_rows=_ROWS_AT_ONCE))
        exact = languages.of_rows(automaton.every_letter(), automaton.verdict, range(2, len(automaton.verdict)))
        new = {language: row for row, language in enumerate(exact, 2) if language not in known}
        codes = renaming.of_rows(automaton.steps, automaton.verdict, new.values()) if renamed else new
        known.update(zip(new, codes, strict=True))
        outcomes = cache(automaton.steps.outcomes_of)
        for start in automaton.initial_row.tolist():
            part = {start: None}
            waiting = [start]
            while waiting:
                fresh = [row for row in outcomes(waiting.pop()) if row not in part]
                part.update(dict.fromkeys(fresh))
                waiting += fresh
            yield {exact[row - 2]: known[exact[row - 2]] for row in part if row >= 2}


def tasks_of(family: str | TaskFamily, propositions: Sequence[str], draws: int = DRAWS) -> list[Formula]:
    """Every task of a family if it can list them and has no more than `draws`, else so many draws of seed 0, each once.

    Raises:
        UnknownTaskError, LTLError: as `make_sampler`.
    """
    sampler, names = make_sampler(family, propositions), tuple(propositions)
    data = named_families().get(family) if isinstance(family, str) else family
    listed = None if data is None else data.every(names)
    if listed is not None and len(every := list(islice(listed, draws + 1))) <= draws:
        return list(dict.fromkeys(every))
    rng = Random(0)
    return list(dict.fromkeys(sampler(rng) for _ in range(draws)))
