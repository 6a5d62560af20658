"""The objective's pupil: what it passes, how it weighs, and its wavefront error."""

from __future__ import annotations

import math

import numpy as np

from otwarp.vision.grid import Grid, axial_wavenumbers
from otwarp.vision.illumination import Illumination
from otwarp.vision.microscope import Microscope


def pupil(microscope: Microscope, grid: Grid) -> np.ndarray:
    """(cells, cells) complex transmission for plane waves of the medium: 0 beyond the aperture, √cos θ within.

    √cos θ is what an aplanatic objective makes of a plane wave's amplitude (Richards and Wolf 1959,
    doi:10.1098/rspa.1959.0200): the light that crosses a plane in the object crosses it in the image.

    For phase contrast a ring where the condenser's opening is imaged passes the share T of light and delays it by
    δ wavelengths, √T e^{2πiδ} (Zernike 1942, Physica 9, 686, doi:10.1016/S0031-8914(42)80035-X): a weak phase φ that
    sends its light past the ring has the intensity 1 + 2φ sin(2πδ)/√T. The ring is wider than the opening by 0.71 steps
    of the grid on either side, by which points of the condenser are moved at most.
    """
    x, y = grid.wavenumbers()
    axial, _ = axial_wavenumbers(microscope.wavenumber, grid)
    passed = np.hypot(x, y) <= microscope.cutoff
    amplitude = np.sqrt(axial / microscope.wavenumber) * np.exp(1j * wavefront(microscope, grid))
    if microscope.contrast == "phaseContrast":
        delayed = math.sqrt(microscope.ring_transmission) * np.exp(2j * math.pi * microscope.ring_delay)
        amplitude[_in_ring(microscope, grid)] *= delayed
    return np.where(passed, amplitude, 0.0)


def _in_ring(microscope: Microscope, grid: Grid) -> np.ndarray:
    """(cells, cells) where direct light crosses the pupil."""
    vacuum = 2.0 * math.pi / microscope.wavelength
    x, y = grid.wavenumbers()
    aperture = np.hypot(x / vacuum - microscope.condenser_x, y / vacuum - microscope.condenser_y)
    inner = microscope.condenser_inner if microscope.condenser == "annulus" else 0.0
    moved = (math.sqrt(0.5) + 1e-6) * microscope.wavelength / grid.length
    return (aperture >= inner - moved) & (aperture <= microscope.condenser_aperture + moved)


def sheared(microscope: Microscope, light: Illumination, x: np.ndarray, y: np.ndarray, step: float) -> np.ndarray:
    """(s, …) what differential interference contrast makes of plane waves behind the specimen, but for a factor i.

    A prism behind the objective subtracts the image moved by half the shear s one way from that moved the other way,
    with the bias b between them; a prism before the condenser has sheared its light by as much, so that light which
    meets nothing has the phase b wherever it comes from:

        U(k) ← sin((k − k₀)·s/2 + b/2) U(k),  k₀ the wave of the source.

    The difference is coherent (Mehta and Sheppard 2008, doi:10.1364/OE.16.019462); a phase φ that is slow over the
    shear has the intensity sin²((s·∇φ + b)/2).

    Args:
        microscope: With shear, its angle, and bias.
        light: The sources.
        x, y: (…) transverse wavenumbers [1/µm].
        step: Of the grid's spectrum [1/µm].
    """
    along = microscope.shear * np.array([math.cos(microscope.shear_angle), math.sin(microscope.shear_angle)])
    own = (light.steps @ along * step).reshape(-1, *(1,) * np.ndim(x))
    return np.sin(0.5 * (x * along[0] + y * along[1] - own) + math.pi * microscope.bias)


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
