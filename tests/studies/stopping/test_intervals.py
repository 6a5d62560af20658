"""Intervals against tables, definitions, and by simulated coverage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from otwarp.errors import InputError
from otwarp.studies.stopping.intervals import interval, survival
from otwarp.studies.stopping.rules import half_width


def test_clopper_pearson_is_exact():
    """At its ends, tails of the binomial distribution are α/2: the definition (doi:10.1093/biomet/26.4.404)."""
    k, n = np.array([1, 5, 50, 99]), np.array([10, 10, 100, 100])
    low, high = interval(k, n, level=0.9)
    assert np.allclose(stats.binom.sf(k - 1, n, low), 0.05, rtol=1e-9)
    assert np.allclose(stats.binom.cdf(k, n, high), 0.05, rtol=1e-9)
    assert interval([0, 10], [10, 10])[0].tolist()[0] == 0.0 and interval([0, 10], [10, 10])[1].tolist()[1] == 1.0
    assert [float(end) for end in interval(0, 0)] == [0.0, 1.0]


@pytest.mark.parametrize(("p", "width"), [(0.5, 0.05), (0.1, 0.05), (0.01, 0.05), (0.001, 0.02)])
@pytest.mark.parametrize("method", ["clopper-pearson", "sequence"])
def test_coverage_where_trials_go_on_until_the_interval_is_narrow(p, width, method):
    """2,000 points stop by the rule itself; they hold the truth at least as often as they say, at 5σ.

    The rarest is where Wilson's intervals hold it in 0.90 alone.
    """
    count, level = 2_000, 0.95
    draws = np.random.Generator(np.random.Philox(11)).random((count, 4_096)) < p
    rule = half_width(width, level=level, method=method, at_least=16, at_most=4_096)
    done = np.zeros(count, dtype=int)
    sums = np.concatenate([np.zeros((count, 1), dtype=int), np.cumsum(draws, axis=1)], axis=1)
    while True:
        wanted = rule.wanted(sums[np.arange(count), done][None], done)
        if np.all(wanted <= done):
            break
        done = wanted
    low, high = interval(sums[np.arange(count), done], done, level=level, method=method)
    covered = np.mean((low <= p) & (p <= high))
    assert np.all(0.5 * (high - low) <= width)
    assert covered >= level - 5.0 * np.sqrt(level * (1.0 - level) / count)


def test_trials_follow_from_what_is_seen():
    """A point that is sure stops after the first look, one of even odds takes what its interval does, and 3 % more."""
    rule = half_width(0.05)
    assert rule.wanted(np.zeros((1, 3)), np.zeros(3, dtype=int)).tolist() == [64, 64, 64]
    seen, done = np.array([[0, 64, 32]]), np.full(3, 64)
    assert rule.wanted(seen, done).tolist() == [64, 64, 256]
    last = int(rule.wanted(np.array([[128]]), np.array([256]))[0])
    enough = next(n for n in range(300, 500) if np.diff(interval(n // 2, n), axis=0)[0] <= 0.1)
    assert enough <= last <= 1.03 * enough


@pytest.mark.thorough
def test_a_sequence_holds_at_every_look():
    """Looked at after every trial, 1 − level of the sequences at most ever miss; Clopper–Pearson misses more often."""
    count, n, p = 1_000, 400, 0.3
    sums = np.cumsum(np.random.Generator(np.random.Philox(5)).random((count, n)) < p, axis=1)
    trials = np.arange(1, n + 1)[None]
    missed = {}
    for method in ("sequence", "clopper-pearson"):
        low, high = interval(sums, trials, level=0.9, method=method)
        missed[method] = np.mean(np.any((p < low) | (p > high), axis=1))
    assert missed["sequence"] <= 0.1 + 5.0 * np.sqrt(0.09 / count)
    assert missed["clopper-pearson"] > 0.2


def test_survival_of_a_textbook():
    """Remission times of 6-MP (Freireich et al. 1963), as in Kalbfleisch and Prentice: S(23) = 0.4482."""
    times = [6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35]
    ended = [1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]
    t, s, low, high = survival(times, ended)
    assert t.tolist() == [0, 6, 7, 10, 13, 16, 22, 23]
    assert s == pytest.approx([1, 0.8571, 0.8067, 0.7529, 0.6902, 0.6275, 0.5378, 0.4482], abs=5e-5)
    assert np.all((low <= s) & (s <= high)) and np.all((low >= 0) & (high <= 1))


def test_survival_covers_an_exponential_under_censoring():
    """The band at one time holds the truth in 95 % of 1,000 samples of 60 trials, within 5σ and its approximation."""
    random = np.random.Generator(np.random.Philox(2))
    held = 0
    for _ in range(1_000):
        life, cut = random.exponential(1.0, 60), random.uniform(0.2, 2.5, 60)
        t, _, low, high = survival(np.minimum(life, cut), life <= cut)
        at = np.searchsorted(t, 0.7, side="right") - 1
        held += low[at] <= np.exp(-0.7) <= high[at]
    assert held / 1_000 >= 0.95 - 0.01 - 5.0 * np.sqrt(0.05 * 0.95 / 1_000)


def test_refused():
    """Levels and counts that cannot be."""
    for level in (0.0, 1.0):
        with pytest.raises(InputError, match="allowed"):
            interval(1, 2, level=level)
    with pytest.raises(InputError, match="allowed"):
        interval(1, 2, method="wilson")  # type: ignore[arg-type]
    for k, n in ((3, 2), (-1, 2)):
        with pytest.raises(InputError, match="allowed"):
            interval(k, n)
    with pytest.raises(InputError, match="allowed"):
        survival([-1.0], [True])
