"""Size of a pixel from a stuck bead that a stage moves by known steps."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from otwarp.errors import InputError
from otwarp.vision.calibration.measured import Measured

STEPS = 4
"""Of Gauss and Newton's method, each of which leaves a hundredth of the error."""


def pixel_of_steps(
    images: np.ndarray, stage: np.ndarray, *, authored: float | None = None
) -> tuple[Measured, Measured]:
    """Size of a pixel, and how the stage is turned against the camera.

    Displacements are those that lay all images over their mean with the least squares; the complex numbers x + iy of
    image and stage are then fitted by a line, whose slope is magnification and turn.

    Args:
        images: (k, height, width) of one thing that moves with the stage, in one focal plane.
        stage: (k, 2) where the stage was (x, y) [µm].
        authored: Size of a pixel that the images were made with [µm].

    Returns:
        Pixel [µm], and angle [deg].

    Raises:
        InputError: Fewer than four images, or a stage that stood still.
    """
    where = np.asarray(stage, dtype=float)
    if len(images) < 4 or where.shape != (len(images), 2):
        raise InputError(
            f"stage is {where.shape} for {len(images)} images; allowed: four images or more, (x, y) of each"
        )
    moved = where[:, 0] + 1j * where[:, 1]
    if np.ptp(where, axis=0).max() <= 0.0:
        raise InputError("stage stands still; allowed: places that differ")
    seen = displacements(images) @ np.array([1.0, 1j])
    away = moved - moved.mean()
    slope = np.sum(away.conj() * seen) / np.sum(np.abs(away) ** 2)
    rest = seen - seen.mean() - slope * away
    freedom = 2 * len(images) - 4
    error = np.sqrt(np.sum(np.abs(rest) ** 2) / freedom / np.sum(np.abs(away) ** 2))
    pixel = 1.0 / abs(slope)
    return (
        Measured.of(pixel, pixel * error / abs(slope), freedom, "um", "size of a pixel, from known steps of the stage",
                    authored),
        Measured.of(np.degrees(np.angle(slope)), np.degrees(error / abs(slope)), freedom, "deg",
                    "turn of the stage against the camera"),
    )  # fmt: skip


def displacements(images: np.ndarray, rounds: int = 3) -> np.ndarray:
    """(k, 2) by which each image is moved (x, y) against the mean of all [pixels].

    The first guess is the middle of what differs from the background.
    """
    light = np.asarray(images, dtype=float)
    light = light - np.median(light, axis=(1, 2), keepdims=True)
    place = np.array([_middle(page) for page in light])
    place -= place.mean(axis=0)
    for _ in range(rounds):
        mean = np.mean([_moved(page, -by) for page, by in zip(light, place, strict=True)], axis=0)
        place = np.array([_fit(page, mean, by) for page, by in zip(light, place, strict=True)])
        place -= place.mean(axis=0)
    return place


def _middle(page: np.ndarray) -> np.ndarray:
    away = ndimage.gaussian_filter(np.abs(page), 1.5)
    away = np.maximum(away - 0.3 * away.max(), 0.0)
    return np.array(ndimage.center_of_mass(away))[::-1]


def _fit(page: np.ndarray, mean: np.ndarray, start: np.ndarray) -> np.ndarray:
    edge = max(2, min(page.shape) // 16)  # what comes in from beyond the edge is not compared
    inner = (slice(edge, -edge),) * 2
    slope = np.stack([part[inner].ravel() for part in np.gradient(mean)[::-1]], axis=1)
    place = start
    for _ in range(STEPS):  # Gauss and Newton's
        off = (_moved(page, -place) - mean)[inner].ravel()
        place = place - np.linalg.lstsq(slope, off, rcond=None)[0]
    return place


def _moved(page: np.ndarray, by: np.ndarray) -> np.ndarray:
    return ndimage.shift(page, by[::-1], order=5, mode="nearest")
