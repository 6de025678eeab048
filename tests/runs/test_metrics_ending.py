"""Averages over the end of a training: every finished episode counts once."""

import numpy as np
import pytest

from t2tl_jax.runs.metrics_file import area, ending, history

HEADER = (
    "iteration,frames,seed,episodes,success_rate,violation_rate,timeout_rate,discounted_return,length,success_length"
)


@pytest.fixture
def metrics(tmp_path):
    """Two seeds, four iterations; seed 1 finishes no episode in the last one."""
    lines = [HEADER]
    for iteration in range(1, 5):
        lines.append(f"{iteration},{iteration * 10},0,{iteration},{iteration / 4},0,0,{iteration / 10},5,5")
        lines.append(f"{iteration},{iteration * 10},1," + ("0,,,,,," if iteration == 4 else "2,1.0,0,0,0.5,5,5"))
    path = tmp_path / "metrics.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_last_iterations_are_averaged_over_episodes(metrics):
    end = ending(history(metrics), last=0.5)
    np.testing.assert_allclose(end["success_rate"], [(3 * 0.75 + 4 * 1.0) / 7, 1.0])
    np.testing.assert_allclose(end["discounted_return"], [(3 * 0.3 + 4 * 0.4) / 7, 0.5])


def test_at_least_one_iteration_is_averaged(metrics):
    end = ending(history(metrics), last=0.01)
    for values, of_first in ((end["success_rate"], 1.0), (end["discounted_return"], 0.4), (end["length"], 5.0)):
        np.testing.assert_allclose(values, [of_first, np.nan])  # no episode of seed 1 ended


@pytest.mark.parametrize("cut", [len("4,40,1,0,,,,,,\n"), len(",,,,,\n")])
def test_a_seed_without_its_last_row_counts_with_those_before(metrics, cut):
    metrics.write_text(metrics.read_text()[:-cut])
    np.testing.assert_allclose(ending(history(metrics), last=0.5)["discounted_return"], [(3 * 0.3 + 4 * 0.4) / 7, 0.5])


def test_area_fills_iterations_without_an_ended_episode():
    values = np.array([[np.nan, 0.2, np.nan, 0.6], [1.0, 1.0, 1.0, 1.0], [np.nan] * 4])
    np.testing.assert_allclose(area(values), [(0.0 + 0.2 + 0.2 + 0.6) / 4, 1.0, 0.0])
