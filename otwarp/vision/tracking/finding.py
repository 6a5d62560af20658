"""Bodies in a frame: where the image differs from its background, and pieces of it to look at more closely."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from otwarp.errors import InputError

THRESHOLD = 8.0
"""Standard deviations of the smoothed contrast of an empty frame, above which something is there."""

FAINTEST = 0.01
"""Contrast below which nothing counts, of an image without noise."""


@dataclass(frozen=True)
class Found:
    """Something in a frame.

    Attributes:
        x, y: Its centre [pixels], of contrast squared; the first pixel's middle is 0, row 0 is the lowest.
        left, low, right, high: Columns and rows of the box around it, the last ones not in it.
        contrast: Root mean square difference from the background, relative to it.
        length, width: Of an ellipse with the same second moments, four standard deviations [pixels].
        azimuth: Of the ellipse, from x towards y [rad].
    """

    x: float
    y: float
    left: int
    low: int
    right: int
    high: int
    contrast: float
    length: float
    width: float
    azimuth: float


def find(
    frame: np.ndarray, *, scale: float = 4.0, smallest: float = 6.0, threshold: float = THRESHOLD, join: float = 0.0
) -> list[Found]:
    """Bodies in a frame, from the left to the right.

    The squared contrast is smoothed, and what exceeds that of the noise is parted into connected pieces; bodies whose
    fringes touch are one piece.

    Args:
        frame: (height, width) grey levels or intensities; most of it is background.
        scale: Width of the smoothing [pixels], that of a fringe.
        smallest: Least side of a box [pixels].
        threshold: Standard deviations above an empty frame.
        join: Distance up to which pieces are one body, as the spheres of a robot without rods [pixels].

    Raises:
        InputError: No image, or numbers out of range.
    """
    image = np.asarray(frame, dtype=float)
    if image.ndim != 2 or min(image.shape) < 8 or not np.all(np.isfinite(image)):
        raise InputError(f"frame has shape {image.shape}; allowed: an image of at least 8 × 8 pixels, finite")
    for name, value in (("scale", scale), ("smallest", smallest), ("threshold", threshold)):
        if not 0.0 < value < 1e6:
            raise InputError(f"{name} is {value:g}; allowed: above 0")
    if not 0.0 <= join < 1e6:
        raise InputError(f"join is {join:g}; allowed: 0 or more")
    background = float(np.median(image))
    if background <= 0.0:
        raise InputError(f"background of the frame is {background:g}; allowed: above 0, bright field")
    contrast = image / background - 1.0
    noise = max(_noise(contrast), FAINTEST / threshold)
    energy = ndimage.gaussian_filter(contrast**2, scale, mode="nearest")
    # a Gaussian of this width averages 4π scale² squares, each of which scatters by √2 of its mean
    level = noise**2 * (1.0 + threshold * math.sqrt(2.0 / (4.0 * math.pi * scale**2)))
    there = ndimage.binary_fill_holes(energy > level)
    near = there if join == 0.0 else ndimage.distance_transform_edt(~there) <= 0.5 * join  # type: ignore[operator]
    pieces = ndimage.label(near)[0] * there  # type: ignore[index]
    found = []
    for n, box in enumerate(ndimage.find_objects(pieces), start=1):
        if box is None or min(s.stop - s.start for s in box) < smallest:
            continue
        weight = np.where(pieces[box] == n, np.maximum(contrast[box] ** 2 - noise**2, 0.0), 0.0)
        if weight.sum() > 0.0:
            found.append(_found(weight, int((pieces[box] == n).sum()), box))
    return sorted(found, key=lambda f: f.x)


def _noise(contrast: np.ndarray) -> float:
    """Standard deviation of the noise, from differences of neighbours, most of which are background."""
    across = np.abs(np.diff(contrast, axis=1))
    return float(np.median(across)) / (0.6745 * math.sqrt(2.0))


def _found(weight: np.ndarray, area: int, box: tuple[slice, slice]) -> Found:
    total = float(weight.sum())
    rows, columns = np.mgrid[box]
    x, y = float((weight * columns).sum()) / total, float((weight * rows).sum()) / total
    xx = float((weight * (columns - x) ** 2).sum()) / total
    yy = float((weight * (rows - y) ** 2).sum()) / total
    xy = float((weight * (columns - x) * (rows - y)).sum()) / total
    mean, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    return Found(
        x, y, box[1].start, box[0].start, box[1].stop, box[0].stop, math.sqrt(total / area),
        4.0 * math.sqrt(mean + half), 4.0 * math.sqrt(max(mean - half, 0.0)), 0.5 * math.atan2(2.0 * xy, xx - yy),
    )  # fmt: skip


def crop(
    frame: np.ndarray, x: float, y: float, width: int, height: int | None = None
) -> tuple[np.ndarray, tuple[int, int]]:
    """A piece of a frame around a point, and the column and row of the piece's middle pixel in the frame.

    The middle is pixel (width // 2, height // 2), as in rendered images. Beyond the frame is its median.

    Args:
        frame: (rows, columns).
        x, y: [pixels].
        width, height: Of the piece [pixels]; a square where only one is given.

    Raises:
        InputError: A point outside the frame, or a piece without pixels.
    """
    rows, columns = frame.shape
    high = width if height is None else height
    if width < 1 or high < 1:
        raise InputError(f"size of a piece is {width} × {high}; allowed: 1 or more pixels")
    if not (-0.5 <= x <= columns - 0.5 and -0.5 <= y <= rows - 0.5):
        raise InputError(f"middle of a piece is ({x:g}, {y:g}); allowed: within {columns} × {rows} pixels")
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    left, low = column - width // 2, row - high // 2
    if left >= 0 and low >= 0 and left + width <= columns and low + high <= rows:
        # the median of a whole frame takes longer than to look at a piece
        return frame[low : low + high, left : left + width].copy(), (column, row)
    piece = np.full((high, width), np.median(frame), dtype=frame.dtype)
    inside_rows = slice(max(low, 0), min(low + high, rows))
    inside_columns = slice(max(left, 0), min(left + width, columns))
    piece[
        inside_rows.start - low : inside_rows.stop - low, inside_columns.start - left : inside_columns.stop - left
    ] = frame[inside_rows, inside_columns]
    return piece, (column, row)
