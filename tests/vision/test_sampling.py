"""Source points and margins: enough of them in the worst plane, few in others, and a warning where they are too few."""

from __future__ import annotations

import dataclasses
import itertools
import warnings

import numpy as np
import pytest

from otwarp.errors import InputError, PlausibilityWarning
from otwarp.vision.fourier import Fourier
from otwarp.vision.frame import framed
from otwarp.vision.illumination import Illumination, lattice
from otwarp.vision.image import images
from otwarp.vision.microscope import Microscope
from otwarp.vision.propagation import propagate
from otwarp.vision.rendering import Rendering, expose, grid_for, light_for, render
from otwarp.vision.sampling import margin_needed, points_needed, reaches
from otwarp.vision.specimen import Specimen

M = Microscope(numerical_aperture=1.2, condenser_aperture=0.5, wavelength=0.6, pixel=0.11)
BALL = Specimen.of_spheres([[0, 0, 0]], 1.0, 1.52)
PLANES = np.array([-8.0, -4.0, 0.0, 4.0, 8.0])
WIDTH = 60


@pytest.fixture(scope="module")
def fourier() -> Fourier:
    return Fourier("cpu")


@pytest.fixture(scope="module")
def all_points(fourier: Fourier) -> np.ndarray:
    """(f, width − 1, width − 1) images of a ball on the axis in the light of every direction of a far larger square.

    Of directions that mirrors make equal one is computed.
    """
    grid = grid_for(BALL, M, WIDTH, WIDTH, PLANES, Rendering(margin=13.0))
    light = lattice(M, grid.length, 0.5 * grid.length)
    folded: dict[tuple[int, int], float] = {}
    for (x, y), weight in zip(np.abs(light.steps).tolist(), light.weights, strict=True):
        key = (max(x, y), min(x, y))
        folded[key] = folded.get(key, 0.0) + weight
    steps, weights = np.array(list(folded)), np.array(list(folded.values()))
    total = np.zeros((len(PLANES), grid.pixels, grid.pixels))
    for n in range(0, len(steps), 16):
        part = Illumination(steps[n : n + 16], weights[n : n + 16])
        spectra = propagate(BALL, M, part, grid, fourier, thickness=0.2)
        total += part.weights.sum() * images(spectra, M, part, grid, fourier, PLANES)
    seen = grid.image(total)[:, 1:, 1:]  # the ball in the middle
    seen = 0.5 * (seen + np.swapaxes(seen, 1, 2))
    return 0.25 * (seen + np.flip(seen, 1) + np.flip(seen, 2) + np.flip(seen, (1, 2)))


