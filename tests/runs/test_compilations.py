"""How many programs a training compiles: one that trains, one that scores, and nothing once it is under way."""

from dataclasses import replace

import pytest
from jax import monitoring

import t2tl_jax
from t2tl_jax.runs.config import SelectionConfig
from tests.fake_learner import CONFIG


@pytest.fixture
def compiled():
    """Grows by one with every program that is compiled, or taken from the cache."""
    seen, listening = [], [True]

    def listen(event, seconds, **about):
        if listening[0] and event.endswith("/backend_compile_duration"):
            seen.append(about.get("fun_name"))

    monitoring.register_event_duration_secs_listener(listen)
    yield seen
    listening[0] = False  # JAX has no public way to take a listener back


@pytest.mark.slow
@pytest.mark.parametrize("seeds", ["3", "3,5,8"])
def test_a_training_compiles_one_program_and_one_more_to_score(compiled, tmp_path, seeds):
    counts = []

    class Count(t2tl_jax.Callback):
        def on_iteration(self, progress, rows):
            counts.append(len(compiled))

    config = replace(CONFIG, selection=SelectionConfig(points=2, episodes=2), frames=2000, pretrained="", seeds=seeds)
    config = replace(config, run=replace(config.run, checkpoint_period=0, seeds_at_once=0))  # a checkpoint each time
    result = t2tl_jax.train(config, folder=tmp_path / "run", callbacks=[Count()])
    assert result.ended == "complete" and len(counts) == 20
    # What scores compiles beside the training, on the way to the first point; nothing else does after the start.
    assert counts[0] >= 1 and counts[-1] - counts[0] <= 1 and len(compiled) == counts[-1], compiled
    assert sum("iterate" in str(name) for name in compiled) == 1, compiled
