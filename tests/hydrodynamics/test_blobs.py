"""Refined mobilities against published friction, multipoles and meshes, and the laws they must obey."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.hydrodynamics import blobs, body_mobility
from otwarp.hydrodynamics.mobility import Rods
from otwarp.hydrodynamics.rigid import BodyMobility, relative_change, shift
from tests.reference.stokes_multipoles import cluster_resistance

DIMER = np.array([[0.0, 0, -1], [0, 0, 1]])
L_SHAPE = np.array([[0.0, 0, 0], [2, 0, 0], [4, 0, 0], [0, 2, 0], [0, 0, 1.5]])
L_RADII = np.array([1.0, 1.0, 1.0, 1.0, 0.6])
TRIANGLE = 2 / np.sqrt(3) * np.array([[np.cos(a), np.sin(a), 0] for a in 2 * np.pi * np.arange(3) / 3])
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(2)
ROD: Rods = (np.array([[0.0, 0, -3]]), np.array([[0.0, 0, 3]]), np.array([0.4]))
APERY = 1.2020569031595942  # ζ(3)


def chain(n: int) -> np.ndarray:
    return np.c_[np.zeros((n, 2)), 2.0 * np.arange(n) - (n - 1)]


def fresh(centres, radii=None, rods: Rods | None = None, accuracy: float = 0.01) -> BodyMobility:
    radii = np.ones(len(centres)) if radii is None else np.asarray(radii, float)
    return body_mobility(np.asarray(centres, float), radii, rods=rods, accuracy=accuracy, cache=False)


def about_origin(body: BodyMobility) -> np.ndarray:
    s = shift(body.reference)
    return s @ body.mobility @ s.T


def random_rotation(seed: int) -> np.ndarray:
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def flow_motion(body: BodyMobility, centres, gradient: np.ndarray) -> np.ndarray:
    """(U, Ω) in the flow u = gradient·x."""
    half_curl = 0.5 * np.array(
        [gradient[2, 1] - gradient[1, 2], gradient[0, 2] - gradient[2, 0], gradient[1, 0] - gradient[0, 1]]
    )
    rows = zip(body.flow_coupling, np.asarray(centres, float), strict=True)
    return sum((c @ np.concatenate([gradient @ x, half_curl]) for c, x in rows), np.zeros(6))


@pytest.mark.parametrize("accuracy", [0.01, 0.001])
def test_touching_dimer_against_exact_friction(accuracy):
    """Friction of two touching spheres over that of both apart.

    Along the axis 0.645 (Stimson & Jeffery 1926, doi:10.1098/rspa.1926.0053), across it 0.724 (Goldman, Cox & Brenner
    1966, doi:10.1016/0009-2509(66)85036-4), turning about it 3ζ(3)/4; further digits, and the turning of the axis, from
    multipoles of degree 14, which reproduce the three.
    """
    friction = np.diag(fresh(DIMER, accuracy=accuracy).resistance)
    translation, rotation = friction[:3] / (12 * np.pi), friction[3:] / (16 * np.pi)
    np.testing.assert_allclose(translation, [0.72466, 0.72466, 0.64514], rtol=0.2 * accuracy)
    np.testing.assert_allclose(rotation, [1.87004, 1.87004, 0.75 * APERY], rtol=0.2 * accuracy)
    assert (round(translation[2], 3), round(translation[0], 3)) == pytest.approx((0.645, 0.724), abs=0.0011)


def test_multipoles_reproduce_the_published_dimer():
    friction = np.diag(cluster_resistance(DIMER, np.ones(2), 8))
    np.testing.assert_allclose(friction[[0, 2]] / (12 * np.pi), [0.724, 0.645], atol=7e-4)  # as printed, three digits
    assert friction[5] / (16 * np.pi) == pytest.approx(0.75 * APERY, rel=2e-5)


CLUSTERS = {
    "chain of 3": (chain(3), None),
    "chain of 5": (chain(5), None),
    "triangle": (TRIANGLE, None),
    "tetrahedron": (TETRAHEDRON, None),
    "unequal touching pair": (np.array([[0.0, 0, 0], [1.3, 0, 0]]), [1.0, 0.3]),
    "apart": (np.array([[0.0, 0, 0], [2.1, 0, 0], [0, 3, 1]]), [1.0, 1.0, 0.5]),
}


@pytest.mark.parametrize("name", CLUSTERS)
def test_clusters_against_multipoles(name):
    """At the default accuracy; multipoles of degree 5 are good to 2e-4. The error is within the estimate."""
    centres, radii = CLUSTERS[name]
    radii = np.ones(len(centres)) if radii is None else np.array(radii)
    exact = np.linalg.inv(cluster_resistance(centres, radii, 5))
    body = fresh(centres, radii)
    error = relative_change(exact, about_origin(body))
    assert error < 0.005  # half of what was asked for
    assert error < body.error + 2e-4
    assert body.error <= 0.01


def test_lone_sphere_is_exact():
    a = 1.525
    body = fresh([[0.3, -2, 5]], [a])
    np.testing.assert_array_equal(np.diag(body.mobility), [1 / (6 * np.pi * a)] * 3 + [1 / (8 * np.pi * a**3)] * 3)
    assert (body.error, body.blobs) == (0.0, 0)


def test_sphere_with_others_inside_is_exact():
    body = fresh([[0, 0, 0], [0.2, 0, 0], [0, 0, 0]], [1, 0.5, 1])
    np.testing.assert_array_equal(np.diag(body.mobility)[:3], 1 / (6 * np.pi))


def test_without_accuracy_the_pair_mobilities_serve():
    plain, body = body_mobility(DIMER, np.ones(2)), fresh(DIMER, accuracy=0.0)
    np.testing.assert_array_equal(plain.mobility, body.mobility)
    assert np.isnan(plain.error)


def test_rod_alone_against_a_cylinder():
    """A rod of axis ratio 12.5 with rounded ends, drawn around a small sphere that it buries, lies between the
    cylinders of its whole and of its straight length.

    Tirado, López Martínez & García de la Torre, J. Chem. Phys. 81, 2047 (1984), doi:10.1063/1.447827; good to 1 %.
    """
    half, b = 4.6, 0.4
    body = fresh([[0, 0, 0]], [0.2], ([[0, 0, -half]], [[0, 0, half]], [b]))

    def cylinder(length: float) -> np.ndarray:
        p = length / (2 * b)
        along = (np.log(p) - 0.207 + 0.980 / p - 0.133 / p**2) / (2 * np.pi * length)
        across = (np.log(p) + 0.839 + 0.185 / p + 0.233 / p**2) / (4 * np.pi * length)
        turning = 3 * (np.log(p) - 0.662 + 0.917 / p - 0.050 / p**2) / (np.pi * length**3)
        return np.array([along, across, turning])

    found = np.array([body.mobility[2, 2], body.mobility[0, 0], body.mobility[3, 3]])
    assert np.all(found > 0.99 * cylinder(2 * half + 2 * b))
    assert np.all(found < 1.01 * cylinder(2 * half))


def test_rod_between_spheres_adds_friction():
    """More surface never moves more easily: R with the rod minus R without is positive semi-definite."""
    ends = np.array([[0.0, 0, -3], [0, 0, 3]])
    bare, joined = fresh(ends), fresh(ends, rods=ROD)
    difference = np.linalg.eigvalsh(joined.resistance - bare.resistance)
    assert difference[0] > -0.005 * np.linalg.eigvalsh(joined.resistance)[0]
    assert joined.resistance[0, 0] > 1.1 * bare.resistance[0, 0]  # broadside, the rod feels most of the liquid
    assert len(joined.flow_coupling) == 2


def test_buried_rod_adds_nothing():
    rods = (np.array([[0.0, 0, -0.5]]), np.array([[0.0, 0, 0.5]]), np.array([0.3]))
    centres = DIMER + np.array([0, 0, 1])
    np.testing.assert_array_equal(fresh(centres, rods=rods).mobility, fresh(centres).mobility)


def test_sphere_within_a_rod_leaves_the_rod():
    rod_only = fresh([[0, 0, 0]], [0.1], ROD)
    both = fresh([[0, 0, 0], [0, 0, 2]], [0.1, 0.4], ROD)
    assert relative_change(about_origin(rod_only), about_origin(both)) < 0.003


@pytest.mark.parametrize("seed", range(3))
def test_rigid_motion_of_the_frame(seed):
    """The coverings turn with the body: equivariance to rounding, not only to the accuracy."""
    rotation, move = random_rotation(seed), np.array([100.0, -30, 7])
    rods = (L_SHAPE[:1], L_SHAPE[3:4], np.array([0.5]))
    turned_rods = (rods[0] @ rotation.T + move, rods[1] @ rotation.T + move, rods[2])
    body = fresh(L_SHAPE, L_RADII, rods, accuracy=0.05)
    turned = fresh(L_SHAPE @ rotation.T + move, L_RADII, turned_rods, accuracy=0.05)
    big = np.kron(np.eye(2), rotation)
    np.testing.assert_allclose(turned.reference, rotation @ body.reference + move, atol=1e-9)
    np.testing.assert_allclose(turned.mobility, big @ body.mobility @ big.T, atol=1e-11)
    np.testing.assert_allclose(turned.flow_coupling, big @ body.flow_coupling @ big.T, atol=1e-9)


def test_symmetric_bodies_have_symmetric_mobilities():
    dimer = fresh(DIMER @ random_rotation(4).T + [1, 2, 3])
    np.testing.assert_allclose(dimer.reference, [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(dimer.mobility[3:, :3], 0, atol=1e-13)
    values = np.linalg.eigvalsh(dimer.mobility[:3, :3])
    assert values[0] == pytest.approx(values[1], rel=1e-11)
    tetrahedron = fresh(TETRAHEDRON)
    np.testing.assert_allclose(tetrahedron.mobility[:3, :3], tetrahedron.mobility[0, 0] * np.eye(3), atol=1e-14)


def test_scales_with_length():
    """Translation with 1/λ, coupling with 1/λ², rotation with 1/λ³."""
    small, big = fresh(L_SHAPE, L_RADII, accuracy=0.05), fresh(1e3 * L_SHAPE, 1e3 * L_RADII, accuracy=0.05)
    power = np.add.outer(np.repeat([0.5, 1.5], 3), np.repeat([0.5, 1.5], 3))
    np.testing.assert_allclose(big.mobility * 1e3**power, small.mobility, rtol=1e-9, atol=1e-14)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_any_assembly_is_positive_definite_and_follows_rigid_flows(seed):
    """Spheres and rods thrown together: also nearly coincident, buried, barely touching."""
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 5), rng.integers(0, 3)
    centres = np.round(rng.normal(size=(n, 3)), 1)
    radii = np.round(rng.uniform(0.2, 1.2, n), 1)
    rods = (
        np.round(rng.normal(size=(m, 3)), 1),
        np.round(rng.normal(size=(m, 3)), 1),
        np.round(rng.uniform(0.1, 0.6, m), 1),
    )
    body = fresh(centres, radii, rods, accuracy=0.3)
    assert np.linalg.eigvalsh(body.mobility)[0] > 0
    np.testing.assert_array_equal(body.mobility, body.mobility.T)
    np.testing.assert_allclose(body.cholesky @ body.cholesky.T, body.mobility, rtol=1e-12, atol=1e-17)
    np.testing.assert_allclose(body.mobility[3:, :3], body.mobility[:3, 3:], atol=1e-9)  # centre of diffusion
    w = rng.normal(size=3)
    spin = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    motion = flow_motion(body, centres, spin)
    np.testing.assert_allclose(motion, np.concatenate([np.cross(w, body.reference), w]), atol=1e-8)
    np.testing.assert_allclose(body.flow_coupling.sum(axis=0)[:, :3], np.eye(6)[:, :3], atol=1e-8)


@pytest.mark.parametrize("angle", np.linspace(0, np.pi / 2, 4))
def test_dimer_in_shear_tumbles_like_jefferys_ellipsoid(angle):
    """Turning rate γ̇/2·(1 + B cos 2φ) with B = 0.594 for touching spheres, that of the axis ratio 1.98 (Nir & Acrivos
    1973, J. Fluid Mech. 59, 209): the flow coupling knows how the spheres are sheared. φ is from the gradient."""
    axis = np.array([np.sin(angle), 0, np.cos(angle)])
    centres = np.outer([-1.0, 1.0], axis)
    motion = flow_motion(fresh(centres, accuracy=1e-3), centres, np.outer([1, 0, 0], [0, 0, 1.0]))
    np.testing.assert_allclose(motion[[0, 1, 2, 3, 5]], 0, atol=1e-9)
    assert motion[4] == pytest.approx(0.5 * (1 + 0.594 * np.cos(2 * angle)), abs=3e-4)


def test_body_in_shear_is_free_of_force():
    """The coupling's response to a strain is that of the blobs: swapping sphere for blob changes nothing in the sum."""
    body, shear = fresh(L_SHAPE, L_RADII, accuracy=0.01), np.outer([1, 0, 0], [0, 1.0, 0])
    finer = fresh(L_SHAPE, L_RADII, accuracy=0.002)
    a, b = flow_motion(body, L_SHAPE, shear), flow_motion(finer, L_SHAPE, shear)
    np.testing.assert_allclose(a, b, atol=0.01)
    # not merely the average vorticity, which every rigid flow would give
    assert abs(b[5] + 0.5) > 0.05


