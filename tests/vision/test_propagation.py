"""Many specimens at once, as on a GPU, against one after the other, as on a CPU."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.vision import image
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import illumination
from otwarp.vision.image import images, images_many
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import components, passed_together, propagate, propagate_many
from otwarp.vision.slices import METHODS, Method
from otwarp.vision.specimen import Specimen

GRID = Grid(72, 72, 72, 72, 0.16)
MICROSCOPE = Microscope(condenser_aperture=0.4)
LIGHT = illumination(MICROSCOPE, GRID.length, rings=2)
ROUNDING = 2e-6
"""Of amplitudes of at most 1 after some twenty slices in float32."""


def chain(tilt: float, azimuth: float, index: object) -> Specimen:
    """Five spheres in a row, 5 µm long."""
    along = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    return Specimen.of_spheres(np.outer(np.linspace(-1.75, 1.75, 5), along), 0.75, index)


SPECIMENS = (
    chain(0.3, 0.2, 1.52),
    chain(1.2, 2.0, [1.52, 1.4, 1.52, 1.4, 1.45]),
    Specimen.of_spheres(np.zeros((0, 3)), 0.5, 1.5),
    chain(0.9, -1.0, 1.4).moved((0.3, -0.4, 1.0)),
)
"""Of other heights, widths and indices, and one that is empty."""


@pytest.mark.parametrize("method", METHODS)
def test_light_through_many_is_that_through_each(method: Method, device: str):
    pytest.importorskip("torch")
    fourier = Fourier(device, "torch")
    here = components(MICROSCOPE, GRID)
    together = passed_together(SPECIMENS, MICROSCOPE, LIGHT, GRID, here, fourier, method, 0.2)
    many = propagate_many(SPECIMENS, MICROSCOPE, LIGHT, GRID, fourier, method=method, thickness=0.2)
    host = Fourier("cpu")
    for n, specimen in enumerate(SPECIMENS):
        alone = host.numpy(propagate(specimen, MICROSCOPE, LIGHT, GRID, host, method=method, thickness=0.2))
        for found in (together, many):
            np.testing.assert_allclose(fourier.numpy(found[n]), alone, atol=ROUNDING)
        passed = np.abs(alone).max(axis=(1, 2)) > 0.1
        assert passed.all()


def test_images_of_many_are_those_of_each(device: str, monkeypatch: pytest.MonkeyPatch):
    """Both ways to look, in chunks that end within a pose; through two objectives, and moved."""
    pytest.importorskip("torch")
    fourier = Fourier(device, "torch")
    spectra = propagate_many(SPECIMENS, MICROSCOPE, LIGHT, GRID, fourier, thickness=0.2)
    focus, shift = [-3.0, 0.0, 1.5], np.array([[0.0, 0.0], [0.4, -0.3], [0.1, 0.2]])
    objective = [MICROSCOPE, MICROSCOPE, Microscope(condenser_aperture=0.4, numerical_aperture=0.8, zernike={11: 0.1})]
    monkeypatch.setattr(image, "_planes_in_turn", image._planes_together)
    monkeypatch.setattr(image, "PLANE_BYTES", 8 * len(LIGHT.weights) * GRID.pixels**2 * 2)
    monkeypatch.setattr(image, "MOST_PLANES", 2)
    together = images_many(spectra, objective, LIGHT, GRID, fourier, focus, shift)
    monkeypatch.undo()
    host = Fourier("cpu")
    for n in range(len(SPECIMENS)):
        mine = host.array(fourier.numpy(spectra[n]))
        np.testing.assert_allclose(together[n], images(mine, objective, LIGHT, GRID, host, focus, shift), atol=5e-6)
    assert np.ptp(together[0]) > 0.5
    np.testing.assert_allclose(together[2], 1.0, atol=1e-5)


def test_one_that_reaches_beyond_is_told():
    with pytest.raises(InputError, match=r"the specimen reaches 6\.\d+ µm .* allowed: up to 5\.76 µm"):
        propagate_many([chain(0.3, 0.0, 1.5), chain(1.57, 0.0, 1.5).moved((4.0, 0.0, 0.0))], MICROSCOPE, LIGHT, GRID,
                       Fourier("cpu"))  # fmt: skip
