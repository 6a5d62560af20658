"""Phase contrast, differential interference contrast and dark field against what they make of weak phases."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid
from otwarp.vision.illumination import illumination
from otwarp.vision.image import images
from otwarp.vision.microscope import Microscope
from otwarp.vision.rendering import Rendering, expose, render
from otwarp.vision.specimen import Specimen

GRID = Grid(96, 96, 96, 96, 0.1)
STEPS = 6
"""Of the grid's spectrum, in a wave of the grating: 1.6 µm, an aperture of 0.34, outside all rings below."""

NOTHING = Specimen.of_spheres(np.zeros((0, 3)), 1.0, 1.5)


@pytest.fixture(scope="module")
def fourier() -> Fourier:
    return Fourier("cpu")


def microscope(**changes: object) -> Microscope:
    base = Microscope(numerical_aperture=1.2, condenser_aperture=0.1, pixel=0.1)
    return dataclasses.replace(base, **changes)  # type: ignore[arg-type]


def grating(m: Microscope, fourier: Fourier, phase: np.ndarray, rings: int = 1) -> np.ndarray:
    """(96, 96) image in focus of a thin layer of phases (96,) along x, behind which each source's wave is e^{iφ}."""
    light = illumination(m, GRID.length, rings=rings)
    layer = np.fft.fft(np.exp(1j * phase)) / len(phase)
    spectra = np.zeros((len(light.weights), 96, 96), dtype=np.complex64)
    for s, (x, y) in enumerate(light.steps):
        # the origin of spectra is the middle of the grid, that of the layer is its first cell
        spectra[s, y] = np.roll(layer * (-1.0) ** np.arange(96), x)
    return images(fourier.array(spectra), m, light, GRID, fourier, [0.0])[0]


def wave(height: float, steps: int = STEPS) -> np.ndarray:
    """(96,) phases of a grating, `height` in the middle of the grid."""
    return height * np.cos(2.0 * math.pi * steps * (np.arange(96) / 96 - 0.5))


ANNULUS = {"condenser": "annulus", "condenser_inner": 0.08, "contrast": "phaseContrast"}


@pytest.mark.quick
@pytest.mark.parametrize(("delay", "transmission"), [(-0.25, 1.0), (0.25, 1.0), (-0.25, 0.25)])
def test_phase_contrast_shows_a_weak_phase_as_light(fourier: Fourier, delay: float, transmission: float) -> None:
    """1 + 2φ sin(2πδ)/√T, but for φ², the aplanatic weight of the waves beside (1.5 %) and pixels (1 %)."""
    m = microscope(**ANNULUS, ring_delay=delay, ring_transmission=transmission)
    phase = wave(0.02)
    page = grating(m, fourier, phase)
    expected = 1.0 + 2.0 * phase * math.copysign(1.0, delay) / math.sqrt(transmission)
    assert np.abs(page - expected).max() < 0.05 * np.abs(expected - 1.0).max()
    # without the ring nothing of it is seen
    assert np.abs(grating(dataclasses.replace(m, contrast="brightField"), fourier, phase) - 1.0).max() < 2e-3


@pytest.mark.quick
@pytest.mark.parametrize(("aperture", "bias"), [(0.0, 0.25), (0.5, 0.25), (0.5, 0.1), (0.5, 0.0)])
def test_interference_contrast_shows_the_gradient_of_a_phase(fourier: Fourier, aperture: float, bias: float) -> None:
    """sin²((φ(x + s/2) − φ(x − s/2) + b)/2), in units of sin²(b/2) where that is not 0, whatever the condenser is."""
    shear = 0.3
    m = microscope(condenser_aperture=aperture, contrast="dic", shear=shear, bias=bias)
    phase = wave(0.4, 3)
    x = (np.arange(96) - 48) * 0.1
    k = 2.0 * math.pi * 3 / GRID.length
    difference = 0.4 * (np.cos(k * (x + 0.5 * shear)) - np.cos(k * (x - 0.5 * shear)))
    unit = math.sin(math.pi * bias) ** 2 or 1.0
    expected = np.sin(0.5 * difference + math.pi * bias) ** 2 / unit
    page = grating(m, fourier, phase, rings=2)
    assert np.abs(page - expected).max() < 0.05 * np.ptp(expected)


