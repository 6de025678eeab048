"""Runs of very many iterations: a row stands for several, by a stated rule, and stopping within one changes nothing."""

import time
from dataclasses import replace

import numpy as np
import pytest

import t2tl_jax
from t2tl_jax import Callback
from t2tl_jax.registry import named_config
from t2tl_jax.runs import thinning
from t2tl_jax.runs.metrics_file import MetricsFile, history, lines_up_to
from t2tl_jax.runs.rows import make_rows
from t2tl_jax.runs.thinning import Thinning, stride
from t2tl_jax.training.types import EpisodeTotals, Metrics

SEEDS = (3, 8)


def metrics_of(iteration):
    """Of two seeds; in every third iteration the second one ends no episode."""
    rng = np.random.default_rng(iteration)
    ended = np.array([4, 0 if iteration % 3 == 0 else 2])
    names = ("successes", "violations", "timeouts", "env_terminations")
    names += ("discounted_return", "total_reward", "length", "success_length")
    totals = {name: (rng.random(2) * ended).astype(np.float32) for name in names[4:]}
    counts = {name: rng.integers(0, 3, 2) * (ended > 0) for name in names[:4]}
    return Metrics(EpisodeTotals(episodes=ended, **counts, **totals), {"loss": rng.random(2).astype(np.float32)})


@pytest.mark.parametrize(("iterations", "seeds"), [(1, 1), (1250, 12), (1_250_000, 12), (152_588, 1000), (10**9, 1)])
def test_a_file_has_a_million_rows_at_most_and_half_as_many_where_it_is_thinned(iterations, seeds):
    step = stride(iterations, seeds)
    rows = -(-iterations // step) * seeds
    assert rows <= thinning.MOST_ROWS and (step == 1 or 2 * rows > thinning.MOST_ROWS - seeds)


def test_a_row_is_what_its_iterations_come_to(monkeypatch):
    """Against sums in a loop, and a training that stops and goes on in the middle of a row."""
    monkeypatch.setattr(thinning, "MOST_ROWS", 6)
    whole, rows = Thinning(11, SEEDS), []
    assert whole.stride == 4
    resumed = Thinning(11, SEEDS)
    for iteration in range(1, 12):
        at, given = (iteration, iteration * 100), metrics_of(iteration)
        one = make_rows(given, *at, SEEDS)
        row, again = (of.add(one, *at, given, {}) for of in (whole, resumed))
        assert (row is None) == (iteration % 4 != 0) == (again is None)
        if row is not None:
            rows.append(row)
            assert list(row) == list(again)
        resumed = Thinning(11, SEEDS, resumed.info())
    rows.append(whole.flush(11, 1100))
    assert whole.flush(11, 1100) is None and whole.last == 11
    for row, block in zip(rows, ((1, 2, 3, 4), (5, 6, 7, 8), (9, 10, 11)), strict=True):
        parts = [metrics_of(iteration) for iteration in block]
        for k in range(2):
            ended = sum(part.episodes.episodes[k] for part in parts)
            length = sum(float(part.episodes.length[k]) for part in parts)
            assert row[k]["episodes"] == ended and row[k]["iteration"] == block[-1] and row[k]["seed"] == SEEDS[k]
            assert row[k]["length"] == (pytest.approx(length / ended) if ended else None)
            assert row[k]["loss"] == pytest.approx(np.mean([part.scalars["loss"][k] for part in parts]))


class StopAt(Callback):
    def __init__(self, iteration):
        self.iteration, self.seen = iteration, []

    def on_iteration(self, progress, rows):
        self.seen.append((progress.done, rows[0]["iteration"]))
        if progress.done == self.iteration:
            progress.stop = "enough"


@pytest.mark.slow
def test_a_thinned_run_that_stops_in_a_row_ends_as_one_that_does_not(tmp_path, monkeypatch):
    monkeypatch.setattr(thinning, "MOST_ROWS", 8)
    config = replace(named_config("fake"), frames=1100, seeds="2")
    whole = t2tl_jax.train(config, folder=tmp_path / "whole")
    watch = StopAt(6)
    t2tl_jax.train(config, folder=tmp_path / "stopped", callbacks=[watch])
    assert watch.seen == [(k, k) for k in range(1, 7)]  # a callback sees every iteration
    resumed = t2tl_jax.resume(tmp_path / "stopped")
    assert (tmp_path / "stopped" / "metrics.csv").read_bytes() == (tmp_path / "whole" / "metrics.csv").read_bytes()
    assert resumed.metrics["frames"].tolist() == whole.metrics["frames"].tolist() == [[400, 800, 1100]] * 2
    info = "checkpoints/11/info/metadata"
    assert (tmp_path / "stopped" / info).read_bytes() == (tmp_path / "whole" / info).read_bytes()


@pytest.mark.slow
def test_a_thousand_seeds_are_written_and_read_quickly(tmp_path):
    """20 ms of processor time for an iteration of all seeds, where 4 were measured; reading takes seconds at most."""
    seeds, iterations = tuple(range(1000)), 20
    totals = {name: np.ones(1000, np.float32) for name in EpisodeTotals.__dataclass_fields__}
    scalars = np.random.default_rng(0).random((10, 1000), np.float32)
    given = Metrics(EpisodeTotals(**totals), {f"scalar_{k}": values for k, values in enumerate(scalars)})
    file = MetricsFile(tmp_path / "metrics.csv")
    begin = time.process_time()
    for iteration in range(1, iterations + 1):
        file.append(make_rows(given, iteration, 10 * iteration, seeds))
    file.close()
    assert (time.process_time() - begin) / iterations < 0.02
    begin = time.process_time()
    curves = history(tmp_path / "metrics.csv")
    assert curves["scalar_3"].shape == (1000, iterations) and time.process_time() - begin < 2
    assert len(lines_up_to(tmp_path / "metrics.csv", 7)) == 1 + 7000
