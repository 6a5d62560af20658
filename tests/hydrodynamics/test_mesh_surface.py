"""Mobility of meshes against Perrin's spheroids and against the same shape made of a rod."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad

from otwarp.errors import InputError
from otwarp.hydrodynamics import blobs, body_mobility
from otwarp.hydrodynamics.mesh_surface import cover_mesh, mesh_mobility, sample_mesh
from otwarp.hydrodynamics.rigid import relative_change

ICOSPHERE = trimesh.creation.icosphere(subdivisions=4)
FACETS = 0.002
"""The 5,120 triangles lie inside the sphere: their volume is 0.16 % less, their friction 0.05 % (rotation 0.16 %)."""


def perrin(a: np.ndarray) -> np.ndarray:
    """(6,) friction of an ellipsoid with semi-axes a at unit viscosity: translations along, rotations about its axes.

    F. Perrin, J. Phys. Radium 5, 497 (1934), doi:10.1051/jphysrad:01934005010049700: 16π/(χ + α_i a_i²) and
    16π(a_j² + a_k²)/3(a_j² α_j + a_k² α_k), with elliptic integrals χ, α_i from 0 to ∞.
    """

    def root(s: float) -> float:
        return float(np.sqrt(np.prod(a * a + s)))

    chi = quad(lambda s: 1 / root(s), 0, np.inf)[0]
    alpha = np.array([quad(lambda s, i=i: 1 / ((a[i] ** 2 + s) * root(s)), 0, np.inf)[0] for i in range(3)])
    weighted = a * a * alpha
    rotation = [
        16 * np.pi * (a[j] ** 2 + a[k] ** 2) / 3 / (weighted[j] + weighted[k]) for j, k in ((1, 2), (2, 0), (0, 1))
    ]
    return np.concatenate([16 * np.pi / (chi + weighted), rotation])


def test_perrin_of_a_sphere_is_stokes():
    np.testing.assert_allclose(perrin(np.full(3, 1.5)), [6 * np.pi * 1.5] * 3 + [8 * np.pi * 1.5**3] * 3, rtol=1e-6)


@pytest.mark.parametrize(
    "axes",
    [(1, 1, 1), (1, 1, 2), (1, 1, 5), (1, 1, 0.5), (1, 1, 0.2), (1, 1.5, 2.5)],
    ids=lambda a: f"{a[0]}:{a[1]}:{a[2]}",
)
def test_spheroids_against_perrin(axes):
    """Prolate, oblate and three-axial, at an accuracy of 1 %: within half of that, besides the facets."""
    a = np.array(axes, float)
    body = mesh_mobility(ICOSPHERE.vertices * a + [5, 0, -1], ICOSPHERE.faces, 0.01)
    np.testing.assert_allclose(np.diag(body.resistance), perrin(a), rtol=0.005 + FACETS)
    scale = np.sqrt(np.diag(body.mobility))
    np.testing.assert_allclose(body.mobility / scale[:, None] / scale, np.eye(6), atol=0.005)
    np.testing.assert_allclose(body.reference, [5, 0, -1], atol=0.01 * a.max())
    assert 0 < body.error <= 0.01


def test_mesh_of_a_rod_moves_like_the_rod():
    """The two ways to cover a surface, triangles and spirals, are independent."""
    mesh = trimesh.creation.capsule(height=4.0, radius=0.7, count=(48, 48))
    mesh.apply_translation([0, 0, -mesh.bounds.mean(axis=0)[2]])
    from_mesh = mesh_mobility(mesh.vertices, mesh.faces, 0.005)
    rods = (np.array([[0, 0, -2.0]]), np.array([[0, 0, 2.0]]), np.array([0.7]))
    from_rod = body_mobility(np.zeros((1, 3)), np.array([0.1]), rods=rods, accuracy=0.005, cache=False)
    assert relative_change(from_rod.mobility, from_mesh.mobility) < 0.01


def test_samples_and_nodes_share_the_area_evenly():
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    point, normal, area = sample_mesh(box.vertices, box.faces, 5000)
    assert area.sum() == pytest.approx(22.0, rel=1e-12)
    np.testing.assert_allclose(np.abs(point / [0.5, 1, 1.5]).max(axis=1), 1)  # on the faces
    np.testing.assert_allclose((point * normal).sum(axis=1), np.abs(point * normal).sum(axis=1))  # outward
    c = cover_mesh(box.vertices, box.faces, 200)
    assert len(c.area) == pytest.approx(200, abs=4)
    assert c.area.sum() == pytest.approx(22.0, rel=1e-9)
    assert c.area.std() < 0.25 * c.area.mean()


def test_thin_plate_keeps_its_two_sides():
    """Cells wider than the plate do not reach through it: half of the nodes face each way."""
    plate = trimesh.creation.box((4.0, 4.0, 0.1))
    c = cover_mesh(plate.vertices, plate.faces, 120)
    up, down = c.normal[:, 2] > 0.9, c.normal[:, 2] < -0.9
    assert abs(up.sum() - down.sum()) <= 6
    assert up.sum() > 40
    np.testing.assert_allclose(c.position[up, 2], 0.05, atol=0.02)


def test_too_many_blobs(monkeypatch):
    monkeypatch.setattr(blobs, "MOST_BLOBS", 100)
    with pytest.raises(InputError, match=r"needs .* surface blobs, more than 100"):
        mesh_mobility(ICOSPHERE.vertices, ICOSPHERE.faces, 1e-6)
