import numpy as np
import pytest
from scipy import stats

from t2tl_jax.evaluation.statistics import (
    band,
    brackets,
    exact_rate,
    interquartile_mean,
    mean,
    mean_rate,
    rate,
    score_interval,
    two_way_mean,
)


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


@pytest.mark.slow
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
    for values in ([[0.0, 1.0], [1.0, 0.0]], [[0.3, 0.3], [0.3, 0.1 + 0.2]]):
        assert two_way_mean(np.array(values)).low is None  # means of seeds and of formulas that are all equal


def test_no_interval_looks_empty():
    assert mean([7.31, 7.33, 7.35]).text(0) == "7.3 [7.3, 7.4]" and mean([7.3, 8.3, 9.3]).text(0) == "8 [6, 11]"
    assert mean([1.0, 0.9998, 1.0], highest=1.0).text() == "0.9999 [0.9996, 1.0000]"
    assert mean([-0.0001, 0.0002, -0.0003]).text() == "0.000 [-0.001, 0.001]"  # no minus before a zero
    assert mean([1.0, 1.0 + 1e-14]).text() == "1.000"  # equal but for rounding
    assert brackets(0.9996, 1.0) == "[0.9996, 1.0000]" and brackets(-0.0001, 0.2) == "[0.000, 0.200]"


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


def test_band_of_shares_is_wilsons_and_stays_within_them():
    values = np.array([[1.0, 0.0, 0.5, np.nan], [1.0 + 1e-9, 0.0, 1.0, 0.25]])
    centre, low, high = band(values, shares=True)
    assert high[0] == 1 and low[1] == 0 and 0 < low[0] < 1
    assert (low[2], high[2]) == pytest.approx((0.198, 0.973), abs=1e-3)
    assert centre[3] == low[3] == high[3] == 0.25
    with pytest.raises(ValueError, match="between 0 and 1"):
        band(values + 1, shares=True)


def test_band_leaves_gaps_out():
    values = np.array([[1.0, np.nan, np.nan], [3.0, 5.0, np.nan]])
    centre, low, high = band(values)
    np.testing.assert_allclose(centre, [2.0, 5.0, np.nan])
    np.testing.assert_allclose((low[1], high[1]), 5.0)
    assert np.isnan(low[2]) and np.isnan(high[2])


def test_exact_intervals_are_those_of_clopper_and_pearson():
    one = exact_rate(18, 20)
    assert (one.low, one.high) == pytest.approx((stats.beta.ppf(0.025, 18, 3), stats.beta.ppf(0.975, 19, 2)))
    assert exact_rate(20, 20).high == 1.0 and exact_rate(20, 20).low == pytest.approx(0.025 ** (1 / 20))
    five = exact_rate(18, 20, intervals=5)
    assert (five.low, five.high) == pytest.approx((stats.beta.ppf(0.005, 18, 3), stats.beta.ppf(0.995, 19, 2)))
    for wrong in ((21, 20), (0, 0)):
        with pytest.raises(ValueError, match="an exact rate needs"):
            exact_rate(*wrong)


def test_both_factors_of_a_two_way_mean_count():
    seeds, tasks = np.array([0.0, 1.0, 5.0]), np.array([0.0, 2.0, 3.0, 7.0])
    values = seeds[:, None] + tasks
    estimate = two_way_mean(values)
    half = stats.t.ppf(0.975, 2) * np.sqrt(stats.sem(seeds) ** 2 + stats.sem(tasks) ** 2)
    assert estimate.value == values.mean() and estimate.high - estimate.value == pytest.approx(half)
    np.testing.assert_allclose(two_way_mean(values.T).high, estimate.high)
    assert two_way_mean(values, lowest=3.0, highest=6.0).low == 3.0
    values[0, 0] = np.nan
    assert two_way_mean(values).value == pytest.approx(np.nanmean(values)) and two_way_mean(values).count == 11
    for without in (values[:1], values[:, 1:2], np.ones((3, 4))):
        assert two_way_mean(without).low is None


def test_two_way_intervals_cover_at_least_as_often_as_they_say():
    rng = np.random.default_rng(0)

    def drawn(of_seeds, of_tasks):
        noise = rng.normal(size=(5, 8))
        return two_way_mean(of_seeds * rng.normal(size=(5, 1)) + of_tasks * rng.normal(size=(1, 8)) + noise)

    for scales in ((0.0, 0.0), (2.0, 0.5), (0.5, 2.0)):
        hits = sum(one.low < 0 < one.high for one in (drawn(*scales) for _ in range(1000)))
        assert stats.binomtest(hits, 1000, 0.95, alternative="less").pvalue > 0.001