def test_equal_bodies_share_one_result():
    first = body_mobility(DIMER, np.ones(2), accuracy=0.2, cache=False)
    assert body_mobility(DIMER.copy(), np.ones(2), accuracy=0.2, cache=False) is first


def test_out_of_reach_is_refused(monkeypatch):
    monkeypatch.setattr(blobs, "MOST_BLOBS", 150)
    with pytest.raises(
        InputError, match=r"argument accuracy = 1e-05: needs 192 surface blobs, more than 150; "
    ) as error:
        body_mobility(DIMER, np.ones(2), accuracy=1e-5, cache=False)
    assert "allowed: [0.0014, 0.5] for this body" in str(error.value)
    many = np.c_[2.5 * np.arange(30), np.zeros((30, 2))]
    with pytest.raises(InputError, match=r"scene: /World/Robot = 0.01: needs .*fewer spheres and rods"):
        body_mobility(many, np.ones(30), accuracy=0.01, cache=False, where="scene: /World/Robot")


@pytest.mark.parametrize("accuracy", [-0.1, 0.6, np.nan, np.inf])
def test_bad_accuracy(accuracy):
    with pytest.raises(InputError, match=r"argument accuracy = .*: must be 0 or in \(0, 0.5\]"):
        body_mobility(DIMER, np.ones(2), accuracy=accuracy)


@pytest.mark.parametrize(
    ("rods", "says"),
    [
        ((np.zeros((1, 3)), np.ones((2, 3)), np.ones(1)), "shapes"),
        ((np.zeros((1, 3)), np.full((1, 3), np.nan), np.ones(1)), "not finite"),
        ((np.zeros((1, 3)), np.ones((1, 3)), np.zeros(1)), "rod 0 has radius 0"),
    ],
)
def test_bad_rods(rods, says):
    with pytest.raises(InputError, match=says):
        body_mobility(DIMER, np.ones(2), rods=rods, accuracy=0.1)
