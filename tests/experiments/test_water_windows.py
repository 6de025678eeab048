"""The first episodes in WaterWorld by window: cells by hand, and what is concluded from which of them."""

import numpy as np
import pytest

from experiments.reproduction.runs import BEGINNING, SHORTLY
from experiments.reproduction.sections import chance, figures, water_windows
from experiments.reproduction.sections.figures import SOONER_PUBLISHED
from tests.made_up_runs import rows

SHORT = [name for name in BEGINNING if name.endswith("-short-exploration")]
AS_STORED = {
    **{(name, window, 500): -0.02 for name in BEGINNING if name not in SHORT for window in water_windows.WINDOWS},
    **{(name, 500, mark): -0.01 for name in SHORT for mark in (500, 1000)},
}
"""Means that are below the published ones, and by how much, such that the conclusion holds."""


@pytest.fixture
def said(make, monkeypatch):
    """Makes the text of runs whose means are above the published ones by 0.1, but for some."""

    def made(changed, names=BEGINNING):
        def returns_at(run, marks, window):
            name = run.path.name
            means = [SOONER_PUBLISHED[name][k] + changed.get((name, window, mark), 0.1) for k, mark in enumerate(marks)]
            return np.array(means) + np.array([[-0.03], [0.0], [0.03]])

        monkeypatch.setattr(water_windows, "returns_at", returns_at)
        return water_windows.by_window({name: make(name) for name in names}, SOONER_PUBLISHED)

    return made


def concluded(text):
    return [part for part in text.split("\n\n") if part.startswith(("So from", "Where the last"))]


def test_a_shorter_window_leaves_out_the_start(make):
    """500 episodes in ten iterations, of which the last succeeds."""
    success = np.repeat([0.0, 1.0], [9, 91])
    run = make("water-rm", iterations=100, episodes=50.0, success_rate=[success] * 4, violation_rate=[1 - success] * 4)
    text = water_windows.by_window({"water-rm": run}, SOONER_PUBLISHED)
    at_500 = next(line for line in text.splitlines() if line.startswith("| rm | 500 |"))
    assert at_500 == "| rm | 500 | 1.000 | 0.000 | -0.500 | -0.800 | -0.96 |"
    assert rows(text)["rm"] == ["2,000", "1.000", "1.000", "1.000", "1.000", "-0.43"]
    assert "reached, 0 episodes after it on average and 0 at most" in " ".join(text.split())
    assert concluded(text) == [] and "`short-exploration`, by window" not in text


def test_how_far_behind_the_marks_iterations_end_is_said(make):
    run = make("water-rm", iterations=100, episodes=60.0)  # 540, 1,020, 1,500, 2,040
    text = " ".join(water_windows.by_window({"water-rm": run}, SOONER_PUBLISHED).split())
    assert "25 episodes after it on average and 40 at most" in text


def test_nothing_is_said_of_marks_that_no_run_has_reached(make):
    text = water_windows.by_window({"water-rm": make("water-rm")}, SOONER_PUBLISHED)  # 100 episodes, each a time-out
    assert rows(text)["rm"] == ["2,000", "0.000", "0.000", "-", "-", "-0.43"] and "on average" not in text
    assert water_windows.by_window({}, SOONER_PUBLISHED) == ""


def test_runs_are_named_where_they_are_below(said):
    text = " ".join(said(AS_STORED).split())
    lines = [f"- Window of {window}. Below the published mean at none of these marks." for window in (50, 100, 200)]
    assert all(line in text for line in lines)
    assert (
        "- Window of 500. Below the published mean, which lies in our interval: "
        "water-t1tl-short-exploration at 500, 1,000; water-rm-short-exploration at 500, 1,000." in text
    )
    assert (
        "every one of these windows: water-t1tl at 500; water-t1tl-per-16 at 500; water-rm at 500; water-rm-per-16 at "
        "500." in text
    )
    assert (
        "- At 500 episodes water-rm -0.020, water-rm-per-16 -0.020, water-rm-short-exploration -0.010; "
        "water-rm-short-exploration with windows of 50 and 100 +0.100, +0.100." in text
    )


@pytest.mark.parametrize(
    ("changed", "start"),
    [
        ({}, "So from 1,000 episodes on"),
        ({(SHORT[0], 200, 500): -0.01}, "So from 1,000 episodes on"),
        ({(SHORT[0], 200, 1000): -0.01}, "Where the last"),
        ({(SHORT[1], 100, 500): -0.01}, "Where the last"),
        ({(SHORT[1], 500, 1500): -0.01}, "Where the last"),
        ({(name, 500, 1000): 0.1 for name in SHORT}, "Where the last"),
        ({("water-rm", 50, 500): 0.1}, "Where the last"),
    ],
)
def test_the_conclusion_is_drawn_only_from_what_shows_it(said, changed, start):
    (conclusion,) = concluded(said(AS_STORED | changed))
    assert conclusion.startswith(start)


def test_nothing_is_concluded_while_a_run_is_missing(said):
    assert concluded(said(AS_STORED, BEGINNING[:-1])) == []


def test_other_methods_have_tables_of_their_own(make):
    """Usual runs fail in every episode; those that explore for a short time succeed in all but the first iterations."""
    fails, learns = np.zeros(100), np.repeat([0.0, 1.0], [2, 98])
    runs = {}
    for usual, short in SHORTLY.items():
        for name, success in ((usual, fails), (short, learns)):
            rates = {"success_rate": [success] * 4, "violation_rate": [1 - success] * 4}
            runs[name] = make(name, iterations=100, episodes=100.0, **rates)
    text = chance.water_beginning(runs)
    assert figures.other_beginnings({name: runs[name] for name in SHORTLY}) == ""
    for curve, (method, first) in {"DFA": ("dfa", "-0.96"), "T2TL_pre": ("t2tl", "-0.91")}.items():
        assert f"| episode | {method} | {method}-short-exploration | {curve}, published |" in text
        assert f"| 500 | -1.000 | 0.200 | {first} |" in text
    assert "water-gnn-short-exploration - water-gnn | " in text and "rm" not in text.partition("**Other methods.**")[0]
    flat = " ".join(text.split())
    assert "Below the published mean at none of these marks." in flat and "water-gnn at episodes 500 to 3,000" in flat
