"""The ladder of force models: what each rung is, and how far from exact it says that it is."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.optics.beam import Beam
from otwarp.optics.field import force
from otwarp.optics.fit import pull
from otwarp.optics.mie import Particle
from otwarp.optics.models import MODELS, Ladder

BEAM = Beam(numerical_aperture=1.2, polarization="x", power=7.0)
SPHERE = Particle(radius=0.5, index=1.59)


@pytest.fixture(scope="module")
def ladder(tmp_path_factory) -> Ladder:
    return Ladder(beam=BEAM, sphere=SPHERE, tolerance=1e-2, cache=tmp_path_factory.mktemp("tables"))


def points(count: int, reach: float = 1.0) -> np.ndarray:
    return np.random.default_rng(5).uniform(-reach, reach, (count, 3))


def test_a_law_pulls_as_the_equation_says():
    law = TrapLaw(stiffness=2.0, threshold=1.0, inverse_square=3.0, offset=-1.0, cutoff=1.5)
    found = pull(law, np.array([0.0, 0.5, 0.999, 1.0, 1.25, 1.5, 9.0]))
    assert found == pytest.approx([0.0, 1.0, 1.998, 2.0, 3.0 / 1.5625 - 1.0, 0.0, 0.0])


def test_every_rung_says_how_far_from_exact_it_is(ladder):
    places = points(60)
    exact = force(BEAM, SPHERE, places)
    for name in MODELS:
        gap = np.linalg.norm(ladder.force(name)(places) - exact, axis=1)
        error = ladder.error(name, places, exact=exact)
        assert (error.largest, error.rms) == (gap.max(), pytest.approx(np.sqrt(np.mean(gap**2))))
        assert error.points == 60 and 0.3 < error.peak < 0.35
    assert ladder.error("exact", places).largest == 0.0
    assert ladder.error("table", places, exact=exact).largest <= ladder.tolerance * ladder.table.peak


def test_on_the_fitted_curves_the_rungs_come_in_order(ladder):
    """Off these axes they need not: the radial pull of the split law does not fade along the beam."""
    d = np.linspace(0.0, 2.5, 40)[:, None]
    ways = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    places = np.array([0.0, 0.0, ladder.properties.equilibrium]) + np.concatenate([d * way for way in ways])
    exact = force(BEAM, SPHERE, places)
    rms = [ladder.error(name, places, exact=exact).rms for name in MODELS]
    assert rms == sorted(rms) and rms[2] > 0.01


def test_the_harmonic_rung_is_the_tangent_of_exact_at_the_equilibrium(ladder):
    """0.01 µm away the exact force is within 1 % of its tangent, along the axis and averaged over x and y."""
    centre, h = np.array([0.0, 0.0, ladder.properties.equilibrium]), 0.01
    places = centre + h * np.eye(3)
    exact, spring = np.diag(force(BEAM, SPHERE, places)), np.diag(ladder.force("harmonic")(places))
    assert spring[2] == pytest.approx(exact[2], rel=0.01)
    assert spring[0] == spring[1] == pytest.approx(0.5 * (exact[0] + exact[1]), rel=0.01)


def test_the_isotropic_law_points_at_the_equilibrium_with_the_law_s_strength(ladder):
    places = np.concatenate([points(50, 2.0), [[0.0, 0.0, ladder.properties.equilibrium]]])
    found = ladder.force("piecewise-isotropic")(places)
    d = places - np.array([0.0, 0.0, ladder.properties.equilibrium])
    assert np.abs(np.cross(found, d)).max() < 1e-12
    strength = pull(ladder.piecewise["isotropic"].law, np.linalg.norm(d, axis=1)) / BEAM.force_scale
    assert -np.einsum("ij,ij->i", found, d) == pytest.approx(strength * np.linalg.norm(d, axis=1))
    assert np.all(found[-1] == 0.0)


def test_the_split_law_has_its_two_curves_and_ends_at_the_larger_cutoff(ladder):
    radial, axial = (ladder.piecewise[name].law for name in ("radial", "axial"))
    z, d, reach = ladder.properties.equilibrium, 0.7, max(radial.cutoff, axial.cutoff)
    far = 0.71 * reach
    places = np.array([[d, 0.0, z], [0.0, d, z], [0.0, 0.0, z + d], [0.3, 0.4, z - 0.2], [far, 0.0, z + far]])
    found = BEAM.force_scale * ladder.force("piecewise")(places)
    pull_r, pull_z = float(pull(radial, d)), float(pull(axial, d))
    assert found[:3] == pytest.approx(-np.diag([pull_r, pull_r, pull_z]), abs=1e-12)
    half = float(pull(radial, 0.5))
    assert found[3] == pytest.approx([-0.6 * half, -0.8 * half, float(pull(axial, 0.2))])
    assert np.all(found[4] == 0.0)


def test_q_does_not_depend_on_the_power(ladder):
    bright = Ladder(beam=BEAM.with_power(70.0), sphere=SPHERE, tolerance=1e-2, cache=ladder.cache)
    places = points(20)
    for name in MODELS:
        assert bright.force(name)(places) == pytest.approx(ladder.force(name)(places), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tolerance": 0.5}, ["tolerance", "0.5", "1e-05 to 0.1"]),
        ({"tolerance": float("nan")}, ["tolerance", "nan"]),
        ({"interpolation": "cubic"}, ["cubic", "bilinear, bicubic"]),
        ({"sphere": Particle(radius=0.5, index=1.33)}, ["1.33", "medium"]),
    ],
)
def test_a_ladder_refuses(change, words):
    with pytest.raises(InputError) as caught:
        Ladder(**({"beam": BEAM, "sphere": SPHERE} | change))
    assert all(word in str(caught.value) for word in words)


def test_bad_points_and_names_are_refused(ladder):
    for name in MODELS:
        with pytest.raises(InputError, match="finite"):
            ladder.force(name)(np.array([[0.0, 0.0, np.nan]]))
    with pytest.raises(InputError, match="piecewise-isotropic"):
        ladder.force("cubic")
    with pytest.raises(InputError, match="points"):
        ladder.error("table", np.zeros((0, 3)))
