"""How many of the claims came out which way, counted from the tables of outcomes that a page shows."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import get_args

from experiments.reproduction import rates
from experiments.reproduction.page import paragraph, table
from t2tl_jax.evaluation.comparisons import Outcome

OUTCOMES: tuple[str, ...] = get_args(Outcome)

SEARCH = "search"
"""The item that judges orderings with methods at the rates that it found."""

REPEATED = ("water-again", SEARCH)
"""Items that judge orderings of other items once more, with runs made again or at learning rates of their own."""

OTHER_PAPER = "benchmark"
"""The item whose claims are those of the paper of reward machines."""


@dataclass(frozen=True)
class Judged:
    """An ordering in a table of outcomes."""

    claim: str
    """Which of two runs is to be ahead."""
    measure: str
    """The heading of the differences that it is judged by."""
    outcome: str

    @property
    def key(self) -> tuple[str, str]:
        """The same for the same ordering, with runs at the usual rates or at rates of their own."""
        return self.claim.replace(rates.own_name(""), ""), self.measure


def tally(sections: Mapping[str, str]) -> str:
    """How many outcomes there are of each kind, by item and in all, and which are others at the rates that the search
    took; '' without any.

    Args:
        sections: of a page, by the names of its items.
    """
    found = {name: judged(text) for name, text in sections.items() if name not in REPEATED}
    counts = {name: Counter(one.outcome for one in of) for name, of in found.items() if of}
    if not counts:
        return ""
    total = sum(counts.values(), Counter[str]())
    rows = [(f"`{name}`", *_cells(of)) for name, of in counts.items()]
    said = f"""
        What became of the claims, in {total.total()} outcomes: {_in_words(total)}. They are counted from the tables of
        the items below. A claim that is judged in two ways, such as at the end and over training, counts twice, and one
        that stands in two tables of an item once; orderings that are judged once more with runs made again, or at rates
        of their own, do not count."""
    if OTHER_PAPER in counts:
        said += f" Those of `{OTHER_PAPER}` ({_in_words(counts[OTHER_PAPER])}) are of the paper of reward machines."
    said += _at_own_rates([one for of in found.values() for one in of], judged(sections.get(SEARCH, "")))
    return f"{paragraph(said)}\n\n{table(('item', *OUTCOMES), [*rows, ('all', *_cells(total))])}"


def judged(text: str) -> list[Judged]:
    """The orderings in the tables of a section; what stands in two of them as it stands in the first."""
    found: dict[tuple[str, str], Judged] = {}
    heading: list[str] = []
    for line, after in pairwise([*text.splitlines(), ""]):
        cells = [cell.strip() for cell in line.strip().strip("|").split(" | ")]
        if after.startswith("|--"):
            heading = cells
        elif line.startswith("| ") and cells[-1] in OUTCOMES:
            one = Judged(cells[0], heading[1] if len(heading) > 1 else "", cells[-1])
            found.setdefault(one.key, one)
    return list(found.values())


def changed(usual: Sequence[Judged], own: Sequence[Judged]) -> list[tuple[Judged, Judged]]:
    """The orderings that come out otherwise with methods at rates of their own, as at the usual rates and as then."""
    searched = {one.key: one for one in own if one.claim != one.key[0]}
    both = [(one, searched[one.key]) for one in usual if one.key in searched]
    return [(first, second) for first, second in both if first.outcome != second.outcome]


def _at_own_rates(usual: Sequence[Judged], own: Sequence[Judged]) -> str:
    """Which ones those are, in words; '' without any method at a rate of its own."""
    searched = [one for one in own if one.claim != one.key[0]]
    if not searched:
        return ""
    each = [
        f"{one.claim} ({then.outcome} instead of {one.outcome}, by {one.measure.removeprefix('difference, ')})"
        for one, then in changed(usual, own)
    ]
    return (
        f" {len(searched)} of them were judged again with a method at a rate of its own, which the search took: "
        f"{'; '.join(each) or 'none'} {'comes' if len(each) < 2 else 'come'} out otherwise."
    )


def _cells(counts: Mapping[str, int]) -> list[str]:
    return [str(counts.get(kind, 0)) for kind in OUTCOMES]


def _in_words(counts: Mapping[str, int]) -> str:
    each = [f"{counts[kind]} {kind}" for kind in OUTCOMES if counts.get(kind)]
    return " and ".join(part for part in (", ".join(each[:-1]), each[-1]) if part)
