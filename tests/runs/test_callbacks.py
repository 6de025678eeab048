"""Callbacks of a training: what they are told and when, and what becomes of one that stops it or fails."""

import pytest

import t2tl_jax
from t2tl_jax import Callback
from tests.diary import Diary, run_fake
from tests.fake_agent import FakeConfig

pytestmark = pytest.mark.slow  # they compile a training, if one of a learner that does nothing

FRAMES = FakeConfig().frames_per_iteration


def test_callbacks_see_everything_in_order(tmp_path):
    diary = Diary()
    run_fake([diary], seeds=(3, 8), folder=tmp_path / "run")
    assert diary.entries == [
        ("plan", 3, FRAMES, (3, 8)),
        ("start", 0),
        *(("iteration", number) for number in (1, 2, 3)),
        ("checkpoint", 3),
        ("end", 3, "complete"),
    ]


def test_a_callback_ends_the_training_and_all_of_them_hear_of_it():
    first, second = Diary(stop_at=2), Diary()
    result = run_fake([first, second])
    assert (result.iteration, result.ended) == (2, "enough") and result.metrics["frames"].shape == (2, 2)
    assert first.entries == second.entries and second.entries[-1] == ("end", 2, "enough")


def test_what_a_callback_raises_ends_the_training():
    class Broken(Callback):
        def on_iteration(self, progress, rows):
            raise RuntimeError("the disk of my logger is full")

    diary = Diary()
    with pytest.raises(RuntimeError, match="disk of my logger"):
        run_fake([diary, Broken()])
    assert diary.entries[-1] == ("end", 1, "failed")


def test_a_callback_may_end_it_before_it_begins():
    class Never(Callback):
        def on_plan(self, progress):
            progress.stop = "only asked for the plan"

    diary = Diary()
    with pytest.raises(t2tl_jax.Interrupted, match="only asked for the plan"):
        run_fake([Never(), diary])
    assert [entry[0] for entry in diary.entries] == ["plan", "end"]


def test_every_callback_that_was_planned_is_ended_whatever_others_raise():
    class Broken(Callback):
        def __init__(self, name, of_plan=False):
            self._name, self._of_plan = name, of_plan

        def on_plan(self, progress):
            progress.stop = "only asked for the plan"
            if self._of_plan:
                raise RuntimeError(f"{self._name} has no plan")

        def on_end(self, progress):
            raise RuntimeError(f"{self._name} cannot be closed")

    first, second = Diary(), Diary()
    with pytest.raises(RuntimeError, match="the other cannot be closed") as raised:
        run_fake([Broken("one"), first, Broken("the other"), second])
    assert "one cannot be closed" in str(raised.value.__context__)  # nothing that was raised is lost
    assert [[entry[0] for entry in diary.entries] for diary in (first, second)] == [["plan", "end"]] * 2

    early, late = Diary(), Diary()
    with pytest.raises(RuntimeError, match="it cannot be closed") as raised:
        run_fake([early, Broken("it", of_plan=True), late])
    assert "it has no plan" in str(raised.value.__context__)
    assert [entry[0] for entry in early.entries] == ["plan", "end"] and late.entries == []
