"""How many points of the condenser an image needs, and how far around it light must be computed.

Both follow from one length, the *reach*: how far light that matters in a plane has gone sideways from the solid that
scattered it. In the sum over source points, of directions k₀, light that came r sideways of where the wave of the
source passes through the solid interferes with the phase k₀·r. The sum over a lattice of directions that are Δk apart
is large not for r = 0 alone, but for r = 2π/Δk, too: there fringes show that the whole condenser would wash out. So
must 2π/Δk be beyond the reach; on every second direction of a square that repeats after L it is L/√2, on every fourth
L/2. And L itself must be so large that the copies of the solids, L away, do not reach into the image.

What is scattered by angles up to 50° matters near a solid; further away it has spread, and light at smaller angles is
what is left. The numbers below hold the error of either, a root mean square over that of the contrast, to about 0.05 in
the worst plane for spheres of 0.5 to 2.5 µm and indices of 1.38 to 1.59: `python -m benchmarks.vision`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from otwarp.vision.microscope import Microscope
from otwarp.vision.specimen import Specimen

NEAR, FAR = 1.25, (5.5, 0.4)
"""Reach over distance near a solid; and line (µm, slope) that it does not exceed far away."""

COPIES = 0.65
"""That slope for copies of the solids in the squares beside: what they add to an image cancels nowhere."""

BEYOND = 3.0
"""Of planes above and below a specimen that are looked at if nobody says which [µm]."""

LEAST = 1.0
"""Of margins [µm]: light passes solids that touch the edge of an image."""

RINGS = 1.25
"""By how much closer points on rings must be than those of a lattice, for the same error."""

DENSITIES = tuple(sorted({n * n for n in range(1, 33)} | {2 * n * n for n in range(1, 23)}))
"""Of how many directions a lattice has one: squares, along the axes and along the diagonals."""


def distances(specimen: Specimen, focus: Sequence[float] | np.ndarray) -> np.ndarray:
    """(f) largest distance of each plane from the middle of a solid [µm]."""
    planes = np.asarray(focus, dtype=float)
    if not len(specimen):
        return np.zeros(len(planes))
    middles = np.concatenate([specimen.start[:, 2], specimen.end[:, 2]])
    return np.maximum(np.abs(middles.max() - planes), np.abs(planes - middles.min()))


def usual_planes(specimen: Specimen) -> np.ndarray:
    """(2) heights between which a specimen is looked at if nobody says where [µm]."""
    if not len(specimen):
        return np.zeros(2)
    return np.array([specimen.low[2] - BEYOND, specimen.high[2] + BEYOND])


def reaches(
    microscope: Microscope, specimen: Specimen, focus: Sequence[float] | np.ndarray, *, slope: float = FAR[1]
) -> np.ndarray:
    """(f) how far light that matters in each plane has gone sideways [µm]; `slope` is of it far away."""
    if not len(specimen):
        return np.zeros(len(focus))
    far = distances(specimen, focus)
    steepest = microscope.condenser_aperture, min(microscope.numerical_aperture, 0.99 * microscope.medium_index)
    most = sum(math.tan(math.asin(a / microscope.medium_index)) for a in steepest)
    size = 1.5 + max(1.5, float(specimen.radius.max()))
    return size + np.minimum(min(NEAR, most) * far, FAR[0] + slope * far)


def margin_needed(
    microscope: Microscope,
    specimen: Specimen,
    width: int,
    height: int,
    focus: Sequence[float] | np.ndarray,
    *,
    lattice: bool = True,
) -> float:
    """Margin around an image [µm] that holds all solids in it, and their copies so far away that they do not reach it.

    Args:
        microscope: All of it.
        specimen: Relative to the optical axis.
        width, height: Of the image [pixels].
        focus: (f) heights of the planes [µm].
        lattice: Whether the square may be larger than it must, where it then does with fewer source points.
    """
    half = 0.5 * max(width, height) * microscope.pixel
    if not len(specimen) or not len(focus):
        return LEAST
    low, high = (corner[:, :2] for corner in specimen.boxes())
    in_it = np.all((high > -half) & (low < half), axis=1)
    edge = max(np.abs(corner[in_it]).max(initial=0.0) for corner in (low, high))
    ends = np.abs(np.concatenate([specimen.start[:, :2], specimen.end[:, :2]])).max()
    gap = float(reaches(microscope, specimen, focus, slope=COPIES).max())
    side = max(2.0 * (half + LEAST), 2.0 * float(edge), half + min(float(ends), half) + gap)
    if lattice and microscope.condenser_aperture > 0.0:
        reach = float(reaches(microscope, specimen, focus).max())
        sides = [max(side, reach * math.sqrt(d)) for d in DENSITIES[:8]]
        side = min(sides, key=lambda s: s**4 / density(s, reach))  # points × time of a transform
    return 0.5 * side - half


def density(side: float, reach: float) -> int:
    """Of how many directions of a square's spectrum one is enough."""
    return max((d for d in DENSITIES if side / math.sqrt(d) >= reach * (1.0 - 1e-9)), default=1)


def rings_needed(microscope: Microscope, reach: float) -> int:
    """Of rings of source points, for the same error as a lattice of that reach [µm]."""
    return max(1, math.ceil(RINGS * reach * microscope.condenser_aperture / microscope.wavelength - 0.5))


def points_needed(microscope: Microscope, side: float, reach: float) -> int:
    """About how many points of a lattice light a square of a `side` for a `reach` [µm], before any are made."""
    inner = microscope.condenser_inner if microscope.condenser == "annulus" else 0.0
    opening = math.pi * (microscope.condenser_aperture**2 - inner**2) * (side / microscope.wavelength) ** 2
    return max(1, round(opening / density(side, reach)))
