"""A callback that writes down what it is told, and a training that takes no time to tell it of."""

import t2tl_jax
from t2tl_jax import Callback
from t2tl_jax.runs.config import SelectionConfig
from tests.fake_agent import FakeConfig
from tests.probe import ProbeEnv

TASK = "F(Up & F Down)"


class Diary(Callback):
    """Writes down what is called, with what."""

    def __init__(self, stop_at: int = 0) -> None:
        self.entries: list[tuple] = []
        self._stop_at = stop_at

    def on_plan(self, progress):
        self.entries.append(("plan", progress.iterations, progress.frames_per_iteration, progress.seeds))

    def on_start(self, progress):
        assert progress.compile_seconds > 0 and progress.compile_wait_seconds > 0
        self.entries.append(("start", progress.done))

    def on_iteration(self, progress, rows):
        assert [row["seed"] for row in rows] == list(progress.seeds)
        assert {row["iteration"] for row in rows} == {progress.done}
        assert {row["frames"] for row in rows} == {progress.done * progress.frames_per_iteration}
        self.entries.append(("iteration", progress.done))
        if progress.done == self._stop_at:
            progress.stop = "enough"

    def on_checkpoint(self, progress):
        self.entries.append(("checkpoint", progress.done))

    def on_end(self, progress):
        self.entries.append(("end", progress.done, progress.stop))


def run_fake(callbacks=(), **changes):
    """As many iterations of a learner that compiles in an instant, for what does not depend on the learner."""
    nothing = SelectionConfig(points=0)  # its actions are not those of the environment
    return t2tl_jax.train(
        ProbeEnv(),
        TASK,
        FakeConfig(),
        callbacks=callbacks,
        **{"seeds": 2, "frames": 300, "selection": nothing, **changes},
    )
