"""What stands in ``status.json`` is of the form that a training writes, or refused with its place."""

import json
from pathlib import Path

import pytest

from t2tl_jax.errors import UserError
from t2tl_jax.runs import status_form
from t2tl_jax.runs.folder import RunFolder

ROOT = Path(__file__).parents[2]
PRETRAINING = {
    **{"folder": None, "task": "F a", "frames_per_seed": 100, "training_seconds": 1.5},
    **{"success_rate": [0.5, None], "discounted_return": [0.5, None], "length": [3.0, None]},
}
SOUND = {
    "state": "finished",
    "seeds": [0, 1],
    "all_sessions": {"training_seconds": 3.5},
    "pretraining": PRETRAINING,
    "faults": {"1": {"iteration": 3, "frames": 300, "fault": "LOSS", "cause": "words"}},
    "alone": True,
    "success_since_frames": None,  # of a run that was stopped before its first iteration was over
}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"pretraining": 3}, "pretraining should be an object, got 3"),
        ({"pretraining": {}}, "pretraining lacks folder"),
        ({"pretraining": PRETRAINING | {"length": [0.5, "much"]}}, "pretraining.length[1] should be a number or null"),
        ({"iteration": 10**400}, "iteration should be a number, got 1000"),
        ({"all_sessions": None}, "all_sessions should be an object, got None"),
        (
            {"all_sessions": {"training_seconds": "long"}},
            "all_sessions.training_seconds should be a number, got 'long'",
        ),
        ({"seeds": [True]}, "seeds[0] should be a number, got True"),
        ({"faults": {"1": []}}, "faults.1 should be an object, got []"),
        ({"state": 1}, "state should be a text, got 1"),
    ],
)
def test_what_is_of_another_form_is_refused_with_its_place(tmp_path, change, said):
    folder = RunFolder(tmp_path)
    folder.status.write_text(json.dumps(SOUND))
    assert status_form.read(folder) == SOUND
    folder.status.write_text(json.dumps(SOUND | change))
    with pytest.raises(UserError) as refused:
        status_form.read(folder)
    assert f"{folder.status}: {said}" in str(refused.value)


def test_a_run_without_the_file_has_no_status(tmp_path):
    assert status_form.read(RunFolder(tmp_path)) == {}


def test_every_stored_run_has_a_status_of_that_form():
    read = [status_form.read(RunFolder(file.parent)) for file in (ROOT / "results").rglob("status.json")]
    assert len(read) > 200 and all(read)
