"""Images of many planes at once, as on a GPU, beside those of plane after plane."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.vision import image
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import illumination
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import propagate
from otwarp.vision.specimen import Specimen


@pytest.mark.parametrize(("pixel", "pixels"), [(0.11, 48), (0.055, 96)])
def test_planes_together_are_those_in_turn(pixel: float, pixels: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two objectives, a specimen that moves, pixels of two sizes; four planes a batch."""
    pytest.importorskip("torch")
    grid, fourier = Grid(pixels, pixels, pixels, 48, pixel), Fourier("cpu", "torch")
    microscope = Microscope(condenser_aperture=0.3, pixel=pixel)
    light = illumination(microscope, grid.length, rings=1)
    spectra = propagate(Specimen.of_spheres([[0.2, 0.0, 0.0]], 0.8, 1.45), microscope, light, grid, fourier)
    other = dataclasses.replace(microscope, numerical_aperture=0.9)
    through, focus = [microscope] * 5 + [other] * 4, np.linspace(-3.0, 3.0, 9)
    moved = np.linspace(-0.3, 0.4, 18).reshape(9, 2)
    ask = (spectra, through, light, grid, fourier, focus, moved)
    in_turn = image.images(*ask)
    monkeypatch.setattr(image, "_planes_in_turn", image._planes_together)
    monkeypatch.setattr(image, "PLANE_BYTES", 4 * 8 * len(light.weights) * 48 * 48)
    together = image.images(*ask)
    assert in_turn.shape == together.shape == (9, pixels, pixels)
    assert np.std(in_turn) > 0.02
    np.testing.assert_allclose(together, in_turn, atol=2e-5)
