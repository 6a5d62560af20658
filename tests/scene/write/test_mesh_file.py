"""Meshes of files: what is mended, what is refused and why, and what an obstacle gets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene.meshes import is_closed
from otwarp.scene.write.mesh_file import read_surface

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("networkx")


def ball(subdivisions: int = 3, radius: float = 5.0):
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6.0


@pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
def test_files_are_read_in_their_unit(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"ball.{ending}"
    ball(radius=0.005).export(file)
    found = read_surface(file, metres_per_unit=1e-3)
    assert len(found.triangles) == 1280 and found.repairs == () and is_closed(found.vertices, found.triangles)
    np.testing.assert_allclose(found.size, 10.0, rtol=1e-4)
    assert found.volume == pytest.approx(volume(found.vertices, found.triangles), rel=1e-4) and found.volume > 500.0


def test_corners_stay_apart_in_any_unit() -> None:
    """A part of 2 µm that a program saved in metres has corners 1e-8 apart, which trimesh would join."""
    mesh = ball(6, 1.0)
    whole = read_surface((mesh.vertices, mesh.faces))
    found = read_surface((1e-6 * mesh.vertices, mesh.faces), metres_per_unit=1.0)
    assert len(found.triangles) == len(whole.triangles) == 81_920 and found.repairs == ()
    with pytest.raises(InputError, match=r"is 2e-06 µm long, .*; --scale 1 "):
        read_surface((1e-6 * mesh.vertices, mesh.faces))


def test_a_chamber_looks_inwards_whatever_the_file_does() -> None:
    outwards, inwards = ball(), ball()
    inwards.invert()
    for mesh, repairs in ((outwards, 0), (inwards, 1)):
        for kind, sign in (("solid", 1.0), ("chamber", -1.0)):
            found = read_surface((mesh.vertices, mesh.faces), kind=kind)
            assert sign * volume(found.vertices, found.triangles) > 0.0 and len(found.repairs) == repairs


def test_what_can_be_mended_is_and_is_said() -> None:
    mesh = ball()
    faces = np.asarray(mesh.faces).copy()
    faces[7] = faces[7][::-1]  # looks the other way
    faces = np.concatenate([np.delete(faces, 100, axis=0), faces[:2], [[0, 0, 1]]])  # a hole, two twice, one flat
    found = read_surface((mesh.vertices, faces))
    assert is_closed(found.vertices, found.triangles) and len(found.triangles) == 1280
    assert [r.split()[0] for r in found.repairs] == ["3", "holes", "faces"]


def test_simplified_meshes_say_how_far_the_surface_moved() -> None:
    pytest.importorskip("fast_simplification")
    mesh = ball(4)
    found = read_surface((mesh.vertices, mesh.faces), simplify=400)
    assert 390 <= len(found.triangles) <= 400 and is_closed(found.vertices, found.triangles)
    # facets of n triangles on a sphere of radius R lie some 4πR/(n√3) below it
    assert 0.02 < found.moved < 0.3


def test_a_sheet_may_be_open_and_its_middle_may_be_its_origin() -> None:
    square = (np.array([[5.0, 0, 0], [9, 0, 0], [9, 4, 0], [5, 4, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    found = read_surface(square, kind="sheet", center=True)
    assert found.volume == 0.0 and found.size == (4.0, 4.0, 0.0)
    np.testing.assert_allclose(found.vertices.mean(axis=0), 0.0, atol=1e-12)


def test_what_cannot_be_an_obstacle_is_refused(tmp_path: Path) -> None:
    cut, text, other = tmp_path / "cut.stl", tmp_path / "text.stl", tmp_path / "part.step"
    ball().export(cut)
    cut.write_bytes(cut.read_bytes()[:5000])
    text.write_text("solid x\nfacet nor")
    other.write_text("ISO-10303-21;")
    mesh = ball()
    open_mesh = (mesh.vertices, np.asarray(mesh.faces)[300:])
    flat = (
        np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 0]]),
        np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
    )
    nan = (np.array([[0.0, 0, 0], [np.nan, 0, 0], [0, 4, 0]]), np.array([[0, 1, 2]]))
    whole = (mesh.vertices, mesh.faces)
    for bad, options, said in (
        (tmp_path / "none.stl", {}, r"none\.stl: no such file; allowed: a triangle mesh in STL, OBJ or PLY"),
        (other, {}, r"suffix = \.step; allowed"),
        (cut, {}, r"cut\.stl: is cut off, with 98 of 1,280 triangles; allowed"),
        (text, {}, r"text\.stl: (cannot be read|has no triangles)"),
        (
            open_mesh,
            {},
            r"has holes, \d+ edges in all, the first near \(.*\) µm; allowed: a closed surface, or --as sheet",
        ),
        (flat, {}, "encloses a volume of 0 µm³; allowed"),
        (nan, {}, r"triangle 0 has the corners .*nan.*; allowed: finite"),
        (whole, {"metres_per_unit": 1.0}, r"is 1e\+07 µm long.*allowed: 0.1 to 100000 µm; --scale 1e-06 \(µm\)"),
        (whole, {"metres_per_unit": 1e-12}, "allowed: 0.1 to 100000 µm; --scale"),
        (whole, {"metres_per_unit": -1.0}, r"metres_per_unit = -1: must be in \(0, inf\)"),
        (whole, {"kind": "fluid"}, "kind = fluid: must be one of solid, chamber, sheet"),
        (whole, {"simplify": 3}, "--simplify is 3; allowed: 4 triangles or more"),
    ):
        with pytest.raises(InputError, match=said) as error:
            read_surface(bad, **options)
        assert "\n" not in str(error.value)
