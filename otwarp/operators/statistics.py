"""Statistics of SIMULATED operators, in float64: paired rates, standardised differences, small studies, Sobol.

Every operator runs with and without haptics, with the same random numbers, so trials come in pairs. Intervals say how
well so many simulated operators tell what the model does; nothing here says how well the model is like a person.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError
from otwarp.studies.stopping.intervals import check_level, interval


@dataclass(frozen=True)
class Estimate:
    """A number with the ends of its interval."""

    value: float
    low: float
    high: float


def rate(successes: ArrayLike, level: float = 0.95) -> Estimate:
    """Share of successes (n) with the interval of Clopper and Pearson (1934, doi:10.1093/biomet/26.4.404).

    Raises:
        InputError: No trial, or a level that is none.
    """
    made = np.asarray(successes, dtype=bool)
    _some(len(made), 1)
    low, high = interval(made.sum(), len(made), level=level)
    return Estimate(float(made.mean()), float(low), float(high))


def wilson(successes: float, trials: float, level: float = 0.95) -> tuple[float, float]:
    """Score interval of a probability (Wilson 1927, doi:10.1080/01621459.1927.10502953)."""
    from scipy.special import ndtri

    check_level(level)
    z2, p = float(ndtri(0.5 + 0.5 * level)) ** 2, successes / trials
    middle = (p + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(z2 * (p * (1 - p) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def risk_difference(with_: ArrayLike, without: ArrayLike, level: float = 0.95) -> Estimate:
    """Difference of two paired success rates, with − without.

    The interval is that of score intervals joined by the pairs' correlation: method 10 of Newcombe 1998,
    doi:10.1002/(SICI)1097-0258(19981130)17:22<2635::AID-SIM954>3.0.CO;2-C.

    Args:
        with_, without: (n) successes of the same operators.
        level: Of the interval.

    Raises:
        InputError: Not as many of one as of the other, or none.
    """
    x, y = _pairs(with_, without, bool)
    n = len(x)
    a, b = int(np.sum(x & y)), int(np.sum(x & ~y))
    c, d = int(np.sum(~x & y)), int(np.sum(~x & ~y))
    p, q = (a + b) / n, (a + c) / n
    low_p, high_p = wilson(a + b, n, level)
    low_q, high_q = wilson(a + c, n, level)
    product = math.sqrt(float((a + b) * (c + d)) * float((a + c) * (b + d)))
    cross = a * d - b * c
    phi = (max(cross - 0.5 * n, 0.0) if cross > 0 else cross) / product if product > 0.0 else 0.0
    below = _joined(p - low_p, high_q - q, phi)
    above = _joined(high_p - p, q - low_q, phi)
    return Estimate(p - q, p - q - below, p - q + above)


def _joined(u: float, v: float, phi: float) -> float:
    """√(u² − 2φuv + v²), 0 where rounding has it below."""
    return math.sqrt(max(u * u - 2.0 * phi * u * v + v * v, 0.0))


def mcnemar(with_: ArrayLike, without: ArrayLike) -> float:
    """Exact two-sided p-value of no difference between paired rates: the sign test of the pairs that differ.

    McNemar 1947, doi:10.1007/BF02295996.

    Raises:
        InputError: As `risk_difference`.
    """
    from scipy.stats import binomtest

    x, y = _pairs(with_, without, bool)
    better, worse = int(np.sum(x & ~y)), int(np.sum(~x & y))
    return 1.0 if better + worse == 0 else float(binomtest(better, better + worse).pvalue)


def hedges_g(with_: ArrayLike, without: ArrayLike, *, less_is_better: bool = True, level: float = 0.95) -> Estimate:
    """Standardised mean difference of pairs, in standard deviations of the two conditions: above 0, haptics are better.

    With the small-sample factor of Hedges 1981, doi:10.3102/10769986006002107, for 2(n − 1) degrees of freedom; the
    interval is normal with the variance of Borenstein et al. 2009, doi:10.1002/9780470743386, ch. 4, for pairs.

    Args:
        with_, without: (n) numbers of the same operators.
        less_is_better: Whether a smaller number is the better one, as of times and forces.
        level: Of the interval.

    Raises:
        InputError: As `risk_difference`, or fewer than 3 pairs.
    """
    from scipy.special import ndtri

    x, y = _pairs(with_, without, float, at_least=3)
    check_level(level)
    n = len(x)
    pooled = math.sqrt(0.5 * (x.var(ddof=1) + y.var(ddof=1)))
    if pooled == 0.0:
        return Estimate(0.0, 0.0, 0.0) if x.mean() == y.mean() else Estimate(math.nan, math.nan, math.nan)
    sign = -1.0 if less_is_better else 1.0
    factor = small_sample(2 * (n - 1))
    d = sign * (x.mean() - y.mean()) / pooled
    r = np.corrcoef(x, y)[0, 1] if x.std() > 0.0 and y.std() > 0.0 else 0.0
    variance = (1.0 / n + d * d / (2.0 * n)) * 2.0 * (1.0 - r)
    half = float(ndtri(0.5 + 0.5 * level)) * math.sqrt(variance)
    return Estimate(factor * d, factor * (d - half), factor * (d + half))


def mean_difference(one: ArrayLike, other: ArrayLike, level: float = 0.95) -> Estimate:
    """Mean difference of pairs, one − other, with Student's interval; of a single pair without one.

    Args:
        one, other: (n) numbers of the same operators.
        level: Of the interval.

    Raises:
        InputError: As `risk_difference`.
    """
    from scipy.special import stdtrit

    x, y = _pairs(one, other, float)
    check_level(level)
    apart, n = x - y, len(x)
    if n < 2:
        return Estimate(float(apart.mean()), math.nan, math.nan)
    half = float(stdtrit(n - 1, 0.5 + 0.5 * level)) * apart.std(ddof=1) / math.sqrt(n)
    return Estimate(float(apart.mean()), float(apart.mean() - half), float(apart.mean() + half))


def small_sample(freedom: float) -> float:
    """Hedges' factor J = 1 − 3/(4·df − 1), which takes the bias of small samples off a standardised difference."""
    return 1.0 - 3.0 / (4.0 * freedom - 1.0)


