"""Robots and meshes that are added to a scene that is drawn."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.scene.write.edit import StageEditor
from otwarp.view.new_pieces import ROBOTS, add_mesh, add_robot, read_mesh
from tests.view.runs import SCENE

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


@pytest.fixture
def editor() -> Iterator[StageEditor]:
    found = StageEditor(SCENE)
    yield found
    found.close()


def tetrahedron() -> bytes:
    """As a text of STL, with a unit of length."""
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {:g} {:g} {:g}\n".format(*CORNERS[k]) for k in face)
        + "endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid t\n{facets}endsolid t\n".encode()


@pytest.mark.parametrize("shape", ROBOTS)
def test_a_robot_has_touching_spheres_and_a_trap_on_each_end(editor: StageEditor, shape: str):
    before, (centres, ends) = editor.scene, ROBOTS[shape]
    gaps = [np.linalg.norm(np.subtract(a, b)) - 2.0 for k, a in enumerate(centres) for b in centres[:k]]  # of radius 1
    assert min(gaps) == pytest.approx(0.0, abs=1e-4)
    path = add_robot(editor, shape, (0.0, 0.0, 30.0), 1.5)
    assert editor.undoable == 1
    robot = next(body for body in editor.scene.bodies if body.prim == path)
    assert len(robot.spheres) == len(centres) and {s.radius for s in robot.spheres} == {1.5}
    traps = [t for t in editor.scene.traps if (t.holds or "").startswith(f"{path}/")]
    assert [t.holds for t in traps] == [f"{path}/sphere_{k}" for k in ends]
    for trap, k in zip(traps, ends, strict=True):
        assert trap.position.at(0.0) == pytest.approx(1.5 * np.array(centres[k]) + (0, 0, 30), abs=1e-5)
        assert trap.hand == "none" and trap.radial == before.traps[0].radial
    editor.undo()
    assert editor.scene == before
    with pytest.raises(InputError, match="must be above 0"):
        add_robot(editor, shape, (0.0, 0.0, 30.0), 0.0)


def test_what_is_added_is_saved_with_all_else(editor: StageEditor, tmp_path: Path):
    pytest.importorskip("trimesh")
    before = editor.scene
    add_robot(editor, "pair", (0.0, 0.0, 30.0), 1.0)
    surface = read_mesh("part.STL", tetrahedron(), 6.0, "solid")
    assert surface.size == pytest.approx((6.0, 6.0, 6.0))
    path = add_mesh(editor, surface, (12.0, 0.0, 30.0))
    found = Scene.load(editor.save(tmp_path / "more.usda"))
    assert found.bodies[:-1] == before.bodies and found.traps[:-2] == before.traps
    assert found.obstacles[:-1] == before.obstacles and found.goal == before.goal
    mesh = found.obstacles[-1]
    assert mesh.prim == path and mesh.shape == "mesh" and len(mesh.vertices) == 4
    assert mesh.position.at(0.0) == pytest.approx((12.0, 0.0, 30.0))
    assert np.abs(mesh.vertices).max() == pytest.approx(3.0)


def test_a_mesh_that_cannot_be_read_is_refused_by_its_name():
    pytest.importorskip("trimesh")
    for name, content in (("part.stl", b"nothing"), ("part.step", tetrahedron()), ("part.stl", b"")):
        with pytest.raises(InputError, match=r"^part\."):
            read_mesh(name, content, 1.0, "solid")
    with pytest.raises(InputError, match=r"part\.stl: is 1e\+06 µm long"):
        read_mesh("part.stl", tetrahedron(), 1e6, "solid")
