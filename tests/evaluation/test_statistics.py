import numpy as np
import pytest
from scipy import stats

from t2tl_jax.evaluation.statistics import bootstrap_band, difference, mean, rate


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


def test_bootstrap_band_matches_scipy():
    values = np.random.default_rng(1).normal(size=(12, 3))
    centre, low, high = bootstrap_band(values)
    expected = stats.bootstrap((values,), np.mean, axis=0, method="percentile", rng=np.random.default_rng(2))
    np.testing.assert_allclose(centre, values.mean(0))
    np.testing.assert_allclose(low, expected.confidence_interval.low, atol=0.06)
    np.testing.assert_allclose(high, expected.confidence_interval.high, atol=0.06)


def test_bootstrap_band_leaves_gaps_out():
    values = np.array([[1.0, np.nan, np.nan], [3.0, 5.0, np.nan]])
    centre, low, high = bootstrap_band(values)
    np.testing.assert_allclose(centre, [2.0, 5.0, np.nan])
    np.testing.assert_allclose((low[1], high[1]), 5.0)
    assert np.isnan(low[2]) and np.isnan(high[2])


def test_differences_are_tested():
    rng = np.random.default_rng(0)
    low, high = rng.normal(0.5, 0.1, 12), rng.normal(0.8, 0.1, 12)
    gap, p = difference(high, low)
    assert gap.value == pytest.approx(high.mean() - low.mean()) and gap.low > 0 and p < 0.001
    same, p_same = difference(low, rng.normal(0.5, 0.1, 12))
    assert same.low < 0 < same.high and p_same > 0.05
    back, p_back = difference(low, high)
    assert back.value == pytest.approx(-gap.value) and p_back < 0.001
    with pytest.raises(ValueError, match="two seeds"):
        difference([1.0], low)
