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
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import warp as wp

from otwarp.errors import InputError
from otwarp.vision.fourier import Corner, Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import Illumination
from otwarp.vision.kernels.advance import add_scattered, add_scattered_by_source, carry, carry_by_source
from otwarp.vision.kernels.voxels import fill_cells
from otwarp.vision.microscope import Microscope
from otwarp.vision.specimen import Specimen

Method = Literal["two_index", "beam", "projection"]
METHODS = ("two_index", "beam", "projection")
"""Rungs of the ladder that take any shape, from the most to the least exact; all cost about the same per slice."""

BATCH_BYTES = 2**20
"""Of the spectra that go through a specimen together on a CPU: so much stays in its cache."""


@dataclass(frozen=True, eq=False)
class Slices:
    """A specimen as slices, of which empty ones are left out.

    Attributes:
        corner: Cell of the grid where the box around the specimen begins (x, y).
        middle: (m) height of the middle of each slice [µm].
        thickness: Of all of them [µm].
        filled: Per index, (m, height, width) share of each cell.
    """

    corner: tuple[int, int]
    middle: np.ndarray
    thickness: float
    filled: dict[float, Any]


def sliced(specimen: Specimen, grid: Grid, fourier: Fourier, thickness: float) -> Slices:
    """Cut a specimen into slices.

    Args:
        specimen: With the optical axis at x = y = 0.
        grid: Its square must hold the specimen.
        fourier: Where.
        thickness: Of a slice, at most [µm].

    Raises:
        InputError: The specimen reaches beyond the square.
    """
    low, high = specimen.low, specimen.high
    half, dx = 0.5 * grid.length, grid.spacing
    if np.any(low[:2] < -half) or np.any(high[:2] > half):
        worst = max(np.abs(low[:2]).max(), np.abs(high[:2]).max())
        raise InputError(f"the specimen reaches {worst:.3g} µm from the optical axis; allowed: up to {half:.3g} µm, "
                         "the image and its margin")  # fmt: skip
    first = np.floor((low[:2] + half) / dx).astype(int)
    count = np.ceil((high[:2] + half) / dx).astype(int) - first
    layers = max(1, math.ceil((high[2] - low[2]) / thickness - 1e-9))
    h = (high[2] - low[2]) / layers
    corner = wp.vec3(*(first * dx - half), low[2])
    size = wp.vec3(dx, dx, h)
    filled, device = {}, fourier.device
    for index in specimen.indices():
        mine = specimen.index == index
        solids = [wp.array(a[mine], dtype=wp.vec3, device=device) for a in (specimen.start, specimen.end)]
        radius = wp.array(specimen.radius[mine], dtype=float, device=device)
        share = fourier.array(np.zeros((layers, count[1], count[0]), np.float32))
        wp.launch(
            fill_cells, dim=share.shape, inputs=[*solids, radius, corner, size, fourier.warp(share)], device=device
        )
        filled[float(index)] = share
    some = np.any([fourier.numpy(f).any(axis=(1, 2)) for f in filled.values()], axis=0)
    keep = np.flatnonzero(some)
    if len(keep) < layers:
        filled = {index: share[keep] for index, share in filled.items()}
    return Slices((int(first[0]), int(first[1])), low[2] + (keep + 0.5) * h, h, filled)


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
    if method not in METHODS:
        raise InputError(f"method is {method!r}; allowed: {', '.join(METHODS)}, mie")
    if not (math.isfinite(thickness) and thickness > 0.0):
        raise InputError(f"thickness of slices is {thickness:g} µm; allowed: above 0")
    n, sources = grid.cells, len(light.weights)
    # waves that travel in the medium, side by side: nothing else is kept
    reach = min(int(microscope.wavenumber * grid.length / (2.0 * math.pi)), (n - 1) // 2)
    here = np.ix_(*(np.arange(-reach, reach + 1) % n,) * 2)
    axial, travels = (a[here] for a in axial_wavenumbers(microscope.wavenumber, grid))
    b = 2 * reach + 1
    # while light passes, the origin is the middle of the first cell of the box around the specimen
    slices = sliced(specimen, grid, fourier, thickness) if len(specimen) else None
    at = np.zeros(2) if slices is None else (np.array(slices.corner) + 0.5) * grid.spacing - 0.5 * grid.length
    x, y = (q[here] for q in grid.wavenumbers())
    shift = x * at[0] + y * at[1]
    amplitude = _incoming(microscope, light, grid, here, shift, fourier)
    if slices is not None:
        count = max(1, BATCH_BYTES // (8 * b * b)) if not fourier.device.is_cuda else sources
        media = _media(specimen, microscope, grid, slices, here, fourier, method)
        middles = slices.middle if method != "projection" else slices.middle.mean(keepdims=True)
        carriers = _carriers(middles, axial, travels, fourier)
        height, width = media[0][0].shape[1:]
        corner = fourier.corner(n, b, width, height)
        for start in range(0, sources, count):
            _pass(amplitude[start : start + count], carriers, media, corner, fourier)
    amplitude *= fourier.array(np.where(travels, np.exp(-1j * shift), 0.0))
    return fourier.embedded(amplitude, n)


def axial_wavenumbers(k: float, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Axial wavenumber of every component of the spectrum [1/µm], 0 where it fades; and whether it travels."""
    x, y = grid.wavenumbers()
    square = k * k - x * x - y * y
    return np.sqrt(np.maximum(square, 0.0)), square > 0.0


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


def _media(
    specimen: Specimen,
    microscope: Microscope,
    grid: Grid,
    slices: Slices,
    here: tuple[np.ndarray, ...],
    fourier: Fourier,
    method: Method,
) -> list[tuple[Any, Any]]:
    """Per index: what multiplies the field within a slice (m, height, width), and what multiplies its spectrum."""
    vacuum, out = 2.0 * math.pi / microscope.wavelength, []
    axial, travels = (a[here] for a in axial_wavenumbers(microscope.wavenumber, grid))
    for index, share in slices.filled.items():
        if method == "two_index":
            inside = axial_wavenumbers(vacuum * index, grid)[0][here]
            gain = np.where(travels, np.exp(1j * (inside - axial) * slices.thickness) - 1.0, 0.0)
            delay = vacuum * (index - microscope.medium_index) * slices.thickness
            out.append((fourier.array(_mixed(fourier.numpy(share), delay)), fourier.array(gain)))
        else:
            delay = vacuum * (index - microscope.medium_index) * slices.thickness
            phase = fourier.numpy(share) * delay
            out.append((fourier.array(np.exp(1j * phase) - 1.0), fourier.array(travels.astype(complex))))
    if method == "projection":
        phase = sum(fourier.numpy(share).sum(axis=0) * vacuum * (index - microscope.medium_index) * slices.thickness
                    for index, share in slices.filled.items())  # fmt: skip
        out = [(fourier.array(np.exp(1j * phase)[None] - 1.0), fourier.array(travels.astype(complex)))]
    return out


def _mixed(share: np.ndarray, delay: float) -> np.ndarray:
    """What cells that a solid fills in part count for: μ, such that light along the axis gains e^{i share·delay}.

    Adding the shares of light that went on inside and outside, 1 + share (e^{i delay} − 1), would lose what is out of
    phase: of a sphere of 2.5 µm with n = 1.59 in slices of 0.2 µm, 1.3 % of the light of a square of 14 µm.
    """
    if abs(np.exp(1j * delay) - 1.0) < 1e-6:  # no solid to be seen
        return share
    return (np.exp(1j * delay * share) - 1.0) / (np.exp(1j * delay) - 1.0)


def _carriers(middles: np.ndarray, axial: np.ndarray, travels: np.ndarray, fourier: Fourier) -> list[Any]:
    """What travelling to the middle of each slice makes of every component of the spectrum."""
    out, at = [], 0.0
    phase, step, gap = travels.astype(complex), np.ones_like(axial, dtype=complex), 0.0
    for z in middles:
        if abs((z - at) - gap) > 1e-9:
            gap = z - at
            step = np.exp(1j * axial * gap)
        phase, at = phase * step, z
        out.append(fourier.array(phase.ravel()))
    return out


def _pass(amplitude: Any, carriers: list[Any], media: list[tuple[Any, Any]], corner: Corner, fourier: Fourier) -> None:
    """Lead the amplitudes (s, b, b) of some sources through all slices."""
    gpu, device = fourier.device.is_cuda, fourier.device
    sources, b, _ = amplitude.shape
    spectrum = fourier.zeros(sources, b, b)
    flat = [fourier.warp(a.reshape(sources, b * b)) for a in (amplitude, spectrum)]
    gains = [fourier.warp(gain.reshape(b * b)) for _, gain in media]
    each = (sources, b * b) if gpu else sources
    for m, carrier in enumerate(fourier.warp(c) for c in carriers):
        wp.launch(carry if gpu else carry_by_source, dim=each, inputs=[carrier, *flat], device=device)
        field = corner.field(spectrum)
        for (share, _), gain in zip(media, gains, strict=True):
            scattered = corner.spectrum(field * share[m]).reshape(sources, b * b)
            inputs = [fourier.warp(scattered), gain, carrier, flat[0]]
            wp.launch(add_scattered if gpu else add_scattered_by_source, dim=each, inputs=inputs, device=device)
