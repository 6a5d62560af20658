"""Images from what has left a specimen: one propagation serves every focal plane, and every objective."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from scipy.fft import next_fast_len

from otwarp.vision.fourier import Fourier, padded
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import Illumination
from otwarp.vision.kernels.intensity import add_intensities, add_intensity_at_once
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import BATCH_BYTES, axial_wavenumbers
from otwarp.vision.pupil import pupil, sheared

PLANE_BYTES = 2**29
"""Of the fields of all sources in focal planes that a GPU works on together."""

DARK = 1e-6
"""Share of light below which a background of differential interference contrast counts as dark."""


def images(
    spectra: Any,
    microscope: Microscope | Sequence[Microscope],
    light: Illumination,
    grid: Grid,
    fourier: Fourier,
    focus: Sequence[float] | np.ndarray,
    shift: np.ndarray | None = None,
) -> np.ndarray:
    """(f, pixels, pixels) intensities in the focal planes, 1 where light is unhindered.

    Where unhindered light is dark, 1 is what it would be if the objective let it pass (dark field), or with a bias of
    half a wavelength (differential interference contrast). Row 0 is the lowest; the origin of the specimen is pixel
    (pixels // 2, pixels // 2).

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
    # an image is looked at in the middles of its pixels; the specimen's origin is the middle of one of them
    corner = np.tile([(p // 2) * grid.pixel], (len(focus), 2)) + (0.0 if shift is None else np.asarray(shift))
    blur = _pixel_response(p)
    weight, through, seen, last = axial, axial, some, None
    plans: list[tuple[Any, Any, Any, list[np.ndarray]]] = []
    for (x, y), z, objective in zip(corner, focus, objectives, strict=True):
        if objective != last:
            whole, last = pupil(objective, grid), objective
            through, weight = whole[here], np.tile(_weights(light, whole, objective), len(some) // len(light.weights))
            weight, seen = weight.astype(np.float32), _interfering(some, objective, light, grid, fourier, here)
            plans.append((seen, weight, through, []))
        plans[-1][3].append(np.array([-x, -y, z]))
    waves = np.stack([*(q[here] for q in grid.wavenumbers()), axial])
    look = _planes_together if device.is_cuda else _planes_in_turn
    return np.concatenate([look(*plan, waves, m, blur, fourier) for plan in plans])


def _planes_in_turn(
    fields: Any,
    weight: np.ndarray,
    through: np.ndarray,
    ways: Sequence[np.ndarray],
    waves: np.ndarray,
    m: int,
    blur: np.ndarray,
    fourier: Fourier,
) -> np.ndarray:
    """(f, pixels, pixels) images, plane by plane: as few fields at once as stay in the cache of a CPU.

    Args:
        fields: (s, b, b) spectra.
        weight: (s) share of each in the image.
        through: (b, b) what the objective leaves of each component.
        ways: (f) vectors (3) from the origin of the fields to that of each image [µm].
        waves: (3, b, b) wave vector of each component [1/µm].
        m: Points along each side in which light is squared.
        blur: (pixels, pixels // 2 + 1) what pixels leave of each frequency.
        fourier: Where.
    """
    p, device = len(blur), fourier.device
    count = max(1, BATCH_BYTES // (8 * m * m))
    out = np.zeros((len(ways), p, p), dtype=np.float32)
    for f, way in enumerate(ways):
        phase = way[2] * waves[2] + way[0] * waves[0] + way[1] * waves[1]
        plane, image = fourier.array(through * np.exp(1j * phase)), fourier.array(np.zeros(m * m, dtype=np.float32))
        for start in range(0, len(fields), count):
            field = fourier.image(fields[start : start + count] * plane, m)
            shares = fourier.array(weight[start : start + count])
            inputs = [fourier.warp(field.reshape(-1, m * m)), fourier.warp(shares), fourier.warp(image)]
            wp.launch(add_intensity_at_once, dim=1, inputs=inputs, device=device)
        out[f] = _resampled(fourier.numpy(image).reshape(m, m), p, blur)
    return out


def _planes_together(
    fields: Any,
    weight: np.ndarray,
    through: np.ndarray,
    ways: Sequence[np.ndarray],
    waves: np.ndarray,
    m: int,
    blur: np.ndarray,
    fourier: Fourier,
) -> np.ndarray:
    """The same on a GPU, which is only filled by many planes at once, and where phases are taken as well."""
    p, device, s = len(blur), fourier.device, len(fields)
    count = max(1, PLANE_BYTES // (8 * s * m * m))
    shares, response = fourier.warp(fourier.array(weight)), fourier.array(blur)
    out, passes = np.zeros((len(ways), p, p), dtype=np.float32), fourier.array(through)
    for start in range(0, len(ways), count):
        some = passes * fourier.waves(np.stack(ways[start : start + count]), waves)
        field = fourier.image(fields * some[:, None], m).reshape(len(some), s, m * m)
        image = fourier.array(np.zeros((len(some), m * m), dtype=np.float32))
        inputs = [fourier.warp(field), shares, fourier.warp(image)]
        wp.launch(add_intensities, dim=(len(some), m * m), inputs=inputs, device=device)
        out[start : start + len(some)] = fourier.numpy(fourier.resampled(image.reshape(-1, m, m), p, response))
    return out


def _resampled(image: np.ndarray, pixels: int, blur: np.ndarray) -> np.ndarray:
    """(pixels, pixels) means over pixels of an image (m, m) of the same square, m at most pixels."""
    m = len(image)
    return np.fft.irfft2(padded(np.fft.rfft2(image), m, pixels) * blur, s=(pixels, pixels))


def _interfering(
    fields: Any, microscope: Microscope, light: Illumination, grid: Grid, fourier: Fourier, here: tuple[np.ndarray, ...]
) -> Any:
    """The fields (…, b, b) whose intensities make the image: themselves, or the difference of two of each."""
    if microscope.contrast != "dic":
        return fields
    x, y = (q[here] for q in grid.wavenumbers())
    split = fourier.array(sheared(microscope, light, x, y, 2.0 * math.pi / grid.length))
    return (fields.reshape(-1, *split.shape) * split).reshape(fields.shape)


def _weights(light: Illumination, through: np.ndarray, microscope: Microscope) -> np.ndarray:
    """Share of each source, such that the unhindered image is 1, or has the unit that `images` says."""
    rows, columns = light.steps[:, 1] % len(through), light.steps[:, 0] % len(through)
    total = np.sum(light.weights * np.abs(through[rows, columns]) ** 2)
    if microscope.contrast == "dic":
        passed = math.sin(math.pi * microscope.bias) ** 2
        total *= passed if passed > DARK else 1.0
    return light.weights / (total if total > 0.0 else light.weights.sum())


def _pixel_response(pixels: int) -> np.ndarray:
    """What averaging over square pixels leaves of each frequency of an image."""
    full, half = np.fft.fftfreq(pixels), np.fft.rfftfreq(pixels)
    return np.sinc(full)[:, None] * np.sinc(half)[None, :]
