"""Size of a pixel from one image of a square grid of dots."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from otwarp.errors import InputError
from otwarp.vision.calibration.measured import Measured

FEWEST = 9
"""Dots that a grid must have in the image."""


def pixel_of_grid(image: np.ndarray, pitch: float, *, authored: float | None = None) -> tuple[Measured, Measured]:
    """Size of a pixel, and how the grid is turned against the camera.

    Dots are found where the image differs from its background, their centres as centroids of that difference; a
    lattice of two free vectors is fitted to all of them by least squares, and the size of a pixel is what makes the
    mean of their lengths the pitch.

    Args:
        image: (height, width) any brightness; dots of one kind, farther apart than they are wide.
        pitch: Distance of neighbouring dots [µm].
        authored: Size of a pixel that the image was made with [µm].

    Returns:
        Pixel [µm], and angle [deg] between −45 and 45.

    Raises:
        InputError: No grid in the image.
    """
    place = dots(image)
    origin, first = _guess(place)
    turned = (place - origin) @ np.array([first, [-first[1], first[0]]]).T / (first @ first)
    steps = np.rint(turned)
    good = np.abs(turned - steps).max(axis=1) < 0.3
    if good.sum() < FEWEST:
        raise InputError(f"the image has {int(good.sum())} dots of a square grid; allowed: {FEWEST} or more")
    steps, place = steps[good], place[good]
    design = np.column_stack([np.ones(len(steps)), steps])
    found, *_ = np.linalg.lstsq(design, place, rcond=None)
    freedom = 2 * len(steps) - 6
    scatter = float(np.sum((place - design @ found) ** 2)) / freedom
    spread = np.linalg.inv(design.T @ design)
    a, b = found[1], found[2]
    length = 0.5 * (np.hypot(*a) + np.hypot(*b))
    # both lengths err by their own step's share of the scatter
    error = 0.5 * np.sqrt(scatter * (spread[1, 1] + spread[2, 2]))
    angle = np.degrees(np.arctan2(a[1] - b[0], a[0] + b[1]))
    pixel = pitch / length
    return (
        Measured.of(
            pixel, pixel * error / length, freedom, "um", "size of a pixel, from a grid of known pitch", authored
        ),
        Measured.of(angle, np.degrees(error / length), freedom, "deg", "turn of the grid against the camera"),
    )


def dots(image: np.ndarray) -> np.ndarray:
    """(k, 2) centres (x, y) of dots that lie wholly in the image [pixels].

    Raises:
        InputError: There are fewer than a grid needs.
    """
    light = np.asarray(image, dtype=float)
    away = ndimage.gaussian_filter(np.abs(light - np.median(light)), 1.5)
    away = np.maximum(away - 0.35 * away.max(), 0.0)
    labelled: Any = ndimage.label(away > 0.0)
    regions, count = labelled
    if count < FEWEST:
        raise InputError(f"the image has {count} dots; allowed: {FEWEST} or more")
    numbers = np.arange(1, count + 1)
    centers = np.array(ndimage.center_of_mass(away, regions, numbers))[:, ::-1]
    weight = ndimage.sum_labels(away, regions, numbers)
    edge = np.unique(np.concatenate([regions[0], regions[-1], regions[:, 0], regions[:, -1]]))
    whole = ~np.isin(numbers, edge) & (weight > 0.3 * np.median(weight)) & (weight < 3.0 * np.median(weight))
    return centers[whole]


def _guess(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A dot in the middle, and the step to its neighbour that is nearest to the direction of x."""
    if len(place) < FEWEST:
        raise InputError(f"the image has {len(place)} whole dots; allowed: {FEWEST} or more")
    origin = place[np.argmin(np.hypot(*(place - place.mean(axis=0)).T))]
    away = place - origin
    length = np.hypot(*away.T)
    nearest = np.min(length[length > 0.0])
    ring = away[(length > 0.0) & (length < 1.2 * nearest)]
    # a quarter turn of a square grid is itself: all neighbours, turned to within 45° of x, are the same step
    turns = ring[:, 0] + 1j * ring[:, 1]
    phase = np.angle(np.sum(turns**4 / np.abs(turns) ** 3)) / 4.0
    return origin, np.mean(np.abs(turns)) * np.array([np.cos(phase), np.sin(phase)])
