"""Light through a specimen, slice by slice: what leaves it above, as spectra of plane waves.

In every slice light that is inside a solid goes on as in the solid's index, and all other light as in the medium's.
With U the spectrum at the lower face of a slice of thickness h, k_z and k_z′ the axial wavenumbers in medium and
solid, and μ what each cell of the slice counts for, 0 outside and 1 inside,

    U ← e^{i k_z h} U + (e^{i k_z′ h} − e^{i k_z h}) e^{−i k_z h/2} F[ μ F⁻¹[ e^{i k_z h/2} U ] ].

This is the wave propagation method (Brenner and Singer 1993, doi:10.1364/AO.32.004984; with two indices: Schmidt et al.
2016, doi:10.1364/OE.24.030188), but light is divided in the middle of the slice and *before* it goes on, where they
divide it at its end. The order matters: dividing afterwards leaves at the faces of a solid two to four times
the error (`benchmarks/vision_limits.py`), because each share must go on as a whole in an index of its own.

Amplitudes are kept relative to light that meets nothing, so that a slice adds to them and empty slices cost nothing.
Waves that fade within the medium are left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid, axial_wavenumbers
from otwarp.vision.illumination import Illumination
from otwarp.vision.microscope import Microscope
from otwarp.vision.slices import METHODS, Method, pass_in_turn, sliced
from otwarp.vision.slices_together import GROUP_BYTES, Stacks, Waves, pass_together
from otwarp.vision.specimen import Specimen


def propagate(
    specimen: Specimen,
    microscope: Microscope,
    light: Illumination,
    grid: Grid,
    fourier: Fourier,
    *,
    method: Method = "two_index",
    thickness: float = 0.1,
) -> Any:
    """Light that has passed a specimen.

    Args:
        specimen: Relative to the optical axis.
        microscope: Of one wavelength.
        light: Plane waves, each of which passes alone.
        grid: Where.
        fourier: On what.
        method: One of `METHODS`.
        thickness: Of a slice, at most [µm].

    Returns:
        (s, cells, cells) complex64 amplitudes of plane waves, as if they had travelled back to height 0 in the medium;
        1 in the wave that a point of the condenser sends where nothing stands in its way. The origin is the middle
        of the grid.

    Raises:
        InputError: An unknown method, or a specimen outside the grid.
    """
    return propagate_many([specimen], microscope, light, grid, fourier, method=method, thickness=thickness)[0]


def propagate_many(
    specimens: Sequence[Specimen],
    microscope: Microscope,
    light: Illumination,
    grid: Grid,
    fourier: Fourier,
    *,
    method: Method = "two_index",
    thickness: float = 0.1,
) -> Any:
    """Light that has passed each of many specimens, which alone do not fill a GPU; on a CPU one after the other.

    Args:
        specimens: (p) of them, or one body in so many poses.
        microscope, light, grid, fourier, method, thickness: As of `propagate`.

    Returns:
        (p, s, cells, cells) complex64, of each what `propagate` returns, to rounding.

    Raises:
        InputError: As `propagate`.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}; allowed: {', '.join(METHODS)}, mie")
    if not (math.isfinite(thickness) and thickness > 0.0):
        raise InputError(f"thickness of slices is {thickness:g} µm; allowed: above 0")
    sources, here = len(light.weights), components(microscope, grid)
    out = fourier.zeros(len(specimens), sources, grid.cells, grid.cells)
    if fourier.device.is_cpu:
        for p, specimen in enumerate(specimens):
            out[p] = _one(specimen, microscope, light, grid, here, fourier, method, thickness)
        return out
    # neighbours in this order have about as many slices
    heights = [s.high[2] - s.low[2] if len(s) else 0.0 for s in specimens]
    order = sorted(range(len(specimens)), key=heights.__getitem__)
    count = max(1, GROUP_BYTES // (8 * sources * here[0].size ** 2))
    for start in range(0, len(order), count):
        group = order[start : start + count]
        some = [specimens[p] for p in group]
        out[group] = passed_together(some, microscope, light, grid, here, fourier, method, thickness)
    return out


def components(microscope: Microscope, grid: Grid) -> tuple[np.ndarray, ...]:
    """Where waves that travel in the medium stand in a spectrum (cells, cells), side by side: nothing else is kept."""
    reach = min(int(microscope.wavenumber * grid.length / (2.0 * math.pi)), (grid.cells - 1) // 2)
    return np.ix_(*(np.arange(-reach, reach + 1) % grid.cells,) * 2)


def _one(
    specimen: Specimen,
    microscope: Microscope,
    light: Illumination,
    grid: Grid,
    here: tuple[np.ndarray, ...],
    fourier: Fourier,
    method: Method,
    thickness: float,
) -> Any:
    """(s, cells, cells) light that has passed a specimen, of the components `here` of the spectrum."""
    slices = sliced(specimen, grid, fourier, thickness) if len(specimen) else None
    shift = _shift(None if slices is None else slices.corner, grid, here)
    amplitude = _incoming(microscope, light, grid, here, shift, fourier)
    if slices is not None:
        pass_in_turn(specimen, slices, amplitude, microscope, grid, here, fourier, method)
    return _outgoing(amplitude, shift, microscope, grid, here, fourier)


def passed_together(
    specimens: Sequence[Specimen],
    microscope: Microscope,
    light: Illumination,
    grid: Grid,
    here: tuple[np.ndarray, ...],
    fourier: Fourier,
    method: Method,
    thickness: float,
) -> Any:
    """(p, s, cells, cells) light that has passed so few specimens that their spectra fit the device; with torch."""
    solid = [n for n, specimen in enumerate(specimens) if len(specimen)]
    some = [specimens[n] for n in solid]
    stacks = Stacks.of(some, grid, thickness) if some else None
    shift = _shift(None if stacks is None else stacks.corner, grid, here)
    amplitude = _incoming(microscope, light, grid, here, shift, fourier)[None].repeat(len(specimens), 1, 1, 1)
    if stacks is not None:
        waves = Waves.of(microscope, np.unique(np.concatenate([s.index for s in some])), grid, here, fourier)
        passed = amplitude if len(some) == len(specimens) else amplitude[solid]
        pass_together(some, stacks, passed, waves, grid, fourier, method)
        if passed is not amplitude:
            amplitude[solid] = passed
    return _outgoing(amplitude, shift, microscope, grid, here, fourier)


def _shift(corner: tuple[int, int] | None, grid: Grid, here: tuple[np.ndarray, ...]) -> np.ndarray:
    """(b, b) phases of moving the origin to the middle of the first cell of the box around a specimen.

    It is there while light passes.
    """
    at = np.zeros(2) if corner is None else (np.array(corner) + 0.5) * grid.spacing - 0.5 * grid.length
    x, y = (q[here] for q in grid.wavenumbers())
    return x * at[0] + y * at[1]


def _outgoing(
    amplitude: Any,
    shift: np.ndarray,
    microscope: Microscope,
    grid: Grid,
    here: tuple[np.ndarray, ...],
    fourier: Fourier,
) -> Any:
    """(…, cells, cells) spectra of amplitudes (…, b, b), with the origin in the middle of the grid again."""
    travels = axial_wavenumbers(microscope.wavenumber, grid)[1][here]
    amplitude *= fourier.array(np.where(travels, np.exp(-1j * shift), 0.0))
    return fourier.embedded(amplitude, grid.cells)


def _incoming(
    microscope: Microscope,
    light: Illumination,
    grid: Grid,
    here: tuple[np.ndarray, ...],
    shift: np.ndarray,
    fourier: Fourier,
) -> Any:
    """(s, b, b) amplitudes of the light of each source at height 0, their phases turned by `shift` (b, b)."""
    sources, b = len(light.weights), len(shift)
    amplitude = fourier.zeros(sources, b, b)
    if microscope.illumination_curvature:
        curved = _curved(microscope, grid)
        for s in range(sources):
            turned = np.roll(curved, light.steps[s, ::-1], (0, 1))[here]
            amplitude[s] = fourier.array(turned * np.exp(1j * shift))
        return amplitude
    rows, columns = light.steps[:, 1] + b // 2, light.steps[:, 0] + b // 2
    amplitude[np.arange(sources), rows, columns] = fourier.array(np.exp(1j * shift[rows, columns]))
    return amplitude


def _curved(microscope: Microscope, grid: Grid) -> np.ndarray:
    """(n, n) spectrum at height 0 of a wave that diverges from a point of the axis far below.

    The phase is k/2 times curvature and squared distance from the axis, but as smooth as the square repeats.
    """
    x = 2.0 * math.pi * np.arange(grid.cells) / grid.cells
    bend = microscope.wavenumber * microscope.illumination_curvature * (grid.length / (2.0 * math.pi)) ** 2
    line = np.fft.fft(np.exp(1j * bend * (1.0 - np.cos(x)))) / grid.cells
    return line[:, None] * line[None, :]
