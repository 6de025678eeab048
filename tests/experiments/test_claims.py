"""What becomes of claims: their direction, their correction, what is left out, and the cells beside them."""

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.reproduction import claims
from experiments.reproduction.cells import median_frames
from experiments.reproduction.claims import differences, majorities
from experiments.reproduction.stored import Stored
from tests.made_up_runs import write

PAIRS = [("a", "b"), ("b", "c"), ("a", "c")]
NEAR = np.array([0.0, 0.01, 0.02, 0.03])


@pytest.fixture
def runs(tmp_path, monkeypatch) -> dict[str, Stored]:
    """Runs whose seeds are nothing but random numbers."""
    monkeypatch.setattr(claims, "worlds", lambda config, seeds: None)
    monkeypatch.setattr(Stored, "config", SimpleNamespace(frames=1000))
    return {name: Stored(write_status(tmp_path / name)) for name in "abc"}


def write_status(folder):
    folder.mkdir()
    (folder / "status.json").write_text('{"seeds": [0, 1, 2, 3]}')
    return folder


def by_seed(centre):
    return dict(enumerate((centre + NEAR).tolist()))


VALUES = {"a": by_seed(3), "b": by_seed(1), "c": by_seed(1)}


def outcomes(text):
    """The last cell of every row, by its first one."""
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {row[0]: row[-1] for row in rows[1:]}


def test_claims_are_reproduced_or_not_or_undecided(runs):
    found = outcomes(differences(runs, PAIRS, VALUES, "x", PAIRS))
    assert found == {"a > b": "reproduced", "b > c": "undecided", "a > c": "reproduced"}
    turned = [("b", "a")]
    assert outcomes(differences(runs, turned, VALUES, "x", turned)) == {"b > a": "not reproduced"}


def test_where_less_is_better_the_difference_is_how_much_less(runs):
    text = differences(runs, PAIRS, VALUES, "steps", PAIRS, less=True)
    assert outcomes(text)["a < b"] == "not reproduced"
    assert "| how much less: steps |" in text and "| a < b | -2.000 [" in text
    assert outcomes(differences(runs, [("c", "a")], VALUES, "steps", [("c", "a")], less=True)) == {
        "c < a": "reproduced"
    }


def test_pairs_that_are_not_claimed_count_and_have_no_outcome(runs):
    text = differences(runs, PAIRS, VALUES, "x", [("a", "b")])
    assert outcomes(text) == {"a > b": "reproduced", "b - c": "not claimed", "a - c": "not claimed"}
    assert text.endswith("Corrected for 3 comparisons.")
    assert "outcome" not in differences(runs, PAIRS, VALUES, "x")
    with pytest.raises(ValueError, match="not among them"):
        differences(runs, PAIRS, VALUES, "x", [("b", "a")])


def test_missing_runs_are_counted_and_seeds_without_a_value_named(runs):
    values = VALUES | {"b": {**by_seed(1), 3: float("nan")}}
    text = differences({name: runs[name] for name in "ab"}, PAIRS, values, "x", PAIRS)
    assert outcomes(text) == {"a > b": "reproduced"}
    assert text.endswith(
        "Corrected for 3 comparisons, 1 of which can be made so far. Seeds left out, of which this is not known: "
        "b 1 of 4."
    )
    assert differences({"a": runs["a"]}, PAIRS, values, "x", PAIRS) == ""
    assert differences({}, PAIRS, {}, "x", PAIRS) == ""


def test_majorities_are_against_one_half_and_corrected():
    shares = {"all": (1.0, 12), "most": (0.75, 12), "none": (0.0, 12), "not read": None, "no seed": (0.0, 0)}
    text = majorities(shares)
    assert outcomes(text) == {"all": "reproduced", "most": "undecided", "none": "not reproduced"}
    assert text.endswith("Corrected for 5 comparisons, 3 of which can be made so far.")
    assert outcomes(majorities({"most": (0.8, 40)})) == {"most": "reproduced"}
    assert majorities({"not read": None}) == ""


def test_median_of_frames_counts_seeds_that_never_get_there():
    twelve = [k * 1e6 for k in range(1, 10)] + [np.inf] * 3
    assert median_frames(twelve) == "6.50 M [3.00 M, never]"  # third and third last: 96 % by the binomial distribution
    assert median_frames([np.inf] * 12) == "never [never, never]"
    assert median_frames([1e6, 2e6, 3e6]) == "2.00 M" and median_frames([]) == "-"


def test_paired_runs_are_compared_seed_by_seed(tmp_path):
    """Maps differ by seed in WaterWorld; the spread over maps then does not hide a difference."""
    from experiments.reproduction.runs import all_runs

    config = all_runs()["water-rm"].config
    pair = {name: write(tmp_path / name, config) for name in ("x", "y")}
    spread = np.array([0.0, 1.0, 2.0, 3.0])
    values = {"x": dict(enumerate(spread + 0.1 + NEAR / 10)), "y": dict(enumerate(spread))}
    text = differences(pair, [("x", "y")], values, "x", [("x", "y")])
    assert outcomes(text) == {"x > y": "reproduced"} and "paired" in text
