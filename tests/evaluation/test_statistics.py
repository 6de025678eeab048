import numpy as np
import pytest
from scipy import stats

from t2tl_jax.evaluation.statistics import band, interquartile_mean, mean, mean_rate, rate, score_interval


def test_wilson_against_its_formula():
    z, hits, n = stats.norm.ppf(0.975), 18, 20
    p = hits / n
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    estimate = rate(hits, n)
    assert (estimate.low, estimate.high) == pytest.approx((centre - half, centre + half))
    assert rate(20, 20).high == 1.0 and rate(20, 20).low > 0.8
    assert rate(0, 0).text() == "-"
    with pytest.raises(ValueError, match="21 of 20"):
        rate(21, 20)


def test_t_interval_by_hand():
    estimate = mean([1.0, 2.0, 3.0])
    assert estimate.value == 2.0
    assert estimate.high == pytest.approx(2.0 + 4.302653 / np.sqrt(3))
    assert mean([1.0, 2.0, 3.0], lowest=0.5).low == 0.5
    assert mean([4.0]).text() == "4.000"
    assert mean([]).value is None


def test_t_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(0)
    hits = sum(e.low < 0 < e.high for e in (mean(rng.normal(size=6)) for _ in range(2000)))
    assert stats.binomtest(hits, 2000, 0.95).pvalue > 0.001


def test_no_interval_has_zero_width():
    assert mean([124.0] * 100).text(1) == "124.0"  # equal values do not say how far others would lie
    sure = mean_rate([1.0] * 12)
    assert sure.value == sure.high == 1.0 and sure.low == pytest.approx(rate(12, 12).low) and sure.low < 0.8
    assert mean_rate([0.5] * 12).low < 0.3 and mean_rate([0.7]).low is None
    assert interquartile_mean([0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0]).low is None
    with pytest.raises(ValueError, match="between 0 and 1"):
        mean_rate([0.5, 1.2])


def test_rates_of_seeds_that_fail_or_not_are_covered():
    """Nine of ten seeds succeed: twelve of them often all do, and a t interval then has no width at all."""
    rng = np.random.default_rng(0)
    draws = np.where(rng.random((2000, 12)) < 0.9, 1.0, 0.2 * rng.random((2000, 12)))
    truth = 0.9 + 0.1 * 0.1
    assert np.mean([e.low < truth < e.high for e in map(mean_rate, draws)]) > 0.93


@pytest.mark.parametrize(("hits", "count"), [(0, 7), (3, 12), (12, 12)])
def test_score_interval_is_wilsons(hits, count):
    expected = stats.binomtest(hits, count).proportion_ci(0.95, method="wilson")
    found = score_interval(hits / count, count)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_interquartile_mean_leaves_out_the_outer_quarters():
    values = [-100.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 100.0]
    estimate = interquartile_mean(values)
    assert estimate.value == 3.5 and estimate.low < 3.5 < estimate.high
    assert interquartile_mean([1.0, 2.0]).text() == "1.500" and interquartile_mean([]).value is None


def test_band_is_the_interval_of_the_mean_at_every_point():
    values = np.random.default_rng(1).normal(size=(12, 3))
    for point, (centre, low, high) in enumerate(zip(*band(values), strict=True)):
        expected = mean(values[:, point])
        assert (centre, low, high) == pytest.approx((expected.value, expected.low, expected.high))


def test_band_leaves_gaps_out():
    values = np.array([[1.0, np.nan, np.nan], [3.0, 5.0, np.nan]])
    centre, low, high = band(values)
    np.testing.assert_allclose(centre, [2.0, 5.0, np.nan])
    np.testing.assert_allclose((low[1], high[1]), 5.0)
    assert np.isnan(low[2]) and np.isnan(high[2])
