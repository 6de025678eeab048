"""Differences between runs: they cover, pairs count, tests are corrected, and claims are judged by them."""

import numpy as np
import pytest
from scipy import stats

from t2tl_jax.evaluation import comparisons
from t2tl_jax.evaluation.comparisons import compare, difference, holm, outcome
from t2tl_jax.evaluation.statistics import Estimate

DRAWS = {
    "normal": lambda rng, size: rng.normal(size=size),
    "skewed": lambda rng, size: rng.lognormal(size=size),
    "a seed in five fails": lambda rng, size: (rng.random(size) < 0.8) + 0.02 * rng.normal(size=size),
}


@pytest.mark.parametrize("paired", [False, True])
@pytest.mark.parametrize("count", [4, 12])
@pytest.mark.parametrize("draw", DRAWS.values(), ids=DRAWS)
def test_intervals_cover_the_true_difference(draw, count, paired):
    """A percentile bootstrap covers 84 to 86 % of the time with 4 seeds and 90 to 92 % with 12."""
    rng = np.random.default_rng(0)
    pairs = zip(draw(rng, (500, count)), draw(rng, (500, count)) - 1, strict=True)
    gaps = [comparisons._gap(a, b, paired, 0.95) for a, b in pairs]
    assert np.mean([gap.low < 1 < gap.high for gap in gaps]) >= 0.93


@pytest.mark.parametrize("paired", [False, True])
@pytest.mark.parametrize("draw", DRAWS.values(), ids=DRAWS)
def test_corrected_intervals_cover_the_true_difference(draw, paired):
    """By which orderings are judged: with twelve seeds, and nine comparisons in a table."""
    rng = np.random.default_rng(1)
    pairs = zip(draw(rng, (600, 12)), draw(rng, (600, 12)) - 1, strict=True)
    gaps = [comparisons._gap(a, b, paired, 1 - 0.05 / 9) for a, b in pairs]
    assert np.mean([gap.low < 1 < gap.high for gap in gaps]) >= 1 - 0.05 / 9 - 0.005


@pytest.mark.parametrize(("failing", "least", "most"), [(0.2, 0.9, 0.95), (0.08, 0.55, 0.75)])
def test_intervals_do_not_know_of_failures_that_no_seed_shows(failing, least, most):
    """One run in so many fails, and its rival never does: a dozen seeds often show no failure, and no spread then.

    So the page of results says it of the intervals of means and differences.
    """
    rng, runs, spread = np.random.default_rng(2), 400, 0.013
    first = 0.78 + spread * rng.normal(size=(runs, 12))
    second = np.where(rng.random((runs, 12)) < failing, 0.05, 0.78) + spread * rng.normal(size=(runs, 12))
    truth = failing * (0.78 - 0.05)
    gaps = [comparisons._gap(a, b, False, 0.95) for a, b in zip(first, second, strict=True)]
    assert least < np.mean([gap.low < truth < gap.high for gap in gaps]) < most


def test_differences_are_tested():
    rng = np.random.default_rng(0)
    low, high = rng.normal(0.5, 0.1, 12), rng.normal(0.8, 0.1, 12)
    found = difference(high, low)
    assert found.gap.value == pytest.approx(high.mean() - low.mean()) and found.gap.low > 0 and found.pvalue < 0.001
    assert found.improvement.value > 0.95 and not found.paired
    same = difference(low, rng.normal(0.5, 0.1, 12))
    assert same.gap.low < 0 < same.gap.high and same.pvalue > 0.05
    back = difference(low, high)
    assert back.gap.value == pytest.approx(-found.gap.value) and back.pvalue < 0.001
    with pytest.raises(ValueError, match="two seeds"):
        difference([1.0], low)
    with pytest.raises(ValueError, match="as many seeds"):
        difference(low, high[:5], paired=True)


def test_pairs_tell_a_method_from_the_maps():
    """What a map is worth differs much more than the methods do."""
    rng = np.random.default_rng(1)
    maps = rng.normal(0.0, 1.0, 12)
    first, second = maps + 0.1 + rng.normal(0, 0.05, 12), maps + rng.normal(0, 0.05, 12)
    paired, unpaired = difference(first, second, paired=True), difference(first, second)
    assert paired.gap.value == pytest.approx(unpaired.gap.value)
    assert paired.gap.low > 0 and paired.pvalue < 0.01 and paired.improvement.low > 0.5
    assert unpaired.gap.low < 0 and unpaired.pvalue > 0.5


def test_equal_values_leave_the_interval_open():
    found = difference([1.0] * 12, [0.5] * 12)
    assert found.gap == Estimate(0.5, None, None, 24) and found.pvalue < 0.001
    assert found.improvement.value == 1.0 and 0.7 < found.improvement.low < 0.8
    assert difference([1.0] * 4, [1.0] * 4, paired=True).improvement.value == 0.5


def test_holm_by_hand():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_allclose(holm([0.9, 0.8]), [1.0, 1.0])
    assert holm([]).size == 0


def test_comparisons_are_corrected_for_their_number():
    rng = np.random.default_rng(2)
    runs = {name: dict(enumerate(rng.normal(mean, 0.1, 12))) for name, mean in (("a", 0.6), ("b", 0.5), ("c", 0.5))}
    found = compare({**runs, "alone": {0: 1.0}}, {"a": "maps", "b": "maps", "c": None})
    assert list(found) == [("a", "b"), ("a", "c"), ("b", "c")]
    assert [each.paired for each in found.values()] == [True, False, False]
    of_two = compare({name: runs[name] for name in "ac"}, {})["a", "c"]
    values = [list(runs[name].values()) for name in "ac"]
    plain = stats.ttest_ind(*values, equal_var=False)
    assert (of_two.gap.low, of_two.gap.high) == pytest.approx(tuple(plain.confidence_interval(0.95)))
    wider = tuple(plain.confidence_interval(1 - 0.05 / 3))
    assert (found["a", "c"].gap.low, found["a", "c"].gap.high) == pytest.approx(wider)
    assert found["a", "c"].pvalue >= 2 * of_two.pvalue


def test_pairs_go_by_the_number_of_the_seed():
    first, second = {3: 1.0, 5: 2.0, 7: 4.0}, {7: 3.9, 3: 0.7, 5: 2.0}
    assert compare({"a": first, "b": second}, {"a": 1, "b": 1})["a", "b"].gap.value == pytest.approx(0.4 / 3)
    fewer = compare({"a": first, "b": {3: 0.9, 5: 1.9, 8: 3.9}}, {"a": 1, "b": 1})["a", "b"]
    assert fewer.paired and fewer.gap.value == pytest.approx(0.1)  # of seeds 3 and 5
    assert not compare({"a": first, "b": {3: 0.9, 6: 1.9, 8: 3.9}}, {"a": 1, "b": 1})["a", "b"].paired


@pytest.mark.parametrize(
    ("low", "high", "margin", "expected"),
    [
        (0.01, 0.2, 0.0, "reproduced"),
        (-0.2, -0.01, 0.0, "not reproduced"),
        (-0.01, 0.02, 0.0, "undecided"),
        (-0.01, 0.02, 0.05, "not reproduced"),
        (-0.01, 0.08, 0.05, "undecided"),
        (None, None, 0.05, "undecided"),
    ],
)
def test_claims_are_judged_by_the_interval(low, high, margin, expected):
    assert outcome(Estimate(0.0, low, high, 24), margin) == expected
    with pytest.raises(ValueError, match="0 or more"):
        outcome(Estimate(0.0, low, high, 24), -1.0)
