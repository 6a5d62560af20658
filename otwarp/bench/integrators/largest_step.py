"""From noisy errors at a few time steps to the largest step of a wanted error, and the run time that it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

ASYMPTOTIC = 0.15
"""Relative error above which a step is too long for the two leading terms of its error."""

LACK = 0.1
"""Of an error, what the two terms may miss of it; added to its statistical error when they are fitted."""

DRAWS = 400
"""Draws from the fitted coefficients' distribution for the uncertainty of the step."""


@dataclass(frozen=True)
class StepLimit:
    """The largest z = k·dt/γ at which an error stays within what is wanted.

    Attributes:
        product: z.
        low, high: Its 16th and 84th percentile.
        beyond: No measured step was long enough to exceed the error: `product` is the longest of them, a lower bound.
    """

    product: float
    low: float
    high: float
    beyond: bool = False


def largest_step(
    products: Sequence[float], errors: Sequence[float], spreads: Sequence[float], *, order: float, wanted: float
) -> StepLimit:
    """Fit e(z) = a·z^p + b·z^(p+1) to signed errors and find where |e| first exceeds what is wanted.

    Between measured steps that is interpolation by the law the errors follow; a single noisy point cannot decide it.

    Args:
        products: z of the measured steps.
        errors: Signed relative errors.
        spreads: Their standard errors.
        order: p, the leading power: the weak order, or 1/2 where escapes between steps do not count.
        wanted: Relative error.
    """
    z, e, s = (np.asarray(a, dtype=float) for a in (products, errors, spreads))
    longest = float(z.max())
    use = np.abs(e) < np.maximum(ASYMPTOTIC, 4.0 * s)
    use[np.argmin(z)] = True
    if use.sum() < 2:
        use[np.argsort(z)[:2]] = True
    # so small a spread is no more than a point without statistics
    weight = 1.0 / np.sqrt(s[use] ** 2 + (LACK * e[use]) ** 2 + 1e-12)
    terms = np.stack([z[use] ** order, z[use] ** (order + 1.0)], axis=1) * weight[:, None]
    inverse = np.linalg.pinv(terms.T @ terms)
    best = inverse @ terms.T @ (e[use] * weight)
    # beyond the fitted steps nothing is known but that the error is large
    end = longest if use.all() else float(z[use].max())
    draws = np.random.default_rng(1).multivariate_normal(best, inverse, DRAWS)
    grid = np.geomspace(min(1e-4, float(z.min())), end, 600)
    powers = np.stack([grid**order, grid ** (order + 1.0)])
    first = [_first_above(np.abs(c @ powers), grid, wanted) for c in (best, *draws)]
    low, high = np.percentile(first[1:], [16.0, 84.0])
    return StepLimit(first[0], float(low), float(high), beyond=bool(first[0] >= longest))


def _first_above(error: np.ndarray, grid: np.ndarray, wanted: float) -> float:
    """Where the error first exceeds what is wanted, log–log between the points of the grid; its end if nowhere."""
    above = np.flatnonzero(error > wanted)
    if not len(above):
        return float(grid[-1])
    i = int(above[0])
    if i == 0:
        return float(grid[0])
    part = np.log(wanted / error[i - 1]) / np.log(error[i] / error[i - 1])
    return float(grid[i - 1] * (grid[i] / grid[i - 1]) ** part)
