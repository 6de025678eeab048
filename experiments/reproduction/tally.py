"""How many of the claims came out which way, counted from the tables of outcomes that a page shows."""

from collections import Counter
from collections.abc import Mapping
from typing import get_args

from experiments.reproduction.page import paragraph, table
from t2tl_jax.evaluation.comparisons import Outcome

OUTCOMES: tuple[str, ...] = get_args(Outcome)

REPEATED = ("water-again", "search")
"""Items that judge orderings of other items once more, with runs made again or at learning rates of their own."""

OTHER_PAPER = "benchmark"
"""The item whose claims are those of the paper of reward machines."""


def tally(sections: Mapping[str, str]) -> str:
    """How many outcomes there are of each kind, by item and in all; '' without any.

    Args:
        sections: of a page, by the names of its items.
    """
    found = {name: outcomes(text) for name, text in sections.items() if name not in REPEATED}
    counts = {name: of for name, of in found.items() if of}
    if not counts:
        return ""
    total = sum(counts.values(), Counter[str]())
    rows = [(f"`{name}`", *_cells(of)) for name, of in counts.items()]
    said = f"""
        What became of the claims, in {total.total()} outcomes: {_in_words(total)}. They are counted from the tables of
        the items below. A claim that is judged in two ways, such as at the end and over training, counts twice;
        orderings that are judged once more with runs made again, or at rates of their own, do not count."""
    if OTHER_PAPER in counts:
        said += f" Those of `{OTHER_PAPER}` ({_in_words(counts[OTHER_PAPER])}) are of the paper of reward machines."
    return f"{paragraph(said)}\n\n{table(('item', *OUTCOMES), [*rows, ('all', *_cells(total))])}"


def outcomes(text: str) -> Counter[str]:
    """Of all tables of a section, how many rows end in which outcome."""
    ends = [line.strip("| ").rpartition(" | ")[2] for line in text.splitlines() if line.startswith("| ")]
    return Counter(end for end in ends if end in OUTCOMES)


def _cells(counts: Mapping[str, int]) -> list[str]:
    return [str(counts.get(kind, 0)) for kind in OUTCOMES]


def _in_words(counts: Mapping[str, int]) -> str:
    each = [f"{counts[kind]} {kind}" for kind in OUTCOMES if counts.get(kind)]
    return " and ".join(part for part in (", ".join(each[:-1]), each[-1]) if part)
