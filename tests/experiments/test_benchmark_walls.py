"""How far the walls are from the original's: what is written is what was measured, and can be measured again."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from experiments.benchmarks import walls

ROOT = Path(__file__).parents[2]
STORED = json.loads((ROOT / "results/walls.json").read_text(encoding="utf-8"))
TRIPLE = re.compile(r"([\d.]+ / [\d.]+) mm, ([\d.]+ / [\d.]+) m/s, ([\d.]+ / [\d.]+) rad/s")
ONE, THREE, TWENTY, CLOSED = "mjx, 1 Newton", "mjx, 3 Newton", "mjx, 20 Newton", "closed form"


def row(results, physics, wall="touched"):
    return next(r for r in results if r["physics"] == physics and r["wall"] == wall)


def quoted(physics):
    """Median and 95 % of the three quantities, as they are written."""
    spreads = [row(STORED["results"], physics)[quantity] for quantity in walls.QUANTITIES]
    return tuple(
        f"{s['median']:.{digits}f} / {s['p95']:.{digits}f}" for s, digits in zip(spreads, (2, 3, 2), strict=True)
    )


@pytest.mark.parametrize(
    ("file", "physics"),
    [
        ("envs/zones/point.xml", (ONE, THREE)),
        ("envs/zones/point_mjx.py", (ONE,)),
        ("envs/zones/point_closed_form.py", (CLOSED,)),
        ("docs/results.md", (ONE, THREE, TWENTY, CLOSED)),
    ],
)
def test_written_numbers_are_the_measured_ones(file, physics):
    """Every "median / 95 % mm, ... m/s, ... rad/s" of the file, in this order."""
    text = re.sub(r"\s+", " ", (ROOT / file).read_text(encoding="utf-8")).replace(" | ", ", ")
    assert TRIPLE.findall(text) == [quoted(name) for name in physics]


def test_written_intervals_are_the_measured_ones():
    text = (ROOT / "docs/results.md").read_text(encoding="utf-8")
    for physics in (ONE, THREE, TWENTY, CLOSED):
        intervals = [row(STORED["results"], physics)[quantity]["median_interval"] for quantity in walls.QUANTITIES]
        pairs = zip(intervals, (2, 3, 2), strict=True)
        assert ", ".join(f"[{low:.{digits}f}, {high:.{digits}f}]" for (low, high), digits in pairs) + " |" in text
    assert f"{row(STORED['results'], ONE)['states']:,} steps in which the robot touched a wall" in text.replace(
        "\n", " "
    )


def test_what_was_measured_is_known():
    where = STORED["where"]
    assert where["git_modified"] is False and len(where["git_revision"]) == 40
    assert where["command"][:3] == ["python", "-m", "experiments.benchmarks.walls"]
    assert where["packages"]["mujoco"] and STORED["config"]["iterations"] == [1, 3, 20]
    for name in (ONE, THREE, TWENTY, CLOSED):  # without a wall both physics are exact up to float32
        clear = row(STORED["results"], name, "clear")
        assert clear["position_mm"]["p95"] < 1e-3 and clear["velocity_m_s"]["p95"] < 1e-4
        assert clear["turning_rad_s"]["p95"] < 1e-3


def test_three_newton_steps_are_as_good_as_twenty():
    for quantity in walls.QUANTITIES:
        three, twenty = (row(STORED["results"], name)[quantity] for name in (THREE, TWENTY))
        np.testing.assert_allclose([three["median"], three["p95"]], [twenty["median"], twenty["p95"]], rtol=0.05)


@pytest.mark.slow
def test_a_small_sample_is_like_the_stored_one(tmp_path, capsys):
    """Eight other episodes: medians within a factor of two, as episodes differ much and the states of one little."""
    file = tmp_path / "walls.json"
    flags = ["--episodes", "8", "--iterations", "1", "--seed", "5", "--json", str(file)]
    assert walls.main(flags) == 0 and capsys.readouterr().out.count("touched") == 2
    for measured in json.loads(file.read_text())["results"]:
        stored = row(STORED["results"], measured["physics"], measured["wall"])
        for quantity in walls.QUANTITIES if measured["wall"] == "touched" else ():
            assert 0.5 < measured[quantity]["median"] / stored[quantity]["median"] < 2.0, (
                measured["physics"],
                quantity,
            )


def test_summary_resamples_episodes():
    """Two episodes of one value each: every resample is one of them, the other, or both."""
    summary = walls.summary(np.array([0.0] * 5 + [1.0] * 5), np.array([0] * 5 + [1] * 5), seed=0)
    assert (summary["median"], summary["p95"]) == (0.5, 1.0)
    assert summary["median_interval"] == [0.0, 1.0] and summary["p95_interval"] == [0.0, 1.0]


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--episodes", "0"], "episodes must be at least 1, got 0"),
        (["--iterations", "0"], "iterations are numbers of Newton steps, one or more of at least 1, got (0,)"),
        (["--json", "no/such/walls.json"], "there is no folder no/such; make it first"),
        (["--episodes", "1", "--steps", "1"], "the robot touched no wall; drive more or longer episodes"),
        (["--step", "5"], "did you mean '--steps'"),
    ],
)
def test_mistakes_are_explained(flags, said, capsys):
    assert walls.main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and not printed.out
