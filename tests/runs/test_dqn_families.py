"""Double DQN on tasks that change: a run that is interrupted goes on bit for bit, its replay with it.

How a run goes on whose episodes finish with the tasks that they began with does not depend on the learner: see
`test_lessons.py`.
"""

import dataclasses

import jax
import numpy as np
import pytest

import t2tl_jax
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.runs.config import Config, PoolConfig, RunConfig, SelectionConfig
from tests.agents.test_learning_rows import ENV, LEARNER
from tests.fake_runs import StopAfter

NETWORK = QNetworkConfig(LookaheadConfig(4), state_layers=(), task_layer=8, head="bilinear", dueling=False)
CONFIG = Config(
    env=t2tl_jax.EnvConfig(), task="Until_1_2_1_1",
    learner=dataclasses.replace(LEARNER, network=NETWORK, unroll_length=5),
    pool=PoolConfig(size=4, rows=24, length=14, period=2), random_starts=0.3, frames=240,
    episode_length=10, selection=SelectionConfig(points=0), run=RunConfig(evaluation_episodes=0, gif=False),
)  # fmt: skip


@pytest.mark.slow
def test_a_resumed_run_over_pools_is_the_uninterrupted_one(tmp_path, begins_quickly):
    """Six iterations in three pools; it is stopped in the middle of the second one."""
    named = {field.name: getattr(CONFIG, field.name) for field in dataclasses.fields(Config) if field.name != "env"}
    whole = t2tl_jax.train(ENV, folder=tmp_path / "whole", **named)
    part = t2tl_jax.train(ENV, folder=tmp_path / "part", callbacks=[StopAfter(3)], **named)
    assert part.iteration == 3 and part.ended == "enough"
    resumed = t2tl_jax.resume(tmp_path / "part", env=ENV)
    assert resumed.iteration == whole.iteration == 6
    jax.tree.map(np.testing.assert_array_equal, resumed.params["final"], whole.params["final"])
    assert (tmp_path / "part" / "metrics.csv").read_text() == (tmp_path / "whole" / "metrics.csv").read_text()
    moved = jax.tree.map(lambda a, b: float(np.abs(a - b).max()), whole.params["final"], part.params["final"])
    assert max(jax.tree.leaves(moved)) > 0
