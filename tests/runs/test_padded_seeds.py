"""Five seeds on four devices, which train eight: nothing of the three others is left behind."""

from dataclasses import replace

import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from t2tl_jax import load, resume, train
from t2tl_jax.registry import named_config
from t2tl_jax.runs.config import SelectionConfig
from tests.four_devices import run_on_four_devices
from tests.runs.test_stored_runs import restored

CONFIG = replace(
    named_config("fake"), seeds="0,3,4,7,9", frames=400, selection=SelectionConfig(points=2, episodes=2), pretrained=""
)

PROGRAM = """
import sys
import jax
from t2tl_jax import Callback, resume, train
from tests.runs.test_padded_seeds import CONFIG

class Stop(Callback):
    def on_iteration(self, progress, rows):
        assert progress.devices == 4 and len(rows) == 5
        progress.stop = "enough" if progress.done == 2 else ""

assert len(jax.devices()) == 4
whole = train(CONFIG, folder=sys.argv[1] + "/whole")
train(CONFIG, folder=sys.argv[1] + "/stopped", callbacks=[Stop()])
resume(sys.argv[1] + "/stopped")
assert all(leaf.shape[0] == 5 for leaf in jax.tree.leaves((whole.params["final"], whole.params["best"])))
"""


@pytest.mark.slow
def test_filling_up_leaves_no_trace(tmp_path):
    run_on_four_devices(PROGRAM, str(tmp_path))
    spread, stopped = tmp_path / "whole", tmp_path / "stopped"
    for name in ("metrics.csv", "checkpoints/4/info/metadata"):
        assert (spread / name).read_bytes() == (stopped / name).read_bytes()
    alone = train(CONFIG, folder=tmp_path / "alone")  # on one device
    (_, many), (_, one) = restored(spread), restored(tmp_path / "alone")
    np.testing.assert_allclose(many.params["params"]["w"], one.params["params"]["w"], rtol=1e-4, atol=1e-5)
    loaded = load(spread)
    assert loaded.metrics.keys() == alone.metrics.keys()
    for name, values in alone.metrics.items():
        np.testing.assert_allclose(loaded.metrics[name], values, rtol=1e-4, atol=1e-5, err_msg=name)
    assert resume(spread, frames=500).iteration == 5  # goes on where there is but one device
