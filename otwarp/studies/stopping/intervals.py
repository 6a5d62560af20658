"""Confidence intervals of probabilities and times, from counts of trials.

Clopper and Pearson (1934, doi:10.1093/biomet/26.4.404) is exact for a number of trials that was fixed beforehand, and
stays at or above its level where trials go on until the interval is narrow enough, which
`tests/studies/stopping/test_intervals.py` simulates. Who looks after every trial for any reason whatever takes the
confidence sequence: the likelihood of a beta mixture over that of the true probability is a martingale, which by
Ville's inequality exceeds 1/α with probability α at most, ever (Robbins 1970, doi:10.1214/aoms/1177696786; Howard et
al. 2021, doi:10.1214/20-AOS1991).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from otwarp.errors import InputError

Method = Literal["clopper-pearson", "sequence"]
METHODS: tuple[Method, ...] = ("clopper-pearson", "sequence")


def interval(
    successes: ArrayLike, trials: ArrayLike, *, level: ArrayLike = 0.95, method: str = "clopper-pearson"
) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper ends of the intervals of probabilities, [0, 1] where there was no trial.

    Args:
        successes, trials: Counts, arrays that broadcast.
        level: Probability with which an interval holds the truth, at least; an array that broadcasts beside them.
        method: A name of `METHODS`.

    Raises:
        InputError: Counts that cannot be, or a level or method that is none.
    """
    k, n = np.broadcast_arrays(np.asarray(successes, dtype=float), np.asarray(trials, dtype=float))
    check_level(level)
    of = np.asarray(level, dtype=float)
    if method not in METHODS:
        raise InputError(f"method is {method!r}; allowed: {', '.join(METHODS)}")
    if np.any((k < 0) | (k > n)):
        raise InputError("successes are fewer than none or more than the trials; allowed: 0 to the number of trials")
    return _clopper_pearson(k, n, of) if method == "clopper-pearson" else _sequence(k, n, of)


def check_level(level: ArrayLike) -> None:
    """Refuse a level that is no probability between 0 and 1.

    Raises:
        InputError: One line.
    """
    of = np.asarray(level)
    if of.dtype.kind not in "iuf" or not np.all((of > 0.0) & (of < 1.0)):
        raise InputError(f"level is {level!r}; allowed: above 0 and below 1")


def _clopper_pearson(k: np.ndarray, n: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - level)
    with np.errstate(invalid="ignore"):
        low = np.where(k > 0, betaincinv(np.maximum(k, 1e-300), n - k + 1.0, tail), 0.0)
        high = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 1e-300), 1.0 - tail), 1.0)
    return np.where(n > 0, low, 0.0), np.where(n > 0, high, 1.0)


def rate_interval(events: ArrayLike, exposure: ArrayLike, *, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper ends of the intervals of rates, of so many events in so much time: 0 to inf where there was none.

    Exact for Poisson events (Garwood 1936, doi:10.2307/2333958).

    Args:
        events, exposure: Counts and times, arrays that broadcast.
        level: Probability with which an interval holds the truth, at least.

    Raises:
        InputError: Negative counts or times, or a level that is none.
    """
    from scipy.special import gammaincinv

    check_level(level)
    k, t = np.broadcast_arrays(np.asarray(events, dtype=float), np.asarray(exposure, dtype=float))
    if not (np.all(k >= 0.0) and np.all(t >= 0.0)):
        raise InputError("events and exposure; allowed: none of them negative")
    tail = 0.5 * (1.0 - level)
    with np.errstate(divide="ignore", invalid="ignore"):
        low = np.where(k > 0, gammaincinv(np.maximum(k, 1e-300), tail), 0.0) / t
        high = gammaincinv(k + 1.0, 1.0 - tail) / t
    return np.where(t > 0.0, low, 0.0), np.where(t > 0.0, high, np.inf)


def errors_to_the_ends(trials: ArrayLike, *, level: float = 0.95) -> np.ndarray:
    """Standard errors from the mean of so many trials to the ends of its interval: Student's, exact for normal numbers.

    Args:
        trials: Counts; of fewer than two nothing is known: inf.
        level: Probability with which an interval holds the truth.

    Raises:
        InputError: A level that is none.
    """
    from scipy.special import stdtrit

    check_level(level)
    n = np.asarray(trials, dtype=float)
    return np.where(n > 1.0, stdtrit(np.maximum(n - 1.0, 1.0), 0.5 + 0.5 * level), np.inf)


def _sequence(k: np.ndarray, n: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All p whose likelihood is at least α times that of the beta(1/2, 1/2) mixture, found by bisection."""
    from scipy.special import betaln, xlog1py, xlogy

    mixture = betaln(k + 0.5, n - k + 0.5) - betaln(0.5, 0.5)
    floor = mixture + np.log(1.0 - level)

    def likely(p: np.ndarray) -> np.ndarray:
        return xlogy(k, p) + xlog1py(n - k, -p) >= floor

    best = np.where(n > 0, k / np.maximum(n, 1.0), 0.5)
    ends = []
    for outside in (np.zeros_like(best), np.ones_like(best)):
        inner, outer = best.copy(), outside.copy()
        for _ in range(60):
            middle = 0.5 * (inner + outer)
            inside = likely(middle)
            inner, outer = np.where(inside, middle, inner), np.where(inside, outer, middle)
        # the end itself where even it is likely enough
        ends.append(np.where(likely(outside), outside, inner))
    return ends[0], ends[1]


def survival(
    times: ArrayLike, ended: ArrayLike, *, level: float = 0.95
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Probability to last longer than t, from trials of which some were cut off before they ended.

    The product limit of Kaplan and Meier (1958, doi:10.1080/01621459.1958.10501452), with Greenwood's variance on the
    scale of log(−log S), which keeps the interval within [0, 1] (Kalbfleisch and Prentice 2002,
    doi:10.1002/9781118032985).

    Args:
        times: (n) when each trial ended or was cut off.
        ended: (n) whether it ended; else it was cut off.
        level: Of the interval.

    Returns:
        Times at which trials ended, in order, from 0 on; S just after each; lower and upper ends of its interval.

    Raises:
        InputError: Arrays of different lengths, a time that is negative or none, or a level that is none.
    """
    from scipy.special import ndtri

    t, e = np.asarray(times, dtype=float).ravel(), np.asarray(ended, dtype=bool).ravel()
    check_level(level)
    if t.shape != e.shape or not np.all(t >= 0.0):
        raise InputError("times and ended; allowed: as many of one as of the other, no time negative")
    at, deaths = np.unique(t[e], return_counts=True)
    at_risk = len(t) - np.searchsorted(np.sort(t), at, side="left")
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.cumprod(1.0 - deaths / at_risk)
        variance = np.cumsum(deaths / (at_risk * (at_risk - deaths)))
        width = ndtri(0.5 + 0.5 * level) * np.sqrt(variance) / np.abs(np.log(s))
        low, high = s ** np.exp(width), s ** np.exp(-width)
    # when the last one left has ended too, nothing is known of how long others would last
    low, high = np.where(s > 0.0, low, 0.0), np.where(s > 0.0, high, np.append(1.0, high)[: len(s)])
    one = np.ones(1)
    return np.append(0.0, at), np.append(one, s), np.append(one, low), np.append(one, high)