def rate_as_g(with_: float, without: float, n: int) -> float:
    """Two success rates of n trials each as a standardised difference: ln(odds ratio)·√3/π, with Hedges' factor.

    Chinn 2000, doi:10.1002/1097-0258(20001130)19:22<3127::AID-SIM784>3.0.CO;2-M. Half a trial is added to each count
    where one of them is empty.
    """
    counts = np.array([with_ * n, (1.0 - with_) * n, without * n, (1.0 - without) * n])
    if np.any(counts == 0.0):
        counts = counts + 0.5
    odds = counts[0] * counts[3] / (counts[1] * counts[2])
    return float(np.log(odds) * math.sqrt(3.0) / math.pi * small_sample(2 * (n - 1)))


@dataclass(frozen=True)
class SmallStudy:
    """What a study of n + n trials would show.

    Attributes:
        at_least: Probability of at least so many successes with haptics and at most so many without, with its interval.
        exactly: Probability of exactly these counts.
    """

    at_least: Estimate
    exactly: float


def small_study(
    with_: Estimate, without: Estimate, *, trials: int = 10, successes: int = 8, others: int = 3
) -> SmallStudy:
    """How often `trials` + `trials` independent trials show `successes` with haptics against `others` without.

    Args:
        with_, without: Success rates with intervals; the interval of the result is between their ends, and so holds at
            least as surely as both.
        trials, successes, others: Of the small study.
    """
    from scipy.stats import binom

    def chance(p: float, q: float) -> float:
        """Of at least the one and at most the other."""
        return float(binom.sf(successes - 1, trials, p) * binom.cdf(others, trials, q))

    exactly = float(binom.pmf(successes, trials, with_.value) * binom.pmf(others, trials, without.value))
    bounds = chance(with_.low, without.high), chance(with_.high, without.low)
    return SmallStudy(Estimate(chance(with_.value, without.value), *bounds), exactly)


