"""When a task counts as solved: by the whole curve and iteration by iteration alike."""

import numpy as np
import pytest

from t2tl_jax import Config, EnvConfig, PPOConfig
from t2tl_jax.runs.success import SuccessWatch, success_since, window

NAN = np.nan


@pytest.mark.parametrize(
    ("curve", "since"),
    [
        ([1.0] * 5, 1),
        ([1.0] * 4, 0),  # too few to believe it
        ([0.2, 0.96, 0.97, 1.0, 0.99, 0.96], 2),
        ([0.2, 0.95, 1.0, 1.0, 1.0, 1.0, 1.0], 3),  # 95 % itself is not above it
        ([1.0, 1.0, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0], 4),  # a relapse
        ([1.0] * 6 + [0.9], 0),
        ([NAN, 1.0, NAN, 1.0, 1.0, NAN, 1.0, 1.0], 2),  # no episode ended: neither counts nor breaks the series
        ([NAN] * 8, 0),
        ([], 0),
    ],
)
def test_since_when(curve, since):
    rates = np.array([curve, [0.0] * len(curve)])
    assert success_since(rates, 5).tolist() == [since, 0]
    watch = SuccessWatch(2, 5)
    for column in rates.T:
        watch.add([{"success_rate": None if np.isnan(rate) else rate} for rate in column])
    assert watch.since.tolist() == [since, 0] and not watch.all
    assert SuccessWatch(2, 5, rates).since.tolist() == [since, 0]
    assert SuccessWatch(1, 5, rates[:1]).all == (since > 0)


def test_a_resumed_watch_goes_on_where_it_stood():
    rates = np.random.default_rng(0).choice([0.9, 0.97, 1.0, NAN], p=[0.05, 0.45, 0.4, 0.1], size=(50, 40))
    whole = SuccessWatch(50, 5, rates)
    half = SuccessWatch(50, 5, rates[:, :17])
    for column in rates[:, 17:].T:
        half.add([{"success_rate": None if np.isnan(rate) else rate} for rate in column])
    np.testing.assert_array_equal(half.since, whole.since)
    np.testing.assert_array_equal(whole.since, success_since(rates, 5))
    assert 0 < (whole.since > 0).sum() < 50


@pytest.mark.parametrize(("episode_length", "iterations"), [(10, 5), (320, 5), (321, 6), (1000, 16)])
def test_the_window_is_as_long_as_an_episode_can_be(episode_length, iterations):
    learner = PPOConfig(unroll_length=64)
    config = Config(env=EnvConfig(), task="F a", learner=learner, episode_length=episode_length)
    assert window(config) == iterations
