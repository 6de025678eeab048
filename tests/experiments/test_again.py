"""The same training twice, as the page shows it."""

import pytest

from experiments.reproduction import claims
from experiments.reproduction.method_table import method_table
from experiments.reproduction.runs import again_name, all_runs
from experiments.reproduction.sections import again
from tests.made_up_runs import played, rows, write

LIMIT = 600


@pytest.fixture
def twice(tmp_path):
    """Makes both runs of some methods, each with the success of its seeds' final parameters."""

    def made(rates):
        found = {}
        for method, both in rates.items():
            name = f"water-{method}"
            for one, rate in zip((name, again_name(name)), both, strict=True):
                found[one] = write(tmp_path / one, all_runs()[name].config, seeds=(0, 1, 2), evaluated={LIMIT: rate})
        return found

    return made


def test_both_runs_of_a_method_are_one_training_but_for_their_name():
    runs = all_runs()
    for first, second in again.PAIRS:
        assert runs[first] == runs[second]


def test_how_far_solved_seeds_are_apart_is_said_of_those_that_differ_most(twice):
    said = again.once_more(
        twice({"rm": (played(1.0, 50.0), played(1.0, 50.0)), "dfa": (played(1.0, 50.0), played(0.2, 9.0))})
    )
    said = " ".join(said.split())
    assert "Solved seeds are apart by 0 to 3 of 3, most for dfa (3 and 0). Equal returns in training: rm, dfa." in said
    assert "| water-rm-again |" in said and "water-t1tl" not in said


def test_outcomes_that_the_second_runs_flip_are_listed(monkeypatch, twice):
    runs = twice({name: (played(1.0, 50.0), played(1.0, 50.0)) for name in ("t1tl", "gnn")})
    values = {"water-t1tl": 2.0, "water-gnn": 1.0, "water-t1tl-again": 1.0, "water-gnn-again": 2.0}
    score = {name: {seed: value + 0.01 * seed for seed in range(3)} for name, value in values.items()}
    monkeypatch.setattr(again, "mean_return_at", lambda run, marks: score[run.path.name])
    monkeypatch.setattr(claims, "worlds", lambda config, seeds: None)
    said = " ".join(again.once_more(runs).split())
    assert "water-t1tl > water-gnn (reproduced, with the second runs not reproduced)." in said


def test_nothing_is_shown_of_a_method_that_was_trained_once(twice):
    runs = twice({"rm": (played(1.0, 50.0), played(1.0, 50.0))})
    assert again.once_more({"water-rm": runs["water-rm"]}) == ""


def test_the_table_of_methods_shows_both_runs(twice):
    runs = twice({"rm": (played(1.0, 50.0), played([1.0, 0.2, 0.1], 50.0)), "dfa": (played(0.2, 9.0),) * 2})
    del runs["water-dfa-again"]
    shown = rows(method_table(runs, ("rm", "dfa", "gnn")))
    assert [shown[f"`{name}`"][-1] for name in ("rm", "dfa", "gnn")] == ["3/3, again 1/3", "0/3", "-"]


def test_a_second_run_does_not_stand_for_a_first_one(twice):
    runs = twice({"rm": (played(1.0, 50.0), played(1.0, 50.0))})
    del runs["water-rm"]
    assert rows(method_table(runs, ("rm",)))["`rm`"][-1] == "-, again 3/3"
