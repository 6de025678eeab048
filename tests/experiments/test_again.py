"""The same training twice, as the page shows it."""

import pytest

from experiments.reproduction.runs import again_name, all_runs
from experiments.reproduction.sections import again
from tests.made_up_runs import played, write

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
    assert said.endswith("Equal in every seed: rm, dfa. Solved seeds are apart by 0 to 3 of 3, most for dfa: 3 and 0.")
    assert "| water-rm-again |" in said and "water-t1tl" not in said


def test_nothing_is_shown_of_a_method_that_was_trained_once(twice):
    runs = twice({"rm": (played(1.0, 50.0), played(1.0, 50.0))})
    assert again.once_more({"water-rm": runs["water-rm"]}) == ""