@dataclass(frozen=True)
class SobolIndices:
    """Shares of a variance, (parameters) each, with the standard errors of both.

    Attributes:
        first: By a parameter alone; total: with all in which it takes part.
        first_error, total_error: Standard errors, by resampling rows.
        variance: What is shared out.
    """

    first: np.ndarray
    total: np.ndarray
    first_error: np.ndarray
    total_error: np.ndarray
    variance: float


def saltelli(rows: int, parameters: int, seed: int) -> np.ndarray:
    """(rows, parameters + 2, parameters) shares 0 to 1: A, B, then A with one column after the other from B.

    From scrambled Sobol points (Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018).

    Raises:
        InputError: `rows` is no power of 2.
    """
    from scipy.stats import qmc

    if rows < 1 or rows & (rows - 1):
        raise InputError(f"--sobol is {rows}; allowed: a power of 2")
    points = qmc.Sobol(2 * parameters, rng=np.random.Generator(np.random.Philox(seed))).random(rows)
    a, b = points[:, :parameters], points[:, parameters:]
    mixed = np.repeat(a[:, None], parameters, axis=1)
    each = np.arange(parameters)
    mixed[:, each, each] = b
    return np.concatenate([a[:, None], b[:, None], mixed], axis=1)


def sobol(values: ArrayLike, *, resamples: int = 200, seed: int = 0) -> SobolIndices:
    """First and total indices from (rows, parameters + 2) numbers at the points of `saltelli`.

    First: Saltelli et al. 2010, of numbers less their mean, which has no part in the index but is noise in its
    estimate (Sobol and Myshetskaya 2008); total: Jansen 1999, doi:10.1016/S0010-4655(98)00154-4.

    Raises:
        InputError: Fewer than two rows.
    """
    f = np.asarray(values, dtype=float)
    _some(len(f), 2)
    first, total, variance = _indices(f)
    pick = np.random.default_rng(seed).integers(0, len(f), (resamples, len(f)))
    again = [_indices(f[rows]) for rows in pick]
    varied = [row for row in again if row[2] > 0.0]
    nothing = np.full_like(first, np.nan)
    first_error = np.std(np.array([row[0] for row in varied]), axis=0) if varied else nothing
    total_error = np.std(np.array([row[1] for row in varied]), axis=0) if varied else nothing
    return SobolIndices(first, total, first_error, total_error, variance)


def _indices(f: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """First and total indices, and the variance; nan where nothing varies."""
    a, b, mixed = f[:, 0], f[:, 1], f[:, 2:]
    variance = float(np.var(np.concatenate([a, b])))
    if variance == 0.0:
        nothing = np.full(mixed.shape[1], np.nan)
        return nothing, nothing, 0.0
    centred = b - np.mean(np.concatenate([a, b]))
    first = np.mean(centred[:, None] * (mixed - a[:, None]), axis=0) / variance
    total = 0.5 * np.mean((a[:, None] - mixed) ** 2, axis=0) / variance
    return first, total, variance


def _pairs(with_: ArrayLike, without: ArrayLike, dtype: type, at_least: int = 1) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.asarray(with_, dtype=dtype).ravel(), np.asarray(without, dtype=dtype).ravel()
    if x.shape != y.shape:
        raise InputError(f"with and without haptics are {len(x)} and {len(y)} trials; allowed: as many of each")
    _some(len(x), at_least)
    return x, y


def _some(count: int, at_least: int) -> None:
    if count < at_least:
        raise InputError(f"there are {count} trials; allowed: {at_least} or more")