def test_a_thin_weak_ball_in_phase_contrast(fourier: Fourier) -> None:
    """1 − 2φ around the middle of a ball of φ ≤ 0.057, with light from a point, to a tenth of the largest 2φ."""
    m = microscope(condenser_aperture=0.0, contrast="phaseContrast", ring_transmission=1.0)
    ball = Specimen.of_spheres([[0, 0, 0]], 2.5, 1.331)
    page = render(ball, m, 96, rendering=Rendering(margin=6.0), fourier=fourier)[0]
    x = (np.arange(96) - 48) * 0.1
    chord = 2.0 * np.sqrt(np.maximum(2.5**2 - x[:, None] ** 2 - x[None, :] ** 2, 0.0))
    phase = 2.0 * math.pi / 0.55 * 0.001 * chord
    # what is left out is the mean phase, which no image shows
    inside, outside = chord > 3.0, chord == 0.0
    shown = (page - page[outside].mean())[inside]
    assert np.abs(shown + 2.0 * phase[inside]).max() < 0.1 * 2.0 * phase.max()


def test_interference_contrast_of_a_ball_has_a_bright_and_a_dark_side(fourier: Fourier) -> None:
    ball = Specimen.of_spheres([[0, 0, 0]], 1.5, 1.42)
    m = microscope(condenser_aperture=0.4)
    light = expose(ball, m, 64, rendering=Rendering(rings=2), fourier=fourier)
    plain, right, up = (
        light.images([0.0], objective=dataclasses.replace(m, **more))[0]  # type: ignore[arg-type]
        for more in ({}, {"contrast": "dic"}, {"contrast": "dic", "shear_angle": 0.5 * math.pi})
    )
    assert right[32, 20:32].mean() > 1.1 and right[32, 33:45].mean() < 0.9
    assert np.abs(up - right.T).max() < 0.03 * np.ptp(right)
    assert np.array_equal(plain, light.images([0.0])[0])


def test_empty_fields_are_even(fourier: Fourier) -> None:
    how = Rendering(rings=2, margin=1.0)
    for more in (ANNULUS, {"contrast": "dic"}, {"contrast": "dic", "shear_angle": 0.6, "bandwidth": 0.03}):
        page = render(NOTHING, microscope(**more), 32, rendering=how, fourier=fourier)
        assert np.abs(page - 1.0).max() < 1e-4
    dark = {"contrast": "dic", "bias": 0.0}, {
        "contrast": "darkField", "numerical_aperture": 0.7, "condenser": "annulus", "condenser_inner": 0.8,
        "condenser_aperture": 1.0,
    }  # fmt: skip
    for more in dark:
        assert np.abs(render(NOTHING, microscope(**more), 32, rendering=how, fourier=fourier)).max() < 1e-5


@pytest.mark.quick
@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"contrast": "hoffman"}, "contrast is 'hoffman'; allowed: brightField, darkField, phaseContrast, dic"),
        ({"contrast": "phaseContrast", "condenser_aperture": 1.3}, "condenser_aperture of the microscope reaches 1.3"),
        ({"contrast": "darkField"}, "condenser_inner of the microscope is 0; allowed for darkField: an annulus from 1"),
        ({"ring_transmission": 0.0}, "ring_transmission of the microscope is 0"),
        ({"ring_delay": math.nan}, "ring_delay of the microscope is nan"),
        ({"shear": 0.0}, "shear of the microscope is 0"),
        ({"bias": 3.0}, "bias of the microscope is 3; allowed: in "),
    ],
)
def test_what_pupils_cannot_be(more: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        microscope(**more)
    assert "allowed" in str(caught.value)
