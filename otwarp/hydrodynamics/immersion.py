"""Spheres that touch no liquid."""

from __future__ import annotations

import numpy as np

IMMERSION_TOLERANCE = 1e-12
"""Relative overhang below which a sphere counts as inside another: rounding of authored coordinates."""


def outermost_spheres(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Indices of the spheres that are not inside another one; of coincident equal spheres the first stays."""
    distance = np.linalg.norm(centres[:, None, :] - centres[None, :, :], axis=-1)
    inside = distance + radii[:, None] <= radii[None, :] * (1.0 + IMMERSION_TOLERANCE)  # [i, j]: i is inside j
    # Two spheres inside each other are equal: the earlier one swallows the later.
    earlier = np.arange(len(radii))[None, :] < np.arange(len(radii))[:, None]
    swallowed = inside & (~inside.T | earlier)
    np.fill_diagonal(swallowed, False)
    return np.flatnonzero(~swallowed.any(axis=1))
