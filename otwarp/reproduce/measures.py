"""Figures of merit by the paper's definitions, and what statistics says of its two groups of ten."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from otwarp.studies.stopping.intervals import interval


@dataclass(frozen=True)
class Agreement:
    """Of a series with the one that it should be.

    Attributes:
        mse, rmse, mae: Mean square, root mean square and mean absolute difference, in the series' unit (squared).
        r_squared: 1 − Σ(y − f)²/Σ(f − mean f)².
        count: Pairs.
    """

    mse: float
    rmse: float
    mae: float
    r_squared: float
    count: int


def agreement(series: ArrayLike, reference: ArrayLike) -> Agreement:
    """How far a series is from its reference, by the paper's definitions.

    Args:
        series: (n,) what was rendered, simulated or fitted.
        reference: (n,) what it should be, in the same unit; its own spread is what R² is measured against.
    """
    y, f = np.asarray(series, dtype=float).ravel(), np.asarray(reference, dtype=float).ravel()
    away = y - f
    mse = float(np.mean(away**2))
    total = float(np.sum((f - f.mean()) ** 2))
    r_squared = 1.0 - float(np.sum(away**2)) / total if total > 0.0 else math.nan
    return Agreement(mse, math.sqrt(mse), float(np.mean(np.abs(away))), r_squared, len(y))


def mean_of_trials(values: ArrayLike) -> tuple[float, float]:
    """Mean over trials, and its standard error from their spread; the error is nan for one trial.

    Args:
        values: (n,) one number for each trial.
    """
    x = np.asarray(values, dtype=float)
    return float(x.mean()), float(x.std(ddof=1) / math.sqrt(len(x))) if len(x) > 1 else math.nan


def share(successes: int, trials: int) -> tuple[float, tuple[float, float]]:
    """A success rate, and its 95 % interval by Clopper and Pearson (1934, doi:10.1093/biomet/26.4.404)."""
    low, high = interval(successes, trials)
    return successes / trials, (float(low), float(high))


def fisher(first: tuple[int, int], second: tuple[int, int]) -> float:
    """Two-sided p of Fisher's exact test of two groups, each (successes, trials)."""
    from scipy.stats import fisher_exact

    table = [[k, n - k] for k, n in (first, second)]
    found: Any = fisher_exact(table)
    return float(found.pvalue)


def difference_of_shares(first: tuple[int, int], second: tuple[int, int]) -> tuple[float, tuple[float, float]]:
    """Difference of two success rates with its 95 % interval by Newcombe's hybrid of Wilson's intervals.

    Newcombe 1998, method 10, doi:10.1002/(SICI)1097-0258(19980430)17:8<873::AID-SIM779>3.0.CO;2-I.

    Args:
        first, second: (successes, trials).
    """
    (p, low, high), (q, below, above) = (_wilson(*group) for group in (first, second))
    d = p - q
    return d, (d - math.hypot(p - low, above - q), d + math.hypot(high - p, q - below))


def _wilson(successes: int, trials: int, z: float = 1.959963984540054) -> tuple[float, float, float]:
    """Share and ends of its score interval (Wilson 1927)."""
    p = successes / trials
    centre = (p + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(p * (1 - p) / trials + z * z / (4 * trials**2))
    return p, centre - half, centre + half
