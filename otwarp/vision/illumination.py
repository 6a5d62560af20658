"""Köhler illumination: plane waves from the points of the condenser's opening, which do not interfere."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.microscope import Microscope
from otwarp.vision.sampling import DENSITIES, density

FEWEST = 24
"""Points of a lattice, at least, where the spectrum has so many within the opening."""

FINE = 32
"""Squares of a side in which the share of a lattice's cell within the opening is counted."""


@dataclass(frozen=True, eq=False)
class Illumination:
    """Plane waves of unit amplitude.

    Attributes:
        steps: (s, 2) int, their transverse wavenumbers (x, y) in steps of the grid's spectrum.
        weights: (s) share of the light, 1 in all.
        sparser: Fewer of these points that do for planes nearer to the specimen: weights of the first of them, and the
            reach for which they do [µm], from most points to fewest; the last are there for comparison alone.
        reach: For which all of them do [µm], as `otwarp.vision.sampling` has it.

    Arrays are read-only: images that need the same light share it.
    """

    steps: np.ndarray
    weights: np.ndarray
    sparser: tuple[tuple[np.ndarray, float], ...] = ()
    reach: float = math.inf

    def __post_init__(self) -> None:
        for array in (self.steps, self.weights, *(weights for weights, _ in self.sparser)):
            array.flags.writeable = False

    def enough(self, reach: float) -> Illumination:
        """As few of the points, the first ones, as do for a reach [µm]."""
        return next(
            (self.first(len(w)) for w, held in reversed(self.sparser[:-1]) if held >= reach * (1.0 - 1e-9)), self
        )

    def halved(self) -> Illumination | None:
        """Every second of the points; None where they have no order."""
        return self.first(len(self.sparser[0][0])) if self.sparser else None

    def first(self, count: int) -> Illumination:
        """The first points, as many as one of the sparser ones has."""
        n = next(n for n, (weights, _) in enumerate(self.sparser) if len(weights) == count)
        weights, reach = self.sparser[n]
        return Illumination(self.steps[:count], weights, self.sparser[n + 1 :], reach)


@functools.lru_cache(maxsize=64)
def illumination(microscope: Microscope, length: float, *, rings: int = 4, azimuth: float = 0.0) -> Illumination:
    """Points on symmetric rings over the condenser's opening, each of equal share, moved to the grid's spectrum.

    Rings of 1, 6, 12, 18, … points stand for a disc (61 with 4 rings, 91 with 5); an annulus has those rings that lie
    in it. Points that meet on the grid become one with the weight of both, and every point has its mirror images
    across both axes and the diagonals of the hexagon as far as the grid allows.

    Args:
        microscope: Whose condenser.
        length: Of the grid, after which it repeats [µm].
        rings: Around the middle point.
        azimuth: By which all rings are turned [rad].

    Raises:
        InputError: An annulus between rings.
    """
    step, off = microscope.wavelength / length, (microscope.condenser_x, microscope.condenser_y)
    if microscope.condenser_aperture <= 0.0:
        return _coherent(off, step)
    if rings < 1:
        raise InputError(f"rings is {rings}; allowed: 1 or more where the condenser is open")
    outer = microscope.condenser_aperture
    inner = microscope.condenser_inner if microscope.condenser == "annulus" else 0.0
    points: list[tuple[float, float, float]] = []
    if microscope.condenser == "disc":
        # ring j stands for the annulus of its share of the area: 6j points of 1 + 3R(R + 1)
        total = 1 + 3 * rings * (rings + 1)
        points.append((0.0, 0.0, 1.0 / total))
        for j in range(1, rings + 1):
            low, high = (1 + 3 * (j - 1) * j) / total, (1 + 3 * j * (j + 1)) / total
            points += _ring(outer * math.sqrt(0.5 * (low + high)), 6 * j, azimuth, 1.0 / total)
    else:
        for j in range(rings):
            square = inner**2 + (outer**2 - inner**2) * (j + 0.5) / rings
            points += _ring(math.sqrt(square), 24, azimuth, 1.0 / (24 * rings))
    found: dict[tuple[int, int], float] = {}
    for x, y, weight in points:
        key = (_nearest((x + off[0]) / step), _nearest((y + off[1]) / step))
        found[key] = found.get(key, 0.0) + weight
    return Illumination(np.array(list(found)), np.array(list(found.values())))


def lattice(microscope: Microscope, length: float, reach: float) -> Illumination:
    """Evenly spaced directions of the grid's spectrum, as few as a reach needs, weighted by their share of the opening.

    They lie on a square lattice, along the axes or the diagonals, which has all symmetries of the grid; its cells at
    the edge of the opening count as far as they are within it, so that the sum is exact for light that varies slowly
    from point to point. Lattices are nested: every second point of one is the next sparser one. Where direct light
    must pass, or miss, a ring in the objective, there are whole points within the opening alone.

    Args:
        microscope: Whose condenser.
        length: Of the grid, after which it repeats [µm].
        reach: How far light that matters goes sideways [µm].
    """
    return _lattice(microscope, length, density(length, reach))


