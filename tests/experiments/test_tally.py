"""How claims came out is counted from the tables that are shown."""

from collections import Counter
from pathlib import Path

from experiments.reproduction.items import PAPER_ITEMS
from experiments.reproduction.page import table
from experiments.reproduction.tally import OTHER_PAPER, REPEATED, SEARCH, Judged, changed, judged, tally
from tests.page_cells import cells

ROOT = Path(__file__).parents[2]


def shown(*ends, measure="return"):
    return "Words that are undecided.\n\n" + table(
        ("claim", measure, "outcome"), [(f"a > {k}", "0.1", end) for k, end in enumerate(ends)]
    )


SECTIONS = {
    "fig-zone": "\n\n".join(
        (
            shown("reproduced", "undecided", "not claimed"),
            shown("not reproduced", "undecided", measure="area"),
            shown("reproduced", "undecided"),  # the same once more, as a table by other settings may show it
        )
    ),
    "water-again": shown("reproduced"),
    "search": shown("undecided"),
    "safe": shown("not claimed"),
    "missing": "",
}


def test_outcomes_are_counted_by_item_and_in_all():
    text = tally(SECTIONS)
    assert "in 4 outcomes: 1 reproduced, 1 not reproduced and 2 undecided." in " ".join(text.split())
    assert cells(text) == {
        "item": ["reproduced", "not reproduced", "undecided"],
        "`fig-zone`": ["1", "1", "2"],
        "all": ["1", "1", "2"],
    }
    assert "reward machines" not in text and tally({"search": SECTIONS["search"], "safe": ""}) == ""
    text = tally({OTHER_PAPER: shown("reproduced", "reproduced")})
    assert "in 2 outcomes: 2 reproduced." in text
    assert "Those of `benchmark` (2 reproduced) are of the paper of reward machines." in " ".join(text.split())


def test_what_is_not_the_end_of_a_row_does_not_count():
    text = "| undecided | 3 |\n| claim | by |  |\n|---|---|---|\n| undecided | 1 | 3 |\n| x > y | 1 | undecided |"
    assert judged("undecided\n" + text) == [Judged("x > y", "by", "undecided")]
    assert {*REPEATED, OTHER_PAPER} <= set(PAPER_ITEMS)


def test_what_comes_out_otherwise_at_rates_of_their_own_is_named():
    """By the same measure; a claim of the search whose runs are at the usual rate says nothing new."""
    usual = table(("claim", "difference, x", ""), [("water-a > water-b", "0.1", "reproduced")])
    usual += "\n\n" + table(("claim", "y", ""), [("water-a > water-b", "0.1", "reproduced")])
    rows = [("water-a > water-b-own-rate", "0", "undecided"), ("water-c > water-d", "0", "undecided")]
    own = table(("claim", "difference, x", ""), rows)
    assert [then.claim for _, then in changed(judged(usual), judged(own))] == ["water-a > water-b-own-rate"]
    text = " ".join(tally({"fig-water": usual, "search": own}).split())
    assert "1 of them were judged again with a method at a rate of its own, which the search took: water-a" in text
    assert "water-a > water-b (undecided instead of reproduced, by x) comes out otherwise." in text
    text = tally({"fig-water": usual, "search": own.replace("undecided", "reproduced")})
    assert "took: none comes out otherwise." in " ".join(text.split())


def test_most_claims_are_undecided_as_the_readme_says():
    page = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    sections = {part.partition("\n")[0]: judged(part) for part in page.split("\n## ")[1:]}
    repeated = {PAPER_ITEMS[name].title for name in REPEATED}
    other, searched = (sections[PAPER_ITEMS[name].title] for name in (OTHER_PAPER, SEARCH))
    counted = [one for title, of in sections.items() if title not in repeated for one in of]
    every = Counter(one.outcome for one in counted)
    assert every["undecided"] > every.total() / 2 > 0
    own = every - Counter(one.outcome for one in other)
    lost = sum(one.outcome == "reproduced" for one, _ in changed(counted, searched))
    decided = f"{own['reproduced']} of {own['reproduced'] + own['not reproduced']} others reproduced"
    said = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    fewer = f" ({lost} not at searched rates)"
    assert f"Claimed orders: most [undecided](docs/results.md), {decided}{fewer}." in said
