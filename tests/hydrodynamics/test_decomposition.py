"""Meshes as spheres: shapes that are unions of spheres come back, others are covered to the wanted error."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh

from otwarp.errors import InputError
from otwarp.hydrodynamics.decomposition import decompose, union_volume
from otwarp.hydrodynamics.solid import closed_mesh, solid_of

GRID = 0.01
"""Volume of a solid counted in 6,000 cells, relative."""


def test_union_volume_against_closed_form():
    """Two unit spheres at distance d share the lens π(4 + d)(2 − d)²/12; 2,000 points on each resolve it to 1e-3."""
    for d in (0.4, 1.3, 2.5):
        lens = np.pi * (4 + d) * (2 - d) ** 2 / 12 if d < 2 else 0.0
        found = union_volume(np.array([[0.0, 0, 0], [0, d, 0]]), np.ones(2))
        assert found == pytest.approx(8 / 3 * np.pi - lens, rel=3e-3)


def test_solid_of_a_box():
    box = closed_mesh(trimesh.creation.box((1.0, 2.0, 3.0)))
    assert box.volume == pytest.approx(6.0)
    solid = solid_of(box, 3000)
    assert solid.fill.sum() * solid.cell**3 == pytest.approx(6.0, rel=GRID)
    half = np.array([0.5, 1.0, 1.5])
    inside = np.all(np.abs(solid.place) < half, axis=1)
    np.testing.assert_array_equal(solid.depth > 0, inside)
    exact = np.min(half - np.abs(solid.place), axis=1)
    np.testing.assert_allclose(solid.depth[inside], exact[inside], atol=0.1 * solid.cell)


def test_hollow_and_turned_meshes():
    """Two nested spheres, the inner turned inside out, are a shell; a mesh that is turned as a whole is turned back."""
    outer, inner = trimesh.creation.icosphere(3, radius=2.0), trimesh.creation.icosphere(3, radius=1.0)
    inner.invert()
    shell = closed_mesh(trimesh.util.concatenate([outer, inner]))
    assert shell.volume == pytest.approx(4 / 3 * np.pi * 7, rel=0.02)
    solid = solid_of(shell, 4000)
    r = np.linalg.norm(solid.place, axis=1)
    np.testing.assert_array_equal(
        (solid.depth > 0)[(r < 0.95) | ((r > 1.05) & (r < 1.95))],
        ((r > 1.05) & (r < 1.95))[(r < 0.95) | ((r > 1.05) & (r < 1.95))],
    )
    outer.invert()
    assert closed_mesh(outer).volume > 0


def test_a_sphere_comes_back():
    mesh = trimesh.creation.icosphere(4, radius=1.5)
    mesh.apply_translation([1, 2, 3])
    d = decompose(mesh, spheres=5)
    assert len(d.radii) == 1
    np.testing.assert_allclose(d.centres, [[1, 2, 3]], atol=0.01)
    assert d.radii[0] == pytest.approx(1.5, rel=0.003)
    assert d.volume_error < 0.01
    assert d.mobility_error < 0.01


@pytest.mark.thorough
def test_a_dumbbell_comes_back():
    """Two spheres apart, as one mesh of two parts."""
    a, b = trimesh.creation.icosphere(4, radius=1.0), trimesh.creation.icosphere(4, radius=0.6)
    b.apply_translation([2.5, 0, 0])
    d = decompose(trimesh.util.concatenate([a, b]), spheres=2)
    order = np.argsort(-d.radii)
    np.testing.assert_allclose(d.radii[order], [1.0, 0.6], rtol=0.02)
    np.testing.assert_allclose(d.centres[order], [[0, 0, 0], [2.5, 0, 0]], atol=0.03)
    assert abs(d.excess) < 1e-3
    assert d.mobility_error < 0.02


@pytest.mark.thorough
def test_wanted_volume_error_is_kept():
    mesh = trimesh.creation.capsule(height=4.0, radius=1.0)
    d = decompose(mesh, volume_error=0.08)
    assert d.volume_error <= 0.08
    assert 2 < len(d.radii) < 12
    assert d.volume == pytest.approx(mesh.volume)
    assert abs(d.excess) < 1e-3  # the radii are set such that the volumes agree
    assert d.mobility_error < 0.05
    # independently: points in one shape but not in the other
    point = np.random.default_rng(0).uniform(*mesh.bounds, size=(20_000, 3))
    middle = mesh.bounds.mean(axis=0)
    p = point - middle
    beyond = np.maximum(np.abs(p[:, 2]) - 2.0, 0.0)
    in_mesh = p[:, 0] ** 2 + p[:, 1] ** 2 + beyond**2 < 1.0
    in_spheres = (np.linalg.norm(point[:, None] - d.centres, axis=-1) < d.radii).any(axis=1)
    misplaced = np.mean(in_mesh & ~in_spheres) * np.prod(mesh.extents) / mesh.volume  # spheres missing, half of all
    assert misplaced == pytest.approx(0.5 * d.volume_error, abs=0.02)


def test_scale_and_pairs_of_arrays():
    mesh = trimesh.creation.icosphere(3)
    d = decompose((mesh.vertices, mesh.faces), spheres=1, metres_per_unit=2.5e-6)
    assert d.radii[0] == pytest.approx(2.5, rel=0.01)


def test_bad_input(tmp_path, monkeypatch):
    mesh, open_mesh = trimesh.creation.icosphere(2), trimesh.creation.icosphere(2)
    open_mesh.update_faces(np.arange(len(open_mesh.faces)) > 0)
    broken = tmp_path / "broken.stl"
    broken.write_text("not a mesh")
    hole = tmp_path / "hole.stl"
    corners = mesh.triangles.copy()
    corners[7, 1, 2] = np.nan
    trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False).export(hole)
    for call, says in (
        (lambda: decompose(tmp_path / "none.stl"), "none.stl: no such file"),
        (lambda: decompose(broken), "broken.stl: .*allowed: a "),
        (lambda: decompose(hole), r"hole.stl: triangle 7 has the corners .* nan.*; allowed: finite numbers"),
        (lambda: decompose(open_mesh), "argument mesh: the surface has holes"),
        (lambda: decompose((np.zeros((0, 3)), np.zeros((0, 3), int))), "argument mesh: has no triangles"),
        (lambda: decompose(mesh, spheres=0), r"argument spheres = 0: must be a whole number in \[1, 128\]"),
        (lambda: decompose(mesh, spheres=3, volume_error=0.1), "must be left out beside"),
        (lambda: decompose(mesh, volume_error=1.5), r"argument volume_error = 1.5: must be in \(0, 1\)"),
        (lambda: decompose(mesh, metres_per_unit=0.0), r"argument metres_per_unit = 0: must be in \(0, inf\)"),
        (lambda: decompose(mesh, metres_per_unit=0.5), r"is 1e\+06 µm long, by --scale 0.5.* --scale 1e-06 \(µm\)"),
    ):
        with pytest.raises(InputError, match=says) as error:
            call()
        assert "\n" not in str(error.value)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(InputError, match=r"otwarp\[mesh\]"):
        decompose(tmp_path / "none.stl")


def test_out_of_reach_is_refused(monkeypatch):
    from otwarp.hydrodynamics import decomposition as module

    monkeypatch.setattr(module, "MOST_SPHERES", 2)
    with pytest.raises(
        InputError, match=r"argument volume_error = 0.001: 2 spheres are not enough; allowed: \[0\.\d+, 1\)"
    ):
        decompose(trimesh.creation.box((1.0, 1.0, 2.0)), volume_error=0.001)
