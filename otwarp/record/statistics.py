"""Running mean and standard deviation in constant memory."""

from __future__ import annotations

from typing import Any

import numpy as np


class RunningStatistics:
    """Mean, spread and maximum of many parallel series, sample by sample.

    The update is Welford's (B. P. Welford, Technometrics 4, 419, 1962, doi:10.1080/00401706.1962.10490022); series
    are pooled with the pairwise formula of Chan, Golub and LeVeque (The American Statistician 37, 242, 1983,
    doi:10.1080/00031305.1983.10483115).

    Attributes:
        count, mean, squares, maximum: Arrays of the given shape; `squares` is the sum of squared deviations.
        above: Number of samples above the limit that came with them.
    """

    def __init__(self, shape: tuple[int, ...]):
        self.count = np.zeros(shape, dtype=np.int64)
        self.mean = np.zeros(shape)
        self.squares = np.zeros(shape)
        self.maximum = np.full(shape, -np.inf)
        self.above = np.zeros(shape, dtype=np.int64)

    def add(self, values: np.ndarray, *, where: np.ndarray | bool = True, limit: np.ndarray | float = np.inf) -> None:
        """Take one sample of every series.

        Args:
            values: Samples; those that are nan do not count.
            where: Mask of the series that take part.
            limit: Warning line; samples above it are counted.
        """
        valid = np.isfinite(values) & where
        x = np.where(valid, values, 0.0)
        self.count += valid
        delta = np.where(valid, x - self.mean, 0.0)
        self.mean += delta / np.maximum(self.count, 1)
        self.squares += np.where(valid, delta * (x - self.mean), 0.0)
        self.maximum = np.where(valid, np.maximum(self.maximum, x), self.maximum)
        self.above += valid & (x > limit)

    def pooled(self, select: Any = ...) -> dict[str, float | int | None]:
        """Count, mean, population standard deviation, maximum and share above the limit of the chosen series.

        Args:
            select: Index of the series to pool; all by default.

        Returns:
            `samples`, `mean`, `std`, `maximum`, `fraction_above`; all but the first are None without samples.
        """
        n = self.count[select]
        total = int(n.sum())
        if total == 0:
            return {"samples": 0, "mean": None, "std": None, "maximum": None, "fraction_above": None}
        mean = float((n * self.mean[select]).sum() / total)
        squares = float((self.squares[select] + n * (self.mean[select] - mean) ** 2).sum())
        return {
            "samples": total,
            "mean": mean,
            "std": float(np.sqrt(max(squares, 0.0) / total)),
            "maximum": float(self.maximum[select].max()),
            "fraction_above": float(self.above[select].sum() / total),
        }
