"""Statistics of simulated operators, against closed forms, scipy and simulation."""

import math

import numpy as np
import pytest
from scipy import stats

from otwarp.errors import InputError
from otwarp.operators import statistics
from otwarp.operators.statistics import Estimate


def test_a_rate_has_the_exact_interval():
    found = statistics.rate(np.arange(40) < 13)
    exact = stats.binomtest(13, 40).proportion_ci(method="exact")
    assert (found.value, found.low, found.high) == pytest.approx((13 / 40, exact.low, exact.high), abs=1e-12)


def test_wilson_is_scipys():
    exact = stats.binomtest(7, 25).proportion_ci(method="wilson")
    assert statistics.wilson(7, 25) == pytest.approx((exact.low, exact.high), abs=1e-12)


def pairs(rng, n, p, q, rho):
    """(n) successes of two conditions whose normal deviates have the correlation rho."""
    z = rng.multivariate_normal([0, 0], [[1, rho], [rho, 1]], n)
    return z[:, 0] < stats.norm.ppf(p), z[:, 1] < stats.norm.ppf(q)


@pytest.mark.parametrize(("p", "q", "rho"), [(0.6, 0.4, 0.7), (0.9, 0.8, 0.0), (0.3, 0.5, -0.3)])
def test_the_interval_of_a_risk_difference_holds_the_truth(p, q, rho):
    """At least 95 % but for 5σ of 2,000 studies of 60 pairs (standard error 0.0049), and 1 % that the method lacks."""
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(2000):
        found = statistics.risk_difference(*pairs(rng, 60, p, q, rho))
        held += found.low <= p - q <= found.high
    assert held / 2000 > 0.95 - 0.01 - 5 * math.sqrt(0.95 * 0.05 / 2000)


def test_pairs_that_agree_leave_a_narrow_difference():
    x = np.arange(200) < 100
    same, crossed = statistics.risk_difference(x, x), statistics.risk_difference(x, ~x)
    assert same.value == 0.0
    assert same.high - same.low < 0.2 * (crossed.high - crossed.low)


def test_mcnemar_is_the_sign_test_of_what_differs():
    with_ = np.repeat([True, True, False, False], [5, 9, 2, 4])
    without = np.repeat([True, False, True, False], [5, 9, 2, 4])
    assert statistics.mcnemar(with_, without) == pytest.approx(stats.binomtest(9, 11).pvalue)
    assert statistics.mcnemar(with_, with_) == 1.0


def test_hedges_g_is_the_difference_in_deviations_without_bias():
    """Mean of 4,000 studies of 6 pairs, whose deviation is 0.6: standard error 0.0095, 5σ."""
    rng = np.random.default_rng(6)
    found = [statistics.hedges_g(rng.normal(4.0, 1.0, 6), rng.normal(4.5, 1.0, 6)).value for _ in range(4000)]
    assert np.mean(found) == pytest.approx(0.5, abs=5 * np.std(found) / math.sqrt(4000))


def test_the_interval_of_g_holds_the_truth():
    """95 % but for 5σ of 2,000 studies (0.024), and 1 % for a normal interval of 80 correlated pairs."""
    rng, held = np.random.default_rng(7), 0
    for _ in range(2000):
        z = rng.multivariate_normal([0.0, 0.4], [[1.0, 0.6], [0.6, 1.0]], 80)
        found = statistics.hedges_g(z[:, 0], z[:, 1])
        held += found.low <= 0.4 <= found.high
    assert abs(held / 2000 - 0.95) < 0.034


def test_g_has_the_sign_of_better():
    low, high = np.array([1.0, 2.0, 3.0, 2.5]), np.array([3.0, 4.0, 5.5, 4.0])
    assert statistics.hedges_g(low, high).value > 0.0 > statistics.hedges_g(low, high, less_is_better=False).value
    assert statistics.hedges_g(low, low) == Estimate(0.0, 0.0, 0.0)


def test_rates_as_a_difference_are_what_the_paper_comes_to():
    odds = (8 / 2) / (3 / 7)
    expected = math.log(odds) * math.sqrt(3) / math.pi * (1 - 3 / (4 * 18 - 1))
    assert statistics.rate_as_g(0.8, 0.3, 10) == pytest.approx(expected)
    assert 1.1 < expected < 1.25
    assert math.isfinite(statistics.rate_as_g(1.0, 0.0, 10))


def test_a_small_study_is_two_binomials():
    """Against 200,000 simulated ones: 5 standard errors."""
    rng, n = np.random.default_rng(8), 200_000
    p, q = 0.7, 0.4
    x, y = rng.binomial(10, p, n), rng.binomial(10, q, n)
    found = statistics.small_study(Estimate(p, 0.65, 0.75), Estimate(q, 0.35, 0.45))
    for value, seen in ((found.at_least.value, (x >= 8) & (y <= 3)), (found.exactly, (x == 8) & (y == 3))):
        assert value == pytest.approx(seen.mean(), abs=5 * math.sqrt(seen.mean() / n))
    assert found.at_least.low < found.at_least.value < found.at_least.high


def test_sobol_indices_of_the_ishigami_function():
    """Closed forms (Ishigami and Homma 1990); 5 standard errors of 4,096 rows, found by resampling."""
    a, b = 7.0, 0.1
    points = -math.pi + 2 * math.pi * statistics.saltelli(4096, 3, 1)
    x = np.moveaxis(points, -1, 0)
    values = np.sin(x[0]) + a * np.sin(x[1]) ** 2 + b * x[2] ** 4 * np.sin(x[0])
    found = statistics.sobol(values)
    variance = a**2 / 8 + b * math.pi**4 / 5 + b**2 * math.pi**8 / 18 + 0.5
    first = np.array([0.5 * (1 + b * math.pi**4 / 5) ** 2, a**2 / 8, 0.0]) / variance
    third = 8 * b**2 * math.pi**8 / 225 / variance
    total = first + np.array([third, 0.0, third])
    assert found.variance == pytest.approx(variance, rel=0.05)
    assert np.all(np.abs(found.first - first) < 5 * found.first_error + 1e-3)
    assert np.all(np.abs(found.total - total) < 5 * found.total_error + 1e-3)


def test_sobol_indices_do_not_depend_on_the_mean():
    """Neither an index nor its standard error, to rounding at a mean of 1,000 deviations."""
    values = np.random.default_rng(3).normal(size=(64, 6))
    near, far = statistics.sobol(values), statistics.sobol(values + 1000.0)
    for name in ("first", "total", "first_error", "total_error"):
        np.testing.assert_allclose(getattr(far, name), getattr(near, name), rtol=0.0, atol=1e-9, err_msg=name)


def test_nothing_varies_has_no_indices():
    found = statistics.sobol(np.ones((8, 5)))
    assert found.variance == 0.0 and np.all(np.isnan(found.first))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: statistics.rate([]),
        lambda: statistics.risk_difference([True], [True, False]),
        lambda: statistics.hedges_g([1.0, 2.0], [2.0, 3.0]),
        lambda: statistics.saltelli(12, 3, 0),
        lambda: statistics.sobol(np.ones((1, 5))),
        lambda: statistics.rate([True], level=1.5),
    ],
)
def test_wrong_counts_are_refused(wrong):
    with pytest.raises(InputError, match="allowed"):
        wrong()
