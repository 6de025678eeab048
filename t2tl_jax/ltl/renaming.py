"""When two rows mean the same but for the names of propositions: the language of a row with its propositions renamed.

Of all orders of the propositions the one with the smallest code is taken. Few have to be tried: only such propositions
change places that play the same part as far as one can see by counting, and none that play it exactly.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import groupby, product
from math import factorial, prod

import numpy as np

from t2tl_jax.ltl import languages
from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE
from t2tl_jax.ltl.compiler.steps import Steps
from t2tl_jax.ltl.errors import TooLargeError
from t2tl_jax.ltl.languages import Language, minimal, numbered

MAX_ORDERS = 50_000
"""Most orders of the propositions that are tried for one row."""

MAX_READ = 12
"""Most propositions that one row and its future may read where every subset of them is a letter."""


def of_rows(steps: Steps, verdict: np.ndarray, rows: Iterable[int]) -> list[Language]:
    """As `classes`, however many letters there are; each row by itself with the propositions that it reads.

    Args:
        steps: where letters lead.
        verdict: int8 `[rows]`, +1 true, -1 false, 0 open.
        rows: those asked for.

    Raises:
        TooLargeError: for a row that reads too many propositions, or in which too many play the same part.
    """
    if languages.whole_letters(steps):
        letters = steps.dense().shape[1]
        exact = languages.of_rows(steps, verdict, rows)
        return [_of_language(language, letters, steps.alphabet, MAX_ORDERS) for language in exact]
    found = []
    for row in rows:
        part = [row]
        for now in part:  # which grows meanwhile
            part += [after for after in steps.outcomes_of(now) if after not in part]
        read = steps.read_by(part)
        if len(read) > MAX_READ and steps.alphabet != AT_MOST_ONE:
            raise TooLargeError(
                f"a row reads {len(read)} propositions; rows of up to {MAX_READ} are compared under other names "
                "(renaming.MAX_READ): compare these tasks without renaming"
            )
        number = np.zeros(steps.outcomes, int)
        number[part] = np.arange(len(part))
        found += classes(number[steps.among(read).dense(part)], verdict[part], [0], steps.alphabet)
    return found


@lru_cache(maxsize=2**13)  # the same rows come again and again, in tasks of one family
def _of_language(language: Language, letters: int, alphabet: str, most: int) -> Language:
    """Of a row, from its language by whole letters; `most` as `MAX_ORDERS`."""
    ends, *following = np.frombuffer(language, "<i4").reshape(-1, 1 + letters).T
    return _renamed(np.array(following).T, ends, alphabet, most)


def classes(next_row: np.ndarray, verdict: np.ndarray, rows: Iterable[int], alphabet: str) -> list[Language]:
    """The language of each of `rows` up to renaming of propositions: equal exactly if some renaming makes them equal.

    Propositions on which nothing depends do not count, so rows of environments with different propositions compare.

    Args:
        next_row: int `[rows, letters]`, a column for every letter of the environment.
        verdict: int8 `[rows]`, +1 true, -1 false, 0 open.
        rows: those asked for.
        alphabet: "every_subset" or "at_most_one".

    Raises:
        TooLargeError: for a row in which too many propositions play the same part.
    """
    state, following, ends = minimal(next_row, verdict)
    known: dict[int, Language] = {}
    for row in rows:
        start = int(state[row])
        if start not in known:
            known[start] = _renamed(*_part(following, ends, start), alphabet, MAX_ORDERS)
    return [known[int(state[row])] for row in rows]


def _part(following: np.ndarray, ends: np.ndarray, start: int) -> tuple[np.ndarray, np.ndarray]:
    """What is reached from a state, which becomes state 0."""
    order = [start]
    for now in order:  # which grows meanwhile
        order += [after for after in dict.fromkeys(following[now].tolist()) if after not in order]
    number = np.zeros(len(following), int)
    number[order] = np.arange(len(order))
    return number[following[order]], ends[order]


def _renamed(following: np.ndarray, ends: np.ndarray, alphabet: str, most: int) -> Language:
    count = following.shape[1] - 1 if alphabet == AT_MOST_ONE else (following.shape[1] - 1).bit_length()
    used = [p for p in range(count) if _matters(following, p, alphabet)]
    following = following[:, _columns(used, alphabet)]
    parts = _parts(following, ends, len(used), alphabet)
    alike = [_alike(following, ends, part, len(used), alphabet) for part in parts]
    tried = prod(
        factorial(sum(map(len, groups))) // prod(factorial(len(group)) for group in groups) for groups in alike
    )
    if tried > most:
        raise TooLargeError(
            f"{tried:,} orders of {len(used)} propositions would have to be compared; the limit is {most:,} "
            "(renaming.MAX_ORDERS): compare these tasks without renaming"
        )
    orders = product(*map(_arrangements, alike))
    return min(numbered(following[:, _columns(sum(order, ()), alphabet)], ends, 0) for order in orders)


def _columns(order: Sequence[int], alphabet: str) -> np.ndarray:
    """Columns of the letters over propositions in another order, of which some may be left out."""
    if alphabet == AT_MOST_ONE:
        return np.array([0, *(1 + p for p in order)])
    letters = np.arange(2 ** len(order))[:, None]
    return (letters >> np.arange(len(order)) & 1) @ (1 << np.array(order, int))


def _matters(following: np.ndarray, p: int, alphabet: str) -> bool:
    if alphabet == AT_MOST_ONE:
        return bool((following[:, 1 + p] != following[:, 0]).any())
    letters = np.arange(following.shape[1])
    return bool((following[:, letters | 1 << p] != following[:, letters & ~(1 << p)]).any())


def _parts(following: np.ndarray, ends: np.ndarray, count: int, alphabet: str) -> list[list[int]]:
    """The propositions in groups that counting does not tell apart, in an order that no renaming changes."""
    after = following.tolist()
    signature = [(end, int(not state)) for state, end in enumerate(ends.tolist())]  # the start is told apart
    kinds = 0
    while kinds < (kinds := len(set(signature))):
        rank = {one: number for number, one in enumerate(sorted(set(signature)))}
        colour = [rank[one] for one in signature]
        signature = [
            (colour[state], *sorted(colour[to] for to in row), colour[row[0]]) for state, row in enumerate(after)
        ]
    alone = [1 + p if alphabet == AT_MOST_ONE else 1 << p for p in range(count)]
    seen = {p: sorted((colour[state], colour[row[alone[p]]]) for state, row in enumerate(after)) for p in range(count)}
    return [list(part) for _, part in groupby(sorted(seen, key=lambda p: seen[p]), key=lambda p: seen[p])]


def _alike(following: np.ndarray, ends: np.ndarray, part: list[int], count: int, alphabet: str) -> list[list[int]]:
    """A group split into those of which any two may be exchanged without changing the language."""
    groups: list[list[int]] = []
    language = numbered(following, ends, 0)
    for p in part:
        for group in groups:
            exchanged = list(range(count))
            exchanged[group[0]], exchanged[p] = p, group[0]
            if numbered(following[:, _columns(exchanged, alphabet)], ends, 0) == language:
                group.append(p)
                break
        else:
            groups.append([p])
    return groups


def _arrangements(groups: list[list[int]]) -> Iterator[tuple[int, ...]]:
    """The orders of the members of some groups in which those of one group stay in the order that they have."""
    if not any(groups):
        yield ()
    for i, group in enumerate(groups):
        if group:
            for others in _arrangements([*groups[:i], group[1:], *groups[i + 1 :]]):
                yield (group[0], *others)
