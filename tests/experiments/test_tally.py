"""How claims came out is counted from the tables that are shown."""

from collections import Counter
from pathlib import Path

from experiments.reproduction.items import PAPER_ITEMS
from experiments.reproduction.page import table
from experiments.reproduction.tally import OTHER_PAPER, REPEATED, outcomes, tally
from tests.page_cells import cells

ROOT = Path(__file__).parents[2]


def judged(*ends):
    return "Words that are undecided.\n\n" + table(
        ("claim", "outcome"), [(f"a > {k}", end) for k, end in enumerate(ends)]
    )


SECTIONS = {
    "fig-zone": judged("reproduced", "undecided", "not claimed") + "\n\n" + judged("not reproduced", "undecided"),
    "water-again": judged("reproduced"),
    "search": judged("undecided"),
    "safe": judged("not claimed"),
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
    text = tally({OTHER_PAPER: judged("reproduced", "reproduced")})
    assert "in 2 outcomes: 2 reproduced." in text
    assert "Those of `benchmark` (2 reproduced) are of the paper of reward machines." in " ".join(text.split())


def test_what_is_not_the_end_of_a_row_does_not_count():
    assert outcomes("undecided\n| undecided | 3 |\n| x | undecided |") == Counter(undecided=1)
    assert {*REPEATED, OTHER_PAPER} <= set(PAPER_ITEMS)


def test_most_claims_are_undecided_as_the_readme_says():
    page = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    titles = {PAPER_ITEMS[name].title for name in REPEATED}
    found = sum((outcomes(of) for of in page.split("\n## ")[1:] if of.partition("\n")[0] not in titles), Counter())
    assert found["undecided"] > found.total() / 2 > 0
    said = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    other = next(outcomes(of) for of in page.split("\n## ") if of.startswith(PAPER_ITEMS[OTHER_PAPER].title))
    own = {kind: found[kind] - other[kind] for kind in found}
    decided = f"{own['reproduced']} of the other {own['reproduced'] + own['not reproduced']} reproduced"
    assert f"Most published orders are [undecided](docs/results.md), {decided}." in said
