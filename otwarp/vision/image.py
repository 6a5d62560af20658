"""Images from what has left a specimen: one propagation serves every focal plane, and every objective."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import Illumination
from otwarp.vision.kernels.intensity import add_intensity, add_intensity_at_once
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import BATCH_BYTES, axial_wavenumbers
from otwarp.vision.pupil import pupil


def images(
    spectra: Any,
    microscope: Microscope,
    light: Illumination,
    grid: Grid,
    fourier: Fourier,
    focus: Sequence[float] | np.ndarray,
) -> np.ndarray:
    """(f, pixels, pixels) intensities in the focal planes, 1 where light is unhindered in bright field.

    Rows go up: row 0 is the lowest. The origin of the specimen is pixel (pixels // 2, pixels // 2).

    Args:
        spectra: (s, cells, cells) of `propagate`, or (2, s, cells, cells) for the two components of a vector field.
        microscope: With the objective to look through; the wavelength must be that of the propagation.
        light: Which was propagated.
        grid: Of the spectra.
        fourier: Where they are.
        focus: Heights of the focal planes [µm].
    """
    n, p, device = grid.cells, grid.pixels, fourier.device
    fields = spectra.reshape(-1, *spectra.shape[-2:])
    repeats = fields.shape[0] // len(light.weights)
    axial, _ = axial_wavenumbers(microscope.wavenumber, grid)
    through = pupil(microscope, grid)
    x, y = grid.wavenumbers()
    # an image is looked at in the middles of its pixels; the specimen's origin is the middle of one of them
    corner = np.exp(-1j * (x + y) * (grid.pixels // 2) * grid.pixel)
    weight = np.tile(_weights(microscope, light, through), repeats)
    inner = np.flatnonzero(np.abs(np.fft.fftfreq(n, 1.0 / n)) < min(n, p) / 2.0)
    where = inner.astype(int) if p >= n else inner
    target = np.where(where < (n + 1) // 2, where, where - n) % p
    out = np.zeros((len(focus), p, p), dtype=np.float32)
    count = max(1, BATCH_BYTES // (8 * p * p)) if not device.is_cuda else len(fields)
    rows, columns = np.ix_(target, target)
    first, second = np.ix_(where, where)
    blur = _pixel_response(p)
    for f, z in enumerate(focus):
        passed = fourier.array((through * corner * np.exp(1j * axial * z))[first, second])
        image = fourier.array(np.zeros(p * p, dtype=np.float32))
        for start in range(0, len(fields), count):
            some = fields[start : start + count]
            spectrum = fourier.zeros(some.shape[0], p, p)
            spectrum[:, rows, columns] = some[:, first, second] * passed
            field = fourier.image(spectrum).reshape(some.shape[0], p * p)
            shares = fourier.array(weight[start : start + count].astype(np.float32))
            inputs = [fourier.warp(field), fourier.warp(shares), fourier.warp(image)]
            wp.launch(
                add_intensity if device.is_cuda else add_intensity_at_once,
                dim=p * p if device.is_cuda else 1, inputs=inputs, device=device,
            )  # fmt: skip
        out[f] = np.fft.irfft2(np.fft.rfft2(fourier.numpy(image).reshape(p, p)) * blur, s=(p, p))
    return out


def _weights(microscope: Microscope, light: Illumination, through: np.ndarray) -> np.ndarray:
    """Share of each source, such that the unhindered image is 1; in dark field, that it would be if light passed."""
    rows, columns = light.steps[:, 1] % len(through), light.steps[:, 0] % len(through)
    direct = np.abs(through[rows, columns]) ** 2
    total = np.sum(light.weights * direct)
    if total > 0.0:
        return light.weights / total
    return light.weights / light.weights.sum()


def _pixel_response(pixels: int) -> np.ndarray:
    """What averaging over square pixels leaves of each frequency of an image."""
    full, half = np.fft.fftfreq(pixels), np.fft.rfftfreq(pixels)
    return np.sinc(full)[:, None] * np.sinc(half)[None, :]
