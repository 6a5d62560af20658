"""The objective's pupil: what it passes, how it weighs, and its wavefront error."""

from __future__ import annotations

import math

import numpy as np

from otwarp.vision.grid import Grid
from otwarp.vision.illumination import Illumination
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import axial_wavenumbers


def pupil(microscope: Microscope, grid: Grid) -> np.ndarray:
    """(cells, cells) complex transmission for plane waves of the medium: 0 beyond the aperture, √cos θ within.

    √cos θ is what an aplanatic objective makes of a plane wave's amplitude (Richards and Wolf 1959,
    doi:10.1098/rspa.1959.0200): the light that crosses a plane in the object crosses it in the image.
    """
    x, y = grid.wavenumbers()
    axial, _ = axial_wavenumbers(microscope.wavenumber, grid)
    passed = np.hypot(x, y) <= microscope.cutoff
    return np.where(passed, np.sqrt(axial / microscope.wavenumber) * np.exp(1j * wavefront(microscope, grid)), 0.0)


def wavefront(microscope: Microscope, grid: Grid) -> np.ndarray:
    """(cells, cells) wavefront error [rad]: Zernike polynomials, and the interface between liquid and glass.

    A focal plane at depth d below glass of another index is imaged, at its paraxial focus, with the error
    d (k_z − k_z′ n′/n), k_z and k_z′ in liquid (n) and immersion (n′) (Hell et al. 1993,
    doi:10.1111/j.1365-2818.1993.tb03315.x).
    """
    x, y = grid.wavenumbers()
    rho = np.hypot(x, y) * microscope.wavelength / (2.0 * math.pi * microscope.numerical_aperture)
    error = np.zeros_like(rho)
    for noll, rms in microscope.zernike.items():
        error += 2.0 * math.pi * rms * zernike(noll, rho, np.arctan2(y, x))
    if microscope.depth:
        ratio = microscope.immersion_index / microscope.medium_index
        liquid, _ = axial_wavenumbers(microscope.wavenumber, grid)
        glass, _ = axial_wavenumbers(microscope.wavenumber * ratio, grid)
        error += microscope.depth * (liquid - glass * ratio + microscope.wavenumber * (ratio**2 - 1.0))
    return error


def zernike(noll: int, rho: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Zernike polynomial of unit root mean square over the unit disc (Noll 1976, doi:10.1364/JOSA.66.000207).

    Args:
        noll: Its number, from 1: 4 is defocus, 5 and 6 astigmatism, 7 and 8 coma, 11 spherical aberration.
        rho: Radius; the polynomial goes on beyond 1.
        angle: From the x axis [rad].
    """
    n = int((math.sqrt(8 * noll - 7) - 1) / 2)
    rest = noll - n * (n + 1) // 2 - 1
    m = 2 * ((rest + 1) // 2) if n % 2 == 0 else 2 * (rest // 2) + 1
    radial = np.zeros_like(rho)
    for s in range((n - m) // 2 + 1):
        top = (-1) ** s * math.factorial(n - s)
        bottom = math.factorial(s) * math.factorial((n + m) // 2 - s) * math.factorial((n - m) // 2 - s)
        radial += top / bottom * rho ** (n - 2 * s)
    if m == 0:
        return math.sqrt(n + 1) * radial
    return math.sqrt(2 * (n + 1)) * radial * (np.cos(m * angle) if noll % 2 == 0 else np.sin(m * angle))


def background(microscope: Microscope, light: Illumination, grid: Grid) -> np.ndarray:
    """(s) amplitude with which the light of each source would reach the image, were nothing in its way.

    0 where it does not pass the objective, as in dark field.
    """
    rows, columns = light.steps[:, 1] % grid.cells, light.steps[:, 0] % grid.cells
    return np.abs(pupil(microscope, grid)[rows, columns])