def off(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(f) root mean square difference over that of the contrast."""
    away = image[:, 1:, 1:] - reference
    return np.sqrt(np.mean(away**2, axis=(1, 2)) / np.mean((reference - 1.0) ** 2, axis=(1, 2)))


def test_what_is_chosen_is_enough_in_the_worst_plane(fourier: Fourier, all_points: np.ndarray) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exposed = expose(BALL, M, WIDTH, focus=PLANES, rendering=Rendering(thickness=0.2), fourier=fourier)
        found, stated = off(exposed.images(PLANES), all_points), exposed.error(PLANES)
    assert found.max() < 0.07
    assert stated is not None
    # what is stated is of source points alone; the margin and the reference have errors, too
    assert np.all(found < stated + 0.02)
    assert stated.max() < 0.06
    # 61 points on rings and 3 µm around are far from it, and say so
    with pytest.warns(PlausibilityWarning) as said:
        how = Rendering(thickness=0.2, rings=4, margin=3.0)
        few = render(BALL, M, WIDTH, focus=PLANES, rendering=how, fourier=fourier)
    assert off(few, all_points).max() > 0.3
    assert [str(w.message).split(" for planes")[0] for w in said] == [
        "rings is 4, too few source points", "margin is 3 µm, too small"
    ]  # fmt: skip
    assert all("8 µm from a solid" in str(w.message) and ", or auto, would do" in str(w.message) for w in said)


@pytest.mark.quick
@pytest.mark.parametrize("reach", [3.0, 6.0, 9.0, 14.0])
@pytest.mark.parametrize("off_axis", [0.0, 0.1])
def test_a_lattice_has_the_moments_of_the_opening(reach: float, off_axis: float) -> None:
    """Of a disc the mean is its centre and the mean square half the square of its radius; both at every level."""
    m, length = dataclasses.replace(M, condenser_x=off_axis), 29.3
    light, step = lattice(m, length, reach), m.wavelength / 29.3
    assert light.reach >= reach
    levels = [(light.weights, light.reach), *light.sparser]
    for (weights, held), (fewer, next_held) in itertools.pairwise(levels):
        assert held == pytest.approx(np.sqrt(2.0) * next_held)
        assert 0.35 < np.count_nonzero(fewer) / np.count_nonzero(weights) < 0.75
    for weights, _ in levels[:-1]:
        points = step * light.steps[: len(weights)]
        assert weights.sum() == pytest.approx(1.0)
        assert weights @ points == pytest.approx([off_axis, 0.0], abs=0.01)
        from_centre = np.sum((points - [off_axis, 0.0]) ** 2, axis=1)
        spacing = 2.0 * m.condenser_aperture / np.sqrt(np.count_nonzero(weights))
        assert weights @ from_centre == pytest.approx(0.125, abs=0.01 + spacing**2 / 3.0)
    if not off_axis:
        there = {tuple(s): w for s, w in zip(light.steps.tolist(), light.weights, strict=True)}
        assert all(there[-x, y] == pytest.approx(w) == pytest.approx(there[y, x]) for (x, y), w in there.items())


@pytest.mark.quick
def test_rings_in_the_pupils_have_whole_points_alone() -> None:
    ring = dataclasses.replace(M, contrast="phaseContrast", condenser="annulus", condenser_inner=0.4)
    light = lattice(ring, 30.0, 10.0)
    radius = np.hypot(*light.steps.T) * 0.6 / 30.0
    assert np.all((radius > 0.4 - 1e-6) & (radius < 0.5 + 1e-6))
    assert len(light.weights) >= 24
    assert np.ptp(light.weights) == pytest.approx(0.0)


@pytest.mark.quick
def test_farther_planes_need_more() -> None:
    near, far = reaches(M, BALL, [1.0, 9.0])
    assert 3.0 < near < far < 15.0
    assert reaches(M, BALL, [-9.0])[0] == far
    slow = dataclasses.replace(M, numerical_aperture=0.2, condenser_aperture=0.05)
    assert reaches(slow, BALL, [9.0])[0] < 6.0  # no light so steep is seen
    assert margin_needed(M, BALL, 60, 60, [9.0]) > margin_needed(M, BALL, 60, 60, [1.0])
    aside = BALL.moved([3.0, 0.0, 0.0])
    assert margin_needed(M, aside, 60, 60, [9.0], lattice=False) > margin_needed(M, BALL, 60, 60, [9.0], lattice=False)


@pytest.mark.quick
def test_solids_beside_the_image_count_where_their_light_reaches_in() -> None:
    half = 0.5 * WIDTH * M.pixel
    places = [[0, 0, 0], [half + 1.3, 0, 0], [0, -half - 1.2, 3.0], [half + 30.0, 0, 0]]
    solids, planes = Specimen.of_spheres(places, 1.0, 1.52), np.array([4.0])
    there = framed(solids, M, WIDTH, WIDTH, planes, Rendering())
    assert (len(there.specimen), there.inside, len(there.left_out)) == (3, 1, 0)
    tight = framed(solids, M, WIDTH, WIDTH, planes, Rendering(margin=2.25))
    assert (len(tight.specimen), tight.left_out.tolist()) == (2, [1])
    # a solid that the image cuts is held by the margin
    cut = framed(Specimen.of_spheres([[half, 0, 0]], 3.0, 1.52), M, WIDTH, WIDTH, planes, Rendering())
    assert cut.inside == 1
    assert cut.margin >= 3.0
    assert framed(solids.some([3]), M, WIDTH, WIDTH, planes, Rendering()).inside == 0


@pytest.mark.quick
@pytest.mark.parametrize("name", ["rings", "margin"])
def test_a_word_that_is_no_number_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=rf"{name} is 'many'; allowed: auto, or a number"):
        Rendering(**{name: "many"})  # type: ignore[arg-type]


def test_planes_too_far_for_the_memory_are_refused_before_anything_is_computed(fourier: Fourier) -> None:
    """Their number of source points grows with the square of the distance; it is told beforehand, and about right."""
    bead = Specimen.of_spheres([[0.0, 0.0, 0.0]], 1.0, 1.59)
    for far in (1e3, 1e4):
        with pytest.raises(InputError, match=r"light of .* GiB; allowed on .* focal planes nearer to the bodies"):
            expose(bead, Microscope(), 64, focus=[far], fourier=fourier)
    for far in (3.0, 15.0):
        exposed = expose(bead, Microscope(), 32, focus=[far], rendering=Rendering(thickness=1.0), fourier=fourier)
        reach = float(reaches(Microscope(), bead, [far])[0])
        assert points_needed(Microscope(), exposed.grid.length, reach) == pytest.approx(exposed.sources, rel=0.4)


@pytest.mark.parametrize("rings", [4, "auto"])
def test_poses_that_need_the_same_light_share_it(rings, fourier: Fourier) -> None:
    """Making it took a core of family 25 some 20 ms a pose with `auto`."""
    microscope, planes, how = Microscope(condenser_aperture=0.4), np.array([-6.0, 0.0]), Rendering(rings=rings)
    one, other = Specimen.of_spheres([[0, 0, 0]], 0.75, 1.52), Specimen.of_spheres([[0.3, 0, 0]], 0.75, 1.52)
    grid = grid_for(one, microscope, 64, 64, planes, how)
    light = light_for(one, microscope, grid, planes, how, fourier)
    assert light_for(other, microscope, grid, planes, how, fourier) is light
    with pytest.raises(ValueError, match="read-only"):
        light.weights[0] = 1.0
