"""Köhler illumination: plane waves from the points of the condenser's opening, which do not interfere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.microscope import Microscope


@dataclass(frozen=True, eq=False)
class Illumination:
    """Plane waves of unit amplitude.

    Attributes:
        steps: (s, 2) int, their transverse wavenumbers (x, y) in steps of the grid's spectrum.
        weights: (s) share of the light, 1 in all.
    """

    steps: np.ndarray
    weights: np.ndarray


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
        return Illumination(np.array([[_nearest(o / step) for o in off]]), np.ones(1))
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


def _ring(radius: float, count: int, azimuth: float, weight: float) -> list[tuple[float, float, float]]:
    angles = azimuth + 2.0 * math.pi * (np.arange(count) + 0.5) / count
    return [(radius * math.cos(a), radius * math.sin(a), weight) for a in angles]


def _nearest(value: float) -> int:
    """Rounded away from zero at halves, so that mirrored points stay mirrored; rounding errors count as halves."""
    return int(math.copysign(math.floor(abs(value) + 0.5 + 1e-9), value))
