"""What a checkpoint says of itself is checked before it is used."""

import pytest

from t2tl_jax.runs.checkpoint_info import problem
from t2tl_jax.runs.host_arrays import checksum

SOUND = {
    "seeds": [0, 1],
    "frames": 200,
    "best": None,
    "selection": {"iteration": [1, 2], "discounted_return": [0.5, 1], "success_rate": [0.0, 1.0]},
    "rows": {"stride": 4, "last": 4, "count": 1, "sums": {"more/x": [1.0]}},
    "width": 2,
    "faults": {"1": {"iteration": 3}},
    "stored": {"checksums": {"state": [1]}, "replay": "", "iteration": 5},
}


def written(**changed):
    info = SOUND | changed
    return {**info, "checksum": checksum(info)}


def test_what_was_written_is_sound():
    assert problem(written(), 5) == ""
    assert problem({"seeds": [0]}, 5) == ""  # early versions wrote no checksum


@pytest.mark.parametrize(
    ("info", "said"),
    [
        ([], "no object"),
        ({}, "checksum is missing"),
        (SOUND, "checksum is missing"),
        ({**written(), "frames": 100}, "not what was written"),
        (written(seeds=5), "expected list @ info.seeds"),
        (written(seeds=[0, True]), "expected int @ info.seeds[1]"),
        (written(rows=5), "not int) @ info.rows"),
        (written(rows={"stride": 4, "count": 4, "sums": {"more/x": [1.0]}}), "'rows' contradicts itself"),
        (written(rows={"stride": 4, "count": 1, "sums": {}}), "'rows' contradicts itself"),
        (written(selection="x"), "not str) @ info.selection"),
        (written(selection={"iteration": [1]}), "missing @ info.selection.discounted_return"),
        (written(faults=5), "expected a mapping @ info.faults"),
        (written(faults={"1": {}}), "missing @ info.faults['1'].iteration"),
        (written(stored={"checksums": 5}), "expected a mapping @ info.stored.checksums"),
        (written(stored={"iteration": 4}), "as that of iteration 4"),
    ],
)
def test_what_is_not_is_told(info, said):
    assert said in problem(info, 5)
