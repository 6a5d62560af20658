"""Space that repeats, on the host: nearest images, and points put back into the cell; NumPy, any units of length."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def nearest(away: np.ndarray, period: ArrayLike) -> np.ndarray:
    """(..., 3) differences of points, each that of the nearest images.

    Args:
        away: (..., 3) differences.
        period: (3,) lengths, 0 along an open axis.
    """
    length = np.asarray(period, dtype=float)
    turns = np.rint(np.divide(away, length, out=np.zeros_like(away, dtype=float), where=length > 0.0))
    return away - turns * length


def in_cell(place: np.ndarray, period: ArrayLike, center: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3) points put into the cell about `center`, and (..., 3) whole numbers of cells that each was away."""
    length = np.asarray(period, dtype=float)
    away = place - (np.asarray(center, dtype=float) - 0.5 * length)
    image = np.floor(np.divide(away, length, out=np.zeros_like(away), where=length > 0.0))
    return place - image * length, image.astype(np.int32)


def ghosts_of(centres: np.ndarray, radii: np.ndarray, period: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Images of spheres that others may touch across a boundary of the cell, with the spheres as they are.

    Args:
        centres: (n, 3), anywhere.
        radii: (n,).
        period: (3,) lengths, 0 along an open axis.

    Returns:
        (m,) which sphere, and (m, 3) its shift. A pair that touches by any of its images does so once among spheres
        and ghosts, or more often.
    """
    which, shift = np.arange(len(centres)), np.zeros((len(centres), 3))
    for axis, length in enumerate(np.asarray(period, dtype=float)):
        if length > 0.0 and len(centres):
            x = centres[which, axis] + shift[:, axis]
            low, reach = x.min(), 2.0 * radii.max()
            # all into one cell, and the lowest once more above it
            turned = -np.floor((x - low) / length) * length
            shift[:, axis] += turned
            near = x + turned - low < reach
            more = shift[near].copy()
            more[:, axis] += length
            which, shift = np.append(which, which[near]), np.concatenate([shift, more])
    return which, shift
