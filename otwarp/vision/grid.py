"""The grids of an image: how finely light is computed, how finely it is looked at, and how far around."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len

from otwarp.errors import InputError
from otwarp.vision.microscope import Microscope


@dataclass(frozen=True)
class Grid:
    """A square around the optical axis that repeats; pixel (0, 0) of every array is its lower left corner.

    Attributes:
        width, height: Pixels of the image.
        pixels: Along each side of the square; the image is its middle.
        cells: Points along each side where light is computed.
        pixel: Size of a pixel [µm].
    """

    width: int
    height: int
    pixels: int
    cells: int
    pixel: float

    @property
    def length(self) -> float:
        """Side of the square [µm]."""
        return self.pixels * self.pixel

    @property
    def spacing(self) -> float:
        """Between points where light is computed [µm]."""
        return self.length / self.cells

    def wavenumbers(self) -> tuple[np.ndarray, np.ndarray]:
        """Transverse wavenumbers (x along rows, y along columns) of the spectrum [1/µm], each (cells, cells)."""
        q = 2.0 * math.pi * np.fft.fftfreq(self.cells, self.spacing)
        return np.broadcast_to(q[None, :], (self.cells,) * 2), np.broadcast_to(q[:, None], (self.cells,) * 2)

    def image(self, whole: np.ndarray) -> np.ndarray:
        """(…, height, width) middle of (…, pixels, pixels): pixel (pixels // 2, pixels // 2), where a specimen's origin
        is, becomes (height // 2, width // 2), also where one number is odd and the other even."""
        x, y = self.pixels // 2 - self.width // 2, self.pixels // 2 - self.height // 2
        return whole[..., y : y + self.height, x : x + self.width]


def grid_of(
    microscope: Microscope, width: int, height: int | None = None, *, margin: float = 3.0, spacing: float | None = None
) -> Grid:
    """The grids for an image of so many pixels.

    Args:
        microscope: Its pixel and wavelength.
        width, height: Of the image, in pixels; a square where only one is given.
        margin: Around the image [µm]: light that leaves the square comes in again on the other side.
        spacing: Largest distance of points where light is computed [µm]; None: 0.29 wavelengths in vacuum, which
            holds all waves that travel in indices up to 1.7.

    Raises:
        InputError: An image without pixels, or too many points.
    """
    high = width if height is None else height
    for name, value in (("width", width), ("height", high)):
        if not 1 <= value <= 8192:
            raise InputError(f"{name} of the image is {value} pixels; allowed: 1 to 8192")
    if not (math.isfinite(margin) and margin >= 0.0):
        raise InputError(f"margin is {margin:g} µm; allowed: 0 or more")
    pixels = max(width, high) + 2 * math.ceil(margin / microscope.pixel)
    pixels = _fast(pixels)
    finest = 0.29 * microscope.wavelength if spacing is None else spacing
    cells = _fast(math.ceil(pixels * microscope.pixel / finest))
    return Grid(width, high, pixels, cells, microscope.pixel)


def axial_wavenumbers(k: float, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Axial wavenumber of every component of the spectrum [1/µm], 0 where it fades; and whether it travels."""
    x, y = grid.wavenumbers()
    square = k * k - x * x - y * y
    return np.sqrt(np.maximum(square, 0.0)), square > 0.0


def _fast(count: int) -> int:
    """The next larger number of points whose Fourier transform is quick."""
    found = next_fast_len(count)
    assert found is not None
    return int(found)
