"""A scene's bodies as solids of the microscope."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Body, Camera, Rod, Scene, SceneBuilder, Sphere
from otwarp.vision.datasets.robot import Robot
from otwarp.vision.view import specimen_of


def scene(path: Path, index: float | None = None) -> Scene:
    """A ball with two rods, of which the second has an index of its own; and the camera that sees it."""
    rods = (
        Rod(prim="/World/R/Arm", start=(0.0, 0.0, 0.0), end=(4.0, 0.0, 0.0), radius=0.4),
        Rod(prim="/World/R/Tail", start=(0.0, 0.0, 0.0), end=(0.0, 3.0, 0.0), radius=0.2, refractive_index=index),
    )
    builder = SceneBuilder()
    ball = Sphere(prim="/World/R/Ball", radius=1.0, refractive_index=1.59)
    builder.add(Body(prim="/World/R", position=(1.0, 2.0, 5.0), spheres=(ball,), rods=rods))
    builder.add(Camera(prim="/World/Eye"))
    return Scene.load(builder.save(path / "robot.usda"))


@pytest.mark.quick
def test_rods_have_their_own_index_or_that_of_the_first_sphere(tmp_path: Path) -> None:
    plain, glass = scene(tmp_path), scene(tmp_path, 1.45)
    assert [r.refractive_index for r in plain.bodies[0].rods] == [None, None]
    assert [r.refractive_index for r in glass.bodies[0].rods] == [None, 1.45]
    pose = np.array([[1.0, 2.0, 5.0]]), np.array([[0.0, 0.0, 0.0, 1.0]])
    for said, index in ((plain, [1.59, 1.59, 1.59]), (glass, [1.59, 1.59, 1.45])):
        assert specimen_of(said, *pose).index.tolist() == index
        assert Robot.of_body(said).index.tolist() == index
    with pytest.raises(InputError, match=r"Tail: ot:rod:refractiveIndex = 0\.9: must be 0 or \[1, 5\]"):
        scene(tmp_path, 0.9)
