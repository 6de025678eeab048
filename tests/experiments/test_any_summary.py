"""The first table of the page of agents for any task: all aims in one place."""

import json

import pytest

from experiments.reproduction import stored, typed
from experiments.reproduction.anytask import summary
from experiments.reproduction.anytask.items import AIMS, ANY_ITEMS
from tests.page_cells import cells

RESULTS = stored.REPOSITORY / "results"


@pytest.fixture(scope="module")
def runs():
    return stored.load(RESULTS / "any")


@pytest.mark.slow
def test_the_summary_holds_every_aim_of_the_sections(runs):
    """Each section shows its own aims in the same words; of certificates only the summary tells the time."""
    said = summary.summary(runs, RESULTS)
    lines = [line.strip("| ").split(" | ") for line in said.splitlines() if line.startswith("| [")]
    assert AIMS.keys() <= ANY_ITEMS.keys()
    for item, (about, aims) in AIMS.items():
        there = {name: runs[name] for name in ANY_ITEMS[item].runs if name in runs}
        section, link = ANY_ITEMS[item].section(there), f"[{about}](#{summary.anchor(ANY_ITEMS[item].title)})"
        for aim in aims(runs):
            assert [link, *aim] in lines
            assert item == "any-certificates" or f"| {' | '.join(aim)} |" in section
    assert f"Of the {len(lines)} lines of this table" in said and "it is not decided" in said
    assert summary.summary({}, RESULTS / "nothing") == ""


def test_links_are_those_of_headings():
    titles = [item.title for item in ANY_ITEMS.values()]
    anchors = [summary.anchor(title) for title in titles]
    assert len(set(anchors)) == len(titles)
    assert summary.anchor("The open ZoneEnv (`PointLtl2-v0`): one agent") == "the-open-zoneenv-pointltl2-v0-one-agent"


def test_prompt_and_speed_are_those_that_are_stored(tmp_path):
    def aim(**times):
        of = {"quantiles": [0.5, 1.0], "counted": 40, **times}
        content = {"results": {"results/any/any-zones": of}, "settings": {"aim_ms": 5.0}}
        (tmp_path / typed.FILE).write_text(json.dumps(content))
        return summary.prompt(tmp_path)[0][1:]

    some_late = "**not reached** by every formula: 2 of 40 took longer, the slowest 196.8"
    assert aim(action_ms=[1.5, 196.8], late=2) == ("under 5", "median 1.5 (any-zones)", some_late)
    assert aim(action_ms=[1.5, 4.9], late=0)[-1] == "reached"
    assert aim(action_ms=[6.0, 7.0], late=30)[-1].startswith("**not reached**") and summary.speed(tmp_path) == []
    row = {"part": "environments", "size": "8 at once", "unit": "steps/s", "slowest": 1.0, "fastest": 2e9}
    rows = [row | {"what": "letterworld, grid", "rate": 2e8}, row | {"what": "flatworld, steps", "rate": 9e7}]
    content = {"version": 1, "where": {}, "settings": {}, "rows": rows}
    (tmp_path / summary.BENCHMARK).write_text(json.dumps(content))
    assert [aim[2:] for aim in summary.speed(tmp_path)] == [
        ("200 million (8 at once)", "reached"),
        ("90 million (8 at once)", "**not reached**"),
    ]


def test_verdicts_are_counted():
    assert cells(summary.summary({}, RESULTS))["[prompt](usage.md)"][1] == "under 5"
    assert summary._counted(["reached", "reached, but", "**not reached**"]) == (
        "Of the 3 lines of this table 2 say reached, 1 of these with a reservation beside it."
    )
    assert summary._counted(["reached"]) == "Of the 1 lines of this table 1 say reached."
