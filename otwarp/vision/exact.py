"""Spectra of light that spheres have scattered, exactly: the rung of the ladder that the others are held against."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid, axial_wavenumbers
from otwarp.vision.illumination import Illumination
from otwarp.vision.microscope import Microscope
from otwarp.vision.scattering import Cluster, frame
from otwarp.vision.specimen import Specimen


def scattered_spectra(
    specimen: Specimen, microscope: Microscope, light: Illumination, grid: Grid, fourier: Fourier, **options: Any
) -> Any:
    """Light behind spheres, polarisation and reflections between them included.

    A wave of direction k̂ that the spheres send out as f e^{ikr}/r is the plane wave of amplitude i f/(2π k_z) per area
    of the spectrum (Weyl's expansion). The objective turns its polarisation from the meridional plane into the image,
    where it has two components, along x and y.

    Args:
        specimen: Spheres that touch at most, relative to the optical axis.
        microscope, light, grid, fourier: As for `propagate`.
        options: Of `Cluster`.

    Returns:
        (2, 2, s, cells, cells): polarisation of the light that comes in, component in the image, source; as `propagate`
        gives them, each polarisation with half of the light, which is not polarised.

    Raises:
        InputError: Capsules, spheres that overlap, or more light than fits the memory.
    """
    k, n = microscope.wavenumber, grid.cells
    x, y = grid.wavenumbers()
    axial, travels = axial_wavenumbers(k, grid)
    rows, columns = np.nonzero(travels & (np.hypot(x, y) <= microscope.cutoff))
    out_x, out_y, out_z = x[rows, columns], y[rows, columns], axial[rows, columns]
    direction = np.stack([out_x, out_y, out_z], axis=1) / k
    step = 2.0 * math.pi / grid.length
    across = light.steps * step
    incoming = np.column_stack([across, np.sqrt(k * k - np.sum(across**2, axis=1))]) / k
    polarisations = frame(incoming)
    fourier.check_room(2, 2, len(light.weights), n, n)
    spectra = np.zeros((2, 2, len(light.weights), n, n), dtype=np.complex64)
    image_out, image_in = _in_image(direction), _in_image(incoming)
    density = (1j * step * step / (2.0 * math.pi * out_z)).astype(np.complex64)
    cluster = Cluster(specimen, microscope.medium_index, microscope.wavelength, **options) if len(specimen) else None
    own_rows, own_columns = light.steps[:, 1] % n, light.steps[:, 0] % n
    for p, polarisation in enumerate(polarisations):
        if cluster is not None:
            far = cluster.far_field(cluster.scattered(incoming, polarisation), direction)
            for c in range(2):
                spectra[p, c][:, rows, columns] = density * far[..., 0] * image_out[0][:, c]
                spectra[p, c][:, rows, columns] += density * far[..., 1] * image_out[1][:, c]
        for c in range(2):
            spectra[p, c][np.arange(len(across)), own_rows, own_columns] += image_in[p][:, c]
    return fourier.array(spectra / math.sqrt(2.0))


def _in_image(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where θ̂ and φ̂ of waves point in the image, each (w, 2): the objective bends θ̂ into the plane."""
    angle = np.arctan2(direction[:, 1], direction[:, 0])
    return np.stack([np.cos(angle), np.sin(angle)], axis=1), np.stack([-np.sin(angle), np.cos(angle)], axis=1)
