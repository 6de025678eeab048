"""The time of day jumps while a run is trained and resumed: back as a clock that is put right, or ahead."""

import time
from dataclasses import replace

import pytest

import t2tl_jax
import tests.fake_learner  # noqa: F401
from t2tl_jax.registry import named_config

SAME = ("metrics.csv", "checkpoints/5/info/metadata", "checkpoints/4/info/metadata")  # with a checksum of every array


class Clock(t2tl_jax.Callback):
    """Jumps behind the second iteration."""

    def __init__(self, jump, monkeypatch):
        self.ahead, self.jump = 0.0, jump
        now, now_ns = time.time, time.time_ns
        monkeypatch.setattr(time, "time", lambda: now() + self.ahead)
        monkeypatch.setattr(time, "time_ns", lambda: now_ns() + int(self.ahead * 1e9))

    def on_iteration(self, progress, rows):
        if progress.done == 2:
            self.ahead += self.jump


class Stop(t2tl_jax.Callback):
    """Ends the first session behind the third iteration."""

    def on_iteration(self, progress, rows):
        if progress.done == 3:
            progress.stop = "enough"


def trained(folder, *callbacks):
    """A run of five iterations in two sessions, with a checkpoint behind each iteration."""
    config = named_config("fake")
    run = replace(config.run, checkpoint_period=0)
    t2tl_jax.train(config, folder=folder, frames=500, run=run, callbacks=[*callbacks, Stop()])
    return t2tl_jax.resume(folder, callbacks=callbacks)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clock") / "whole"
    trained(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("jump", [-1e8, -3600.0, 3600.0, 1e8], ids=str)
def test_a_clock_that_jumps_changes_nothing(whole, tmp_path, monkeypatch, jump):
    clock = Clock(jump, monkeypatch)
    result = trained(tmp_path / "run", clock)
    assert clock.ahead == jump and result.ended == "complete" and result.iteration == 5
    for name in SAME:
        assert (tmp_path / "run" / name).read_bytes() == (whole / name).read_bytes(), name
    kept = sorted(path.name for path in (whole / "checkpoints").iterdir())
    assert sorted(path.name for path in (tmp_path / "run" / "checkpoints").iterdir()) == kept