@functools.lru_cache(maxsize=64)  # a pose of thousands needs the light of the one before
def _lattice(microscope: Microscope, length: float, each: int) -> Illumination:
    """The lattice of one of `each` directions, and all sparser ones."""
    step, off = microscope.wavelength / length, (microscope.condenser_x, microscope.condenser_y)
    if microscope.condenser_aperture <= 0.0:
        return _coherent(off, step)
    whole = microscope.condenser == "annulus" or microscope.contrast in ("phaseContrast", "darkField")
    points = _cells(microscope, step, each, whole)
    while len(points) < FEWEST and each > 1:
        each = max(d for d in DENSITIES if d < each)
        points = _cells(microscope, step, each, whole)
    levels = [(each, points)]
    while len(points) >= FEWEST:
        each *= 2
        points = _cells(microscope, step, each, whole)
        levels.append((each, points))
    order = list(dict.fromkeys(key for _, points in reversed(levels) for key in points))
    place = {key: n for n, key in enumerate(order)}
    nested = []
    for each, points in levels:
        weights = np.zeros(1 + max(place[key] for key in points))
        weights[[place[key] for key in points]] = list(points.values())
        nested.append((weights, length / math.sqrt(each)))
    return Illumination(np.array(order), nested[0][0], tuple(nested[1:]), nested[0][1])


def _cells(microscope: Microscope, step: float, each: int, whole: bool) -> dict[tuple[int, int], float]:
    """Points of a lattice with one of `each` directions, and their shares of the light.

    Args:
        microscope: Whose condenser.
        step: Of the spectrum, as an aperture.
        each: Square of a whole number for a lattice along the axes, twice that for one along the diagonals.
        whole: Whether points count wholly or not at all.
    """
    inner = microscope.condenser_inner / step if microscope.condenser == "annulus" else -1.0
    outer = microscope.condenser_aperture / step
    off = np.array([microscope.condenser_x, microscope.condenser_y]) / step
    side = math.isqrt(each)
    diagonal = side * side != each
    side = math.isqrt(each // 2) if diagonal else side
    most = math.floor((outer + np.abs(off).max()) / side + 2.0)
    x, y = (side * a.ravel() for a in np.meshgrid(*(np.arange(-most, most + 1),) * 2))
    if diagonal:
        even = (x + y) // side % 2 == 0
        x, y = x[even], y[even]
    if whole:
        radius = np.hypot(x - off[0], y - off[1])
        share = ((radius >= inner - 1e-9) & (radius <= outer + 1e-9)).astype(float)
    else:
        share = _within(x - off[0], y - off[1], outer, side, diagonal)
    # waves of a sparse lattice may be steeper than the opening, but not than the medium lets through
    share *= np.hypot(x, y) * step < 0.98 * microscope.medium_index
    some = np.flatnonzero(share > 0.0)
    keys = zip(x[some].tolist(), y[some].tolist(), strict=True)
    return dict(zip(keys, (share[some] / share[some].sum()).tolist(), strict=True))


def _within(x: np.ndarray, y: np.ndarray, outer: float, side: int, diagonal: bool) -> np.ndarray:
    """Share of each point's cell that is within a disc: squares of side `side`, or turned, of half diagonal `side`."""
    across = (np.arange(FINE) + 0.5) / FINE - 0.5
    u, v = (a.ravel() for a in np.meshgrid(across, across))
    right, up = (side * (u - v), side * (u + v)) if diagonal else (side * u, side * v)
    share = (np.hypot(x, y) <= outer).astype(float)
    edge = np.flatnonzero(np.abs(np.hypot(x, y) - outer) <= side)  # of all others the cell is within, or is not
    away = np.hypot(x[edge, None] + right, y[edge, None] + up)
    share[edge] = np.mean(away <= outer, axis=1)
    return share


def _coherent(off: tuple[float, float], step: float) -> Illumination:
    return Illumination(np.array([[_nearest(o / step) for o in off]]), np.ones(1))


def _ring(radius: float, count: int, azimuth: float, weight: float) -> list[tuple[float, float, float]]:
    angles = azimuth + 2.0 * math.pi * (np.arange(count) + 0.5) / count
    return [(radius * math.cos(a), radius * math.sin(a), weight) for a in angles]


def _nearest(value: float) -> int:
    """Rounded away from zero at halves, so that mirrored points stay mirrored; rounding errors count as halves."""
    return int(math.copysign(math.floor(abs(value) + 0.5 + 1e-9), value))
