"""Images from what has left a specimen: one propagation serves every focal plane, and every objective."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from scipy.fft import next_fast_len

from otwarp.vision.fourier import Fourier, padded
from otwarp.vision.grid import Grid, axial_wavenumbers
from otwarp.vision.illumination import Illumination
from otwarp.vision.kernels.intensity import add_intensities, add_intensity_at_once, pass_objective
from otwarp.vision.microscope import Microscope
from otwarp.vision.pupil import pupil, sheared
from otwarp.vision.slices import BATCH_BYTES

PLANE_BYTES = 2**28
"""Of the fields of all sources in focal planes that a GPU works on together."""

MOST_PLANES = 1024
"""Whose phases a GPU keeps at once."""

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
    return images_many(spectra[None], microscope, light, grid, fourier, focus, shift)[0]


def images_many(
    spectra: Any,
    microscope: Microscope | Sequence[Microscope],
    light: Illumination,
    grid: Grid,
    fourier: Fourier,
    focus: Sequence[float] | np.ndarray,
    shift: np.ndarray | None = None,
) -> np.ndarray:
    """(p, f, pixels, pixels) intensities of many specimens in the same focal planes, of each as `images` has them.

    Args:
        spectra: (p, s, cells, cells) of `propagate_many`, or (p, 2, s, cells, cells).
        microscope, light, grid, fourier, focus, shift: As of `images`.
    """
    n, p, device = grid.cells, grid.pixels, fourier.device
    objectives = [microscope] * len(focus) if isinstance(microscope, Microscope) else list(microscope)
    fields = spectra.reshape(len(spectra), -1, *spectra.shape[-2:])
    if not objectives:
        return np.zeros((len(fields), 0, p, p), dtype=np.float32)
    reach = max(int(o.cutoff * grid.length / (2.0 * math.pi)) for o in {id(o): o for o in objectives}.values())
    # beats of waves through the objective need so many points; pixels that are finer say nothing more
    m = min(p, next_fast_len(4 * reach + 1) or p)
    reach = min(reach, (min(n, m) - 1) // 2)
    block = np.arange(-reach, reach + 1) % n
    here = np.ix_(block, block)
    some = fourier.block(fields, block)
    axial = axial_wavenumbers(objectives[0].wavenumber, grid)[0][here]
    # an image is looked at in the middles of its pixels; the specimen's origin is the middle of one of them
    corner = np.tile([(p // 2) * grid.pixel], (len(focus), 2)) + (0.0 if shift is None else np.asarray(shift))
    ways = np.column_stack([-corner, np.asarray(focus, dtype=float)])
    waves = np.stack([*(q[here] for q in grid.wavenumbers()), axial])
    look = _planes_together if device.is_cuda else _planes_in_turn
    out, blur = [], _pixel_response(p)
    for first, last in _runs(objectives):
        objective = objectives[first]
        whole = pupil(objective, grid)
        weight = np.tile(_weights(light, whole, objective), some.shape[1] // len(light.weights)).astype(np.float32)
        seen = _interfering(some, objective, light, grid, fourier, here)
        out.append(look(seen, weight, whole[here], ways[first:last], waves, m, blur, fourier))
    return out[0] if len(out) == 1 else np.concatenate(out, axis=1)


def _runs(objectives: Sequence[Microscope]) -> list[tuple[int, int]]:
    """First and beyond the last of neighbouring planes that are looked at through the same objective."""
    starts = [0]
    for n in range(1, len(objectives)):
        before = objectives[n - 1]
        if objectives[n] is not before and objectives[n] != before:
            starts.append(n)
    return list(zip(starts, [*starts[1:], len(objectives)], strict=True))


def _planes_in_turn(
    fields: Any,
    weight: np.ndarray,
    through: np.ndarray,
    ways: np.ndarray,
    waves: np.ndarray,
    m: int,
    blur: np.ndarray,
    fourier: Fourier,
) -> np.ndarray:
    """(q, f, pixels, pixels) images, plane by plane: as few fields at once as stay in the cache of a CPU.

    Args:
        fields: (q, s, b, b) spectra.
        weight: (s) share of each in the image.
        through: (b, b) what the objective leaves of each component.
        ways: (f, 3) vectors from the origin of the fields to that of each image [µm].
        waves: (3, b, b) wave vector of each component [1/µm].
        m: Points along each side in which light is squared.
        blur: (pixels, pixels // 2 + 1) what pixels leave of each frequency.
        fourier: Where.
    """
    p, device = len(blur), fourier.device
    count = max(1, BATCH_BYTES // (8 * m * m))
    out = np.zeros((len(fields), len(ways), p, p), dtype=np.float32)
    for f, way in enumerate(ways):
        phase = way[2] * waves[2] + way[0] * waves[0] + way[1] * waves[1]
        plane = fourier.array(through * np.exp(1j * phase))
        for q, mine in enumerate(fields):
            image = fourier.array(np.zeros(m * m, dtype=np.float32))
            for start in range(0, len(mine), count):
                field = fourier.image(mine[start : start + count] * plane, m)
                shares = fourier.array(weight[start : start + count])
                inputs = [fourier.warp(field.reshape(-1, m * m)), fourier.warp(shares), fourier.warp(image)]
                wp.launch(add_intensity_at_once, dim=1, inputs=inputs, device=device)
            out[q, f] = _resampled(fourier.numpy(image).reshape(m, m), p, blur)
    return out


def _planes_together(
    fields: Any,
    weight: np.ndarray,
    through: np.ndarray,
    ways: np.ndarray,
    waves: np.ndarray,
    m: int,
    blur: np.ndarray,
    fourier: Fourier,
) -> np.ndarray:
    """The same on a GPU, which is only filled by many planes at once, and where phases are taken as well."""
    if len(ways) > MOST_PLANES:
        parts = [ways[start : start + MOST_PLANES] for start in range(0, len(ways), MOST_PLANES)]
        seen = [_planes_together(fields, weight, through, part, waves, m, blur, fourier) for part in parts]
        return np.concatenate(seen, axis=1)
    p, device, (poses, s, b, _), planes = len(blur), fourier.device, fields.shape, len(ways)
    pages = poses * planes
    count = max(1, min(pages, PLANE_BYTES // (8 * s * m * m)))
    shares, response = fourier.warp(fourier.array(weight)), fourier.array(blur)
    lenses = (fourier.array(through) * fourier.waves(ways, waves)).reshape(planes, b * b)
    known = [fourier.warp(fields.reshape(poses * s, b * b)), fourier.warp(lenses)]
    behind, out = fourier.zeros(count, s, m, m), fourier.landing(pages, p, p)
    for start in range(0, pages, count):
        mine = behind[: min(count, pages - start)]
        inputs = [*known, start, planes, s, b, m, fourier.warp(mine.reshape(-1, m * m))]
        wp.launch(pass_objective, dim=(len(mine), s, m * m), inputs=inputs, device=device)
        field = fourier.fields(mine).reshape(len(mine), s, m * m)
        image = fourier.array(np.zeros((len(mine), m * m), dtype=np.float32))
        inputs = [fourier.warp(field), shares, fourier.warp(image)]
        wp.launch(add_intensities, dim=(len(mine), m * m), inputs=inputs, device=device)
        fourier.land(fourier.resampled(image.reshape(-1, m, m), p, response), out[start : start + len(mine)])
    return fourier.landed(out).reshape(poses, planes, p, p)


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
