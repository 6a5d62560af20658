from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import otwarp as ot
from otwarp.scene.read.variations import Variations
from otwarp.scene.transforms import rotate
from otwarp.teleop.page.compose import ball, beam, box, capsule, compose, display, placed, solid, tube
from tests.teleop.page.test_browser import SCENE

SCENES = sorted(file for file in SCENE.parent.glob("*.usda") if file.stem != "ten_thousand_cells")
FINE = 0.05
"""Relative error of the volume of a round solid made of flat faces, at 18 to 32 of them around."""


def volume(triangles: tuple[np.ndarray, np.ndarray]) -> float:
    """By the divergence theorem: positive where faces are seen counter-clockwise from outside, whole if closed."""
    points, faces = triangles
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize(
    ("triangles", "wanted"),
    [
        (ball(3), 4.0 / 3.0 * np.pi),
        (box(), 8.0),
        (tube(1.0), 2.0 * np.pi),
        (tube(0.0), 2.0 / 3.0 * np.pi),
        (capsule(1.5), 4.0 / 3.0 * np.pi + 3.0 * np.pi),
        (placed(box(), np.diag([2.0, 3.0, 4.0, 1.0])), 192.0),
        (placed(box(), np.diag([-1.0, 1.0, 1.0, 1.0])), 8.0),
    ],
)
def test_solids_are_closed_and_face_outwards(triangles: tuple[np.ndarray, np.ndarray], wanted: float):
    assert volume(triangles) == pytest.approx(wanted, rel=FINE)


def test_a_beam_is_narrow_at_its_focus():
    points, _ = beam()
    radius, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    assert radius[np.abs(z) < 1e-9] == pytest.approx(0.22) and radius[np.abs(z) > 9.99] == pytest.approx(2.1)
    with pytest.raises(ValueError, match="solid kind = 99"):
        solid(99, (0.0, 0.0))


@pytest.mark.parametrize("file", SCENES, ids=lambda file: file.stem)
def test_every_body_is_drawn_where_it_starts(file: Path):
    scene = ot.Scene.load(file)
    drawn = pickle.loads(pickle.dumps(compose(scene)))
    balls = np.concatenate([group.bodies for group in drawn.balls]) if drawn.balls else np.zeros(0, dtype=int)
    assert sorted([*balls.tolist(), *(body.index for body in drawn.bodies)]) == list(range(len(scene.bodies)))
    for body in drawn.bodies:
        seen = np.concatenate([part.vertices for part in body.parts])
        for sphere in scene.bodies[body.index].spheres:  # its surface is in the picture, in the body's own frame
            distance = np.linalg.norm(seen - sphere.offset, axis=1)
            assert np.abs(distance - sphere.radius).min() < 1e-4
    assert [trap.held for trap in drawn.traps] == [
        next((i for i, b in enumerate(scene.bodies) if any(s.prim == t.holds for s in b.spheres)), -1)
        for t in scene.traps
    ]


def test_a_scene_without_a_stage_is_drawn_from_its_description():
    scene = ot.Scene.load(SCENE)
    bare = compose(dataclasses.replace(scene, file=None))
    authored = compose(scene)
    assert len(bare.bodies) == len(authored.bodies) == 2 and len(bare.balls) == 1
    assert bare.balls[0].radii == pytest.approx(authored.balls[0].radii)
    low, high = (f(np.concatenate([p.vertices for p in bare.fixed]), axis=0) for f in (np.min, np.max))
    assert (low < -30).any() and (high > 30).any()
    camera = bare.camera
    assert np.linalg.norm(np.subtract(camera.position, camera.look_at)) > 10.0


def test_a_scene_of_other_values_than_its_file_is_drawn_with_them():
    hub = "/World/Robots/left/hub"
    scene = Variations(SCENE).scene({f"{hub}.radius": 2.5})
    (sphere,) = (s for s in scene.bodies[0].spheres if s.prim == hub)
    for one in (scene, ot.Scene.load(SCENE)):
        seen = np.concatenate([part.vertices for part in compose(one).bodies[0].parts])
        distance = np.linalg.norm(seen - sphere.offset, axis=1)
        assert (np.sum(np.abs(distance - 2.5) < 1e-6) > 100) == (one is scene)


def test_an_obstacle_moves_along_its_samples():
    scene = ot.Scene.load(SCENE.with_name("cell_delivery.usda"))
    moving = [o for o in scene.obstacles if o.position.animated]
    drawn = compose(scene)
    assert len(drawn.moving) == len(moving) == 4
    for k, obstacle in enumerate(moving):
        for time in (0.0, 0.31, 1e9):
            position, orientation = drawn.moving[k].at(time)
            assert position == pytest.approx(obstacle.position.at(time))
            assert np.linalg.norm(orientation) == pytest.approx(1.0)
        # drawn at the start it lies where the stage has it: about its own origin
        position, orientation = drawn.moving[k].at(0.0)
        points = rotate(orientation, np.concatenate([p.vertices for p in drawn.moving[k].parts])) + position
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        assert middle == pytest.approx(obstacle.position.at(0.0), abs=1e-4)


def test_colours_are_those_of_a_screen():
    assert display((0.0, 1.0, 2.0)) == (0, 255, 255)
    assert display((0.214041, 0.5, 0.0031308))[:2] == (127, 188)  # IEC 61966-2-1


def test_the_session_loads_no_viser_and_the_page_no_warp():
    session = "import sys, otwarp.teleop.page; print({'viser', 'warp'} & set(sys.modules))"
    child = "import sys, otwarp.teleop.page.child; print({'viser', 'warp', 'pxr'} & set(sys.modules))"
    for code in (session, child):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "set()"
