"""Whether a filter's covariances are right: squared errors over them are χ² distributed if they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from otwarp.vision.tracking.belief import Belief
from otwarp.vision.tracking.rotations import difference
from otwarp.vision.tracking.shape import Shape


def squared_error(belief: Belief, shape: Shape, place: np.ndarray, turn: np.ndarray) -> tuple[float, int]:
    """The normalised estimation error squared (NEES) of a hypothesis against the truth, and its degrees of freedom.

    Directions that no image shows, as turns of a body of revolution about its axis, do not count.

    Args:
        belief: The hypothesis.
        shape: The body.
        place: (3) true centre of diffusion [µm].
        turn: (4) true orientation.

    Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
    section 5.4, doi:10.1002/0471221279.
    """
    nearest = shape.nearest(turn, belief.orientation)
    error = np.concatenate([place - belief.position, difference(nearest, belief.orientation)])
    rows = shape.visible(belief.orientation)
    error, covariance = rows @ error, rows @ belief.covariance @ rows.T
    return float(error @ np.linalg.solve(covariance, error)), len(error)


@dataclass(frozen=True)
class Consistency:
    """Mean of squared normalised errors, and what it should be.

    Attributes:
        mean: Over all samples, per degree of freedom; 1 is right.
        error: Its expected standard error, from χ² and the correlation of the samples.
        samples: How many.
        independent: To how many uncorrelated ones they amount.
    """

    mean: float
    error: float
    samples: int
    independent: float

    @property
    def sigmas(self) -> float:
        """How many standard errors the mean is from 1."""
        return (self.mean - 1.0) / self.error


def consistency(values: Sequence[float] | np.ndarray, degrees: int, *, correlation: float = 0.0) -> Consistency:
    """Whether squared normalised errors have the mean of χ².

    Args:
        values: One series of (n), or (k, n) series that are independent of each other.
        degrees: Of freedom.
        correlation: Of an error with the next one in a series: innovations of a right filter have none; errors of its
            estimates do, and their squares with the square of it.
    """
    array = np.atleast_2d(np.asarray(values, dtype=float))
    count = array.size
    squared = min(correlation * correlation, 0.9999)
    length = array.shape[1]
    lags = np.arange(1, length)
    stretch = 1.0 + 2.0 * float(((1.0 - lags / length) * squared**lags).sum())
    independent = count / stretch
    error = math.sqrt(2.0 / (degrees * independent))
    return Consistency(float(array.mean()) / degrees, error, count, independent)


def error_correlation(errors: np.ndarray) -> float:
    """Correlation of neighbouring errors, from (k, n, d) series of whitened errors."""
    first, last = errors[:, :-1], errors[:, 1:]
    return float((first * last).sum() / max(float((first * first).sum()), 1e-300))
