"""The boundary integral on blobs: single sphere, positive definiteness, an independent implementation, its order."""

from __future__ import annotations

import numpy as np
import pytest
from pygrpy import grpy_tensors

from otwarp.hydrodynamics.blobs import ORDER
from otwarp.hydrodynamics.covering import Elements, cover
from otwarp.hydrodynamics.surface import (
    BLOB_RADIUS,
    NORMAL_SELF,
    TANGENT_SELF,
    _self_term,
    node_mobility,
    surface_friction,
)
from tests.reference.stokes_multipoles import cluster_resistance

FRAME = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
DIMER = np.array([[0.0, 0, -1], [0, 0, 1]])


def spheres(centres, radii) -> Elements:
    centres = np.asarray(centres, dtype=float)
    return Elements(centres, centres, np.asarray(radii, dtype=float))


@pytest.mark.parametrize(("count", "tolerance"), [(12, 4e-3), (24, 1e-3), (48, 1e-3), (200, 3e-4), (500, 3e-4)])
def test_single_sphere_has_stokes_friction(count, tolerance):
    """In translation and rotation; the residual of the fit of the self terms and the covering's unevenness remain."""
    a = 2.5
    r = surface_friction(cover(spheres([[0, 0, 0]], [a]), count, FRAME)).resistance
    stokes = np.array([6 * np.pi * a] * 3 + [8 * np.pi * a**3] * 3)
    np.testing.assert_allclose(np.diag(r), stokes, rtol=tolerance)
    scale = 1 / np.sqrt(stokes)
    np.testing.assert_allclose(r * scale[:, None] * scale, np.eye(6), atol=tolerance)


def test_self_terms_tend_to_the_lattice_sums():
    """Regularised Σ 1/r = −3.9003 and Σ 1/r³ = 9.0336 on the square lattice of unit cells (Bonsall & Maradudin 1977).
    The spiral is not that lattice: 1 % of the largest term is allowed for."""
    blob = 4 / (3 * BLOB_RADIUS)
    normal = 3.9003 - blob - 2 / 3 * 9.0336 * BLOB_RADIUS**2
    tangent = 1.5 * 3.9003 - blob + 9.0336 / 3 * BLOB_RADIUS**2
    assert NORMAL_SELF[0] == pytest.approx(normal, abs=0.01 * blob)
    assert TANGENT_SELF[0] == pytest.approx(tangent, abs=0.01 * blob)


def test_blobs_agree_with_pygrpy():
    """The velocities of torque-free blobs are the translational blocks of the grand mobility of pygrpy."""
    c = cover(spheres([[0, 0, 0], [1.3, 0, 0]], [1, 0.5]), 16, FRAME)
    n, h = len(c.area), np.sqrt(c.area)
    ours = node_mobility(c, negative_self=False).reshape(n, 3, n, 3)
    ours[np.arange(n), :, np.arange(n), :] -= _self_term(c, h, np.zeros(n))
    theirs = grpy_tensors.mu(c.position, BLOB_RADIUS * h)[: 3 * n, : 3 * n]
    np.testing.assert_allclose(ours.reshape(3 * n, 3 * n), theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())


@pytest.mark.parametrize("gap", [0.3, 0.0, -0.01, -0.5])
def test_positive_definite_in_crevices(gap):
    """Where blobs of two surfaces come arbitrarily close, too."""
    c = cover(spheres([[0, 0, 0], [2 + gap, 0, 0]], [1, 1]), 150, FRAME)
    eigenvalues = np.linalg.eigvalsh(node_mobility(c))
    assert eigenvalues[0] > 0
    assert np.linalg.eigvalsh(node_mobility(c, negative_self=False))[0] > 0


def test_sparse_covering_far_from_even_is_still_solved():
    """Nodes on top of each other: without negative self terms the matrix is positive definite whatever happens."""
    c = cover(spheres([[0, 0, 0]], [1]), 30, FRAME)
    position = c.position.copy()
    position[1] = position[0] + 1e-9
    crowded = type(c)(position, c.normal, c.area, c.curvature, c.owner)
    np.testing.assert_allclose(np.diag(surface_friction(crowded).resistance)[:3], 6 * np.pi, rtol=0.05)


def test_force_is_what_the_nodes_exert():
    c = cover(spheres(DIMER, [1, 1]), 30, FRAME)
    f = surface_friction(c)
    np.testing.assert_allclose(f.force.sum(axis=0), f.resistance[:3], rtol=1e-9, atol=1e-9)
    torque = np.cross(c.position[:, None], f.force.transpose(0, 2, 1)).sum(axis=0).T
    np.testing.assert_allclose(torque, f.resistance[3:], atol=1e-8)


@pytest.mark.parametrize(
    ("centres", "radii"),
    [(DIMER, [1, 1]), ([[0, 0, 0], [1.3, 0, 0], [0, 1.5, 0]], [1, 0.3, 0.5])],
    ids=["dimer", "unequal"],
)
def test_order_of_convergence(centres, radii):
    """Largest error of the mobility against multipoles, 12 to 192 blobs for each sphere. Averaged over the layouts of
    the spirals, whose unevenness scatters by some 20 %, it falls with the spacing to a power between 2 and 3.4; that
    of the extrapolation is `ORDER`."""
    exact = np.linalg.inv(cluster_resistance(np.array(centres, float), np.array(radii, float), 8))
    scale = 1 / np.sqrt(np.diag(exact))
    counts, errors = np.array([12, 24, 48, 96, 192]), []
    for count in counts:
        layouts = [np.linalg.qr(np.random.default_rng(k).normal(size=(3, 3)))[0] for k in range(3)]
        found = [np.linalg.inv(surface_friction(cover(spheres(centres, radii), count, q)).resistance) for q in layouts]
        errors.append(np.mean([np.abs((m - exact) * scale[:, None] * scale).max() for m in found]))
    order = -2 * np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert 2.0 < order < 3.4
    assert abs(order - ORDER) < 1.0
    assert errors[-1] < 4e-4
