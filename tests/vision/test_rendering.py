"""Images against Mie's solution, symmetries of light, and what a microscope cannot be."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.vision.exact import scattered_spectra
from otwarp.vision.fourier import Fourier
from otwarp.vision.grid import Grid, axial_wavenumbers
from otwarp.vision.illumination import illumination
from otwarp.vision.image import _pixel_response, images
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import propagate
from otwarp.vision.rendering import Rendering, _render_together, expose, render, render_many
from otwarp.vision.specimen import Specimen
from tests.vision.mie import amplitudes, error, sphere_image

FOCUS = np.array([-4.0, -1.0, 1.0, 4.0])
GRID = Grid(96, 96, 96, 96, 0.11)
"""Of one spacing for light and pixels, so that images can be compared point by point."""


@pytest.fixture(scope="module")
def fourier() -> Fourier:
    return Fourier("cpu")


def sharp(image: np.ndarray) -> np.ndarray:
    """Without the averaging over pixels."""
    n = image.shape[-1]
    return np.fft.irfft2(np.fft.rfft2(image) / _pixel_response(n), s=(n, n))


def microscope(**changes: object) -> Microscope:
    return dataclasses.replace(Microscope(condenser_aperture=0.0, pixel=0.11), **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("radius", "index", "source"),
    [pytest.param(0.5, 1.59, 4, marks=pytest.mark.quick), (1.0, 1.52, 6), (1.5, 1.38, 6)],
)
def test_a_sphere_agrees_with_mie(fourier: Fourier, radius: float, index: float, source: int) -> None:
    m = microscope()
    step = 2 * np.pi / GRID.length
    light = dataclasses.replace(illumination(m, GRID.length), steps=np.array([[source, source // 2]]))
    reference = sphere_image(
        radius, index, medium=1.33, wavelength=0.55, aperture=1.2, count=96, spacing=0.11, focus=FOCUS,
        source=(source * step, source // 2 * step),
    )  # fmt: skip
    ball = Specimen.of_spheres([[0, 0, 0]], radius, index)
    exact = sharp(images(scattered_spectra(ball, m, light, GRID, fourier), m, light, GRID, fourier, FOCUS))
    assert error(exact, reference).max() < 2e-4  # single precision
    waves = sharp(images(propagate(ball, m, light, GRID, fourier), m, light, GRID, fourier, FOCUS))
    assert error(waves, reference).mean() < 0.08
    assert np.corrcoef(waves.ravel(), reference.ravel())[0, 1] > 0.99
    # light that is divided before it goes on is several times as exact as a beam of one index
    beam = sharp(images(propagate(ball, m, light, GRID, fourier, method="beam"), m, light, GRID, fourier, FOCUS))
    assert error(waves, reference).mean() < error(beam, reference).mean()


def test_libraries_agree() -> None:
    pytest.importorskip("torch")
    pair = Specimen.of_spheres([[0.4, 0.2, -1.0], [-1.0, 0.5, 0.8]], [0.8, 0.7], [1.5, 1.4])
    m = microscope(condenser_aperture=0.4)
    both = [
        render(pair, m, 32, rendering=Rendering(rings=1), fourier=Fourier("cpu", library))
        for library in ("torch", "scipy")
    ]
    assert np.abs(both[0] - both[1]).max() < 1e-4


def test_mirrored_specimens_have_mirrored_images(fourier: Fourier) -> None:
    m = microscope(condenser_aperture=0.5, pixel=0.1)
    place = np.array([[0.9, 0.3, 0.7], [-0.8, -0.4, -0.6]])
    there = [Specimen.of_spheres(place * turn, [0.8, 0.6], 1.52) for turn in ((1, 1, 1), (-1, 1, 1), (1, -1, 1))]
    how = Rendering(rings=3, margin=1.0)
    seen = [render(s, m, 61, focus=(-3, 3), rendering=how, fourier=fourier) for s in there]
    contrast = np.sqrt(np.mean((seen[0] - 1) ** 2))
    for image, axis in ((seen[1], 2), (seen[2], 1)):
        assert np.sqrt(np.mean((np.flip(image, axis) - seen[0]) ** 2)) < 0.03 * contrast


def test_light_is_kept_and_depth_has_a_sign(fourier: Fourier) -> None:
    ball = Specimen.of_spheres([[0, 0, 0]], 1.0, 1.45)
    whole = expose(ball, microscope(condenser_aperture=0.3), 96, fourier=fourier, rendering=Rendering(margin=0.0))
    below, above = whole.images((-3.0, 3.0))
    assert np.mean([below, above]) == pytest.approx(1.0, abs=0.005)
    # a ball of glass gathers light above itself
    assert above[48, 48] > 1.5 > below[48, 48]


@pytest.mark.quick
@pytest.mark.parametrize(("width", "height"), [(24, 24), (25, 24), (24, 25), (25, 25)])
@pytest.mark.parametrize("margin", [0.5, 0.6])
def test_the_origin_is_the_middle_pixel(fourier: Fourier, width: int, height: int, margin: float) -> None:
    """(width // 2, height // 2), of squares of even and odd sides: labels, templates and networks count from there."""
    ball, how = Specimen.of_spheres([[0.0, 0.0, 0.0]], 0.5, 1.45), Rendering(rings=1, margin=margin, spacing=0.2)
    exposed = expose(ball, microscope(), width, height, rendering=how, fourier=fourier)
    assert exposed.grid.pixels % 2 == (margin == 0.5)
    contrast = np.abs(exposed.images([1.0])[0] - 1.0)
    row, column = np.unravel_index(int(np.argmax(contrast)), contrast.shape)
    assert (int(row), int(column)) == (height // 2, width // 2)


def thrown_back(radius: float, index: float, m: Microscope, area: float) -> float:
    """Share of the light through an area [µm²] that a sphere scatters into the backward half of all directions."""
    k = m.wavenumber
    nodes, weights = np.polynomial.legendre.leggauss(400)
    first, second = amplitudes(0.5 * (nodes - 1.0), k * radius, index / m.medium_index)
    return float(np.sum(0.5 * weights * (np.abs(first) ** 2 + np.abs(second) ** 2))) * np.pi / k**2 / area


@pytest.mark.parametrize(
    ("radius", "index", "lost", "off"),
    [(0.5, 1.59, 0.0002, 0.001), (1.0, 1.52, 0.0005, 0.001), (1.5, 1.59, 0.0036, 0.001), (2.0, 1.59, 0.0075, 0.0035),
     (2.5, 1.38, 0.0001, 0.0035), (2.5, 1.52, 0.0075, 0.0035), (2.5, 1.59, 0.0067, 0.0035)],
)  # fmt: skip
def test_light_is_lost_as_mie_loses_it(fourier: Fourier, radius: float, index: float, lost: float, off: float) -> None:
    """What does not go forward is what the sphere throws back, whatever the slices: its surface loses none."""
    grid, ball = Grid(128, 128, 128, 128, 0.11), Specimen.of_spheres([[0, 0, 0]], radius, index)
    m = microscope(numerical_aperture=1.4, pixel=0.098)
    light = illumination(m, grid.length)
    forward, _ = axial_wavenumbers(m.wavenumber, grid)
    flux = lambda spectra: float(np.sum(np.abs(fourier.numpy(spectra)) ** 2 * forward) / m.wavenumber)  # noqa: E731
    exact = flux(scattered_spectra(ball, m, light, grid, fourier))
    assert 1.0 - exact == pytest.approx(lost, abs=1e-4)
    assert 1.0 - exact == pytest.approx(thrown_back(radius, index, m, grid.length**2), abs=2e-4)
    for thickness in (0.2, 0.1, 0.05):
        found = flux(propagate(ball, m, light, grid, fourier, thickness=thickness))
        assert found == pytest.approx(exact, abs=off)
        assert 0.9932 < found < 1.0005 and (found > 0.9945 or (radius, index) == (2.5, 1.59))


def test_an_empty_field_is_even_and_dark_field_is_dark(fourier: Fourier) -> None:
    nothing = Specimen.of_spheres(np.zeros((0, 3)), 1.0, 1.5)
    assert np.allclose(render(nothing, microscope(condenser_aperture=0.4), 40, fourier=fourier), 1.0, atol=1e-4)
    ring = microscope(
        numerical_aperture=0.7, condenser_aperture=1.1, condenser="annulus", condenser_inner=0.8, pixel=0.15
    )
    assert np.allclose(render(nothing, ring, 40, fourier=fourier), 0.0, atol=1e-6)
    ball = Specimen.of_spheres([[0, 0, 0]], 0.6, 1.5)
    assert render(ball, ring, 40, fourier=fourier).max() > 0.02


def test_aberrations_and_bandwidth_change_images_alone(fourier: Fourier) -> None:
    ball = Specimen.of_spheres([[0, 0, 0]], 0.6, 1.5)
    m = microscope(condenser_aperture=0.3)
    how = Rendering(rings=1, margin=0.5)
    once = expose(ball, m, 32, rendering=how, fourier=fourier)
    plain = once.images((0.0, 1.0))
    aberrated = once.images((0.0, 1.0), objective=dataclasses.replace(m, zernike={11: 0.1}))
    assert np.abs(aberrated - plain).max() > 0.02
    assert np.array_equal(once.images((0.0, 1.0), objective=m), plain)
    broad = render(ball, dataclasses.replace(m, bandwidth=0.03), 32, focus=(0.0, 1.0), rendering=how, fourier=fourier)
    assert 1e-3 < np.abs(broad - plain).max() < 0.2


@pytest.mark.quick
@pytest.mark.parametrize(
    ("what", "said"),
    [
        (lambda: Microscope(numerical_aperture=1.6), "numerical_aperture of the microscope is 1.6"),
        (lambda: Microscope(pixel=0.2), "pixel of the microscope is 0.2"),
        (lambda: Microscope(condenser_aperture=1.4), "condenser_aperture of the microscope is 1.4"),
        (lambda: Microscope(zernike={99: 0.1}), "zernike has 99"),
        (lambda: Rendering(method="magic"), "method is 'magic'"),
        (lambda: Microscope(numerical_aperture=0.0), "numerical_aperture of the microscope is 0; allowed: above 0"),
        (lambda: Microscope(medium_index=0.0), "medium_index of the microscope is 0; allowed: above 0"),
        (lambda: Rendering(spacing=0.0), "spacing is 0 µm; allowed: above 0"),
        (lambda: Specimen.of_spheres([[0, 0, np.nan]], 1.0, 1.5), "start of the specimen"),
        (lambda: Specimen.of_spheres([[0, 0, 0]], -1.0, 1.5), "radius of the specimen is -1"),
        (lambda: render(Specimen.of_spheres([[90, 0, 0]], 1.0, 1.5), Microscope(), 32), "the specimen reaches 91"),
        (lambda: Fourier("cpu", "fftw"), "library is 'fftw'"),
        (
            lambda: render(
                Specimen.of_spheres([[0, 0, 0], [0.5, 0, 0]], 1.0, 1.5),
                Microscope(),
                32,
                rendering=Rendering(method="mie"),
            ),
            "spheres 0 and 1 of the specimen overlap",
        ),
    ],
)
def test_bad_input(what: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        what()  # type: ignore[operator]
    assert "allowed" in str(caught.value)


def test_a_condenser_out_of_focus_sends_waves_that_diverge(fourier: Fourier) -> None:
    nothing = Specimen.of_spheres([[0, 0, 0]], 0.5, 1.33)
    m = microscope(condenser_aperture=0.2, illumination_curvature=0.01, pixel=0.1)
    planes = np.array([-5.0, 0.0, 5.0])
    found = render(nothing, m, 64, focus=planes, rendering=Rendering(rings=2), fourier=fourier)[:, 32, 32]
    # a sphere's area grows with the square of its radius; 1/c = 100 µm
    assert found == pytest.approx((1.0 + 0.01 * planes) ** -2, rel=0.005)
    with pytest.raises(InputError, match=r"illumination_curvature of the microscope is 0\.1 per µm; allowed: "):
        microscope(illumination_curvature=0.1)
    with pytest.raises(InputError, match="allowed for mie: 0"):
        render(nothing, m, 16, rendering=Rendering(method="mie"), fourier=fourier)


def test_a_condenser_off_the_axis_moves_what_is_out_of_focus(fourier: Fourier) -> None:
    ball = Specimen.of_spheres([[0, 0, 0]], 0.3, 1.36)
    m = microscope(condenser_aperture=0.1, condenser_x=0.4, pixel=0.1)
    page = render(ball, m, 64, focus=[3.0], rendering=Rendering(rings=2), fourier=fourier)[0]
    away = np.maximum(np.abs(page - 1.0) - 0.5 * np.abs(page - 1.0).max(), 0.0)
    x = np.sum(away * (np.arange(64) - 32)) * 0.1 / away.sum()
    # light at the angle asin(0.4/1.33) goes sideways by the tangent of it
    assert x == pytest.approx(3.0 * np.tan(np.arcsin(0.4 / 1.33)), abs=0.15)
    with pytest.raises(InputError, match=r"reach an aperture of 1.3[0-9]*; allowed: below 1.33"):
        microscope(condenser_aperture=0.4, condenser_x=0.95)


def test_many_are_rendered_as_each_alone(device: str):
    """Also where they are rendered together, as on a GPU: two colours, lattices and rings, planes near and far."""
    microscope = Microscope(condenser_aperture=0.4, bandwidth=0.02)
    places = ((0.5, 1.0), (0.4, -1.0), (0.0, 2.0))
    specimens = [Specimen.of_spheres([[0.0, 0.0, z], [x, 0.5, 0.0]], 0.6, 1.5) for z, x in places]
    fourier, planes = Fourier(device), np.array([0.0, 5.0])
    for how in (Rendering(thickness=0.4, rings=4, margin="auto"), Rendering(thickness=0.4)):
        alone = [render(s, microscope, 32, 24, focus=planes, rendering=how, fourier=fourier) for s in specimens]
        together = np.zeros((3, 2, 24, 32))
        _render_together(specimens, microscope, planes, how, fourier, together)
        np.testing.assert_allclose(together, alone, atol=1e-5)
        many = render_many(specimens, microscope, 32, 24, focus=planes, rendering=how, fourier=fourier)
        np.testing.assert_allclose(many, alone, atol=1e-5)
        assert np.ptp(together) > 0.5
