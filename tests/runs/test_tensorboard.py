"""Events of few seeds lie apart, those of many as their mean, lowest and highest; later sessions sort behind."""

import numpy as np
import pytest
from tensorboardX.proto.event_pb2 import Event

import tests.fake_learner  # noqa: F401
from t2tl_jax.registry import named_config
from t2tl_jax.runs.callbacks import TrainingProgress
from t2tl_jax.runs.rows import Rows
from t2tl_jax.runs.tensorboard import APART, TensorBoardLogger


def events_in(file):
    """The records of an event file: length, checksum, data, checksum."""
    data, place = file.read_bytes(), 0
    while place < len(data):
        size = int.from_bytes(data[place : place + 8], "little")
        yield Event.FromString(data[place + 12 : place + 12 + size])
        place += size + 16


@pytest.mark.parametrize("count", [2, APART + 1])
def test_events_hold_the_rows(tmp_path, count):
    progress = TrainingProgress(named_config("fake"), tuple(range(count)), 10, 100)
    values = np.arange(count, dtype=np.float64)
    none = np.ma.masked_array(values, [True] * count)
    rows = Rows({"iteration": np.full(count, 4), "seed": np.arange(count), "loss": values, "success_rate": none})
    for done in (0, 3):
        progress.done = done
        logger = TensorBoardLogger(tmp_path)
        logger.on_start(progress)
        progress.done += 1
        logger.on_iteration(progress, rows)
        logger.on_checkpoint(progress)
        logger.on_end(progress)
    of_many = {"mean": (count - 1) / 2, "lowest": 0, "highest": count - 1}
    expected = {"seed_0": 0.0, "seed_1": 1.0} if count == 2 else of_many
    assert {path.name for path in tmp_path.iterdir()} == set(expected)
    for name, value in expected.items():
        first, second = sorted((tmp_path / name).iterdir())
        for file, step in ((first, 1), (second, 4)):
            said = [(event.step, one) for event in events_in(file) for one in event.summary.value]
            assert [(at, one.tag, one.simple_value) for at, one in said] == [(step, "training/loss", value)]
        assert [event.step for event in events_in(second) if event.HasField("session_log")] == [4]
