"""The figures of the short schedule in docs/results.md, computed anew from the stored metrics."""

import re
from pathlib import Path

import numpy as np
import pytest

from t2tl_jax.evaluation import statistics
from t2tl_jax.runs.metrics_file import ending, history
from t2tl_jax.runs.success import success_since

ROOT = Path(__file__).parents[2]
SECTION = (ROOT / "docs" / "results.md").read_text(encoding="utf-8").split("## The short schedule")[1]
ROW = re.compile(
    r"\| (?P<solved>\d+)/12 \| (?P<median>[\d.]+)(?: M)? / (?P<last>[\d.]+|-)(?: M)? \| (?P<mean>[\d.]+) "
    r"\[(?P<low>[\d.]+), (?P<high>[\d.]+)\] \| `(?P<run>\w+)` \|"
)
ROWS = {match["run"]: match for match in ROW.finditer(SECTION)}
ITERATIONS_OF_THE_LIMIT = {64: 16, 128: 8}  # by steps of every environment in one iteration


def folder_of(run: str) -> Path:
    return next(
        path for path in (ROOT / "results" / f"zone_{kind}" / run for kind in ("tuning", "short_h200")) if path.is_dir()
    )


def test_every_stored_run_has_its_row():
    stored = {path.name for path in (ROOT / "results" / "zone_tuning").iterdir()}
    assert set(ROWS) == stored | {"t2tl", "t1tl", "t2tl_4", "t1tl_4"}


@pytest.mark.parametrize("run", ROWS)
def test_figures_of_a_row(run):
    curves, row = history(folder_of(run) / "metrics.csv"), ROWS[run]
    frames = curves["frames"][0]
    since = success_since(curves["success_rate"], ITERATIONS_OF_THE_LIMIT[int(frames[0]) // 256])
    reached = np.where(since > 0, since * frames[0] / 1e6, np.inf)
    assert (since > 0).sum() == int(row["solved"]) and len(since) == 12
    assert np.median(reached) == pytest.approx(float(row["median"]), abs=0.011)
    assert (
        row["last"] == "-" if np.isinf(reached).any() else reached.max() == pytest.approx(float(row["last"]), abs=0.006)
    )
    end = statistics.mean(ending(curves, 0.05)["discounted_return"])
    shown = [float(row[name]) for name in ("mean", "low", "high")]
    np.testing.assert_allclose([end.value, end.low, end.high], shown, atol=0.0011)


@pytest.mark.parametrize(
    ("label", "run"),
    [
        ("T1TL, seeds 100 to 111", "t1_base"),
        ("T2TL, seeds 100 to 111", "t2_base"),
        ("T1TL, seeds 24 to 35", "t1tl"),
        ("T2TL, seeds 24 to 35", "t2tl"),
    ],
)
def test_ahead_of_every_published_curve(label, run):
    """The mean over the quarter million frames that ends at each mark."""
    curves = history(folder_of(run) / "metrics.csv")
    frames, returns = curves["frames"][0], curves["discounted_return"]
    shown = re.search(rf"\| {label} \| (.*) \|", SECTION)[1].split(" | ")
    best = re.search(r"\| best published \| (.*) \|", SECTION)[1].split(" | ")
    for mark, value, published in zip((0.5, 1, 1.5, 2, 2.5, 3), shown, best, strict=True):
        part = (frames <= mark * 1e6) & (frames > mark * 1e6 - 250_000)
        measured = np.nanmean(returns[:, part])
        assert measured == pytest.approx(float(value), abs=0.006) and measured > float(published)
