"""Images from what has left a specimen: one propagation serves every focal plane, and every objective."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from scipy.fft import next_fast_len

from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import Illumination
from otwarp.vision.kernels.intensity import add_intensity, add_intensity_at_once
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import BATCH_BYTES, axial_wavenumbers
from otwarp.vision.pupil import pupil


def images(
    spectra: Any,
    microscope: Microscope | Sequence[Microscope],
    light: Illumination,
    grid: Grid,
    fourier: Fourier,
    focus: Sequence[float] | np.ndarray,
    shift: np.ndarray | None = None,
) -> np.ndarray:
    """(f, pixels, pixels) intensities in the focal planes, 1 where light is unhindered in bright field.

    Rows go up: row 0 is the lowest. The origin of the specimen is pixel (pixels // 2, pixels // 2).

    Args:
        spectra: (s, cells, cells) of `propagate`, or (2, s, cells, cells) for the two components of a vector field.
        microscope: With the objective to look through, one for all planes or one for each; the wavelength must be that
            of the propagation.
        light: Which was propagated.
        grid: Of the spectra.
        fourier: Where they are.
        focus: (f) heights of the focal planes [µm].
        shift: (f, 2) by which the specimen is seen moved in each (x, y) [µm]; None: nowhere.
    """
    n, p, device = grid.cells, grid.pixels, fourier.device
    objectives = [microscope] * len(focus) if isinstance(microscope, Microscope) else list(microscope)
    fields = spectra.reshape(-1, *spectra.shape[-2:])
    if not objectives:
        return np.zeros((0, p, p), dtype=np.float32)
    reach = max(int(o.cutoff * grid.length / (2.0 * math.pi)) for o in objectives)
    # beats of waves through the objective need so many points; pixels that are finer say nothing more
    m = min(p, next_fast_len(4 * reach + 1) or p)
    reach = min(reach, (min(n, m) - 1) // 2)
    block = np.arange(-reach, reach + 1) % n
    here = np.ix_(block, block)
    some = fourier.block(fields, block)
    axial = axial_wavenumbers(objectives[0].wavenumber, grid)[0][here]
    x, y = (q[here] for q in grid.wavenumbers())
    # an image is looked at in the middles of its pixels; the specimen's origin is the middle of one of them
    corner = np.tile([(p // 2) * grid.pixel], (len(focus), 2)) + (0.0 if shift is None else np.asarray(shift))
    out = np.zeros((len(focus), p, p), dtype=np.float32)
    count = max(1, BATCH_BYTES // (8 * m * m)) if not device.is_cuda else len(fields)
    launched = (add_intensity, m * m) if device.is_cuda else (add_intensity_at_once, 1)
    blur = _pixel_response(p)
    through, weight, last = axial, axial, None
    for f, (z, objective) in enumerate(zip(focus, objectives, strict=True)):
        if objective != last:
            whole, last = pupil(objective, grid), objective
            through, weight = whole[here], np.tile(_weights(light, whole), len(fields) // len(light.weights))
            weight = weight.astype(np.float32)
        phase = axial * z - x * corner[f, 0] - y * corner[f, 1]
        passed = fourier.array(through * np.exp(1j * phase))
        image = fourier.array(np.zeros(m * m, dtype=np.float32))
        for start in range(0, len(fields), count):
            field = fourier.image(some[start : start + count] * passed, m)
            shares = fourier.array(weight[start : start + count])
            inputs = [fourier.warp(field.reshape(-1, m * m)), fourier.warp(shares), fourier.warp(image)]
            wp.launch(launched[0], dim=launched[1], inputs=inputs, device=device)
        out[f] = _resampled(fourier.numpy(image).reshape(m, m), p, blur)
    return out


def _resampled(image: np.ndarray, pixels: int, blur: np.ndarray) -> np.ndarray:
    """(pixels, pixels) means over pixels of an image (m, m) of the same square, m at most pixels."""
    m = len(image)
    spectrum = np.fft.rfft2(image)
    if m < pixels:
        whole = np.zeros((pixels, pixels // 2 + 1), dtype=complex)
        half = (m + 1) // 2  # the highest frequency of an even number of points is empty
        whole[:half, :half] = spectrum[:half, :half]
        whole[pixels - half + 1 :, :half] = spectrum[m - half + 1 :, :half]
        spectrum = whole * (pixels / m) ** 2
    return np.fft.irfft2(spectrum * blur, s=(pixels, pixels))


def _weights(light: Illumination, through: np.ndarray) -> np.ndarray:
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
