"""Hydrodynamic walls in a stage: read, authored, and refused where they make no sense."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Body, Obstacle, Scene, SceneBuilder, Sphere, Track
from tests.scene.conftest import StageFile

BLOCK = """    def Cube "Block" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double size = 2
"""

PLANE = """    def Plane "Floor" (prepend apiSchemas = ["PhysicsCollisionAPI", "OtObstacleAPI"])
    {
        bool ot:obstacle:hydrodynamic = HYDRODYNAMIC
        uniform token axis = "Z"
    }

"""


def floor(hydrodynamic: str = "true") -> tuple[str, str]:
    return BLOCK, PLANE.replace("HYDRODYNAMIC", hydrodynamic) + BLOCK


@pytest.mark.parametrize(("text", "value"), [("true", True), ("false", False)])
def test_a_plane_says_whether_it_is_hydrodynamic(stage_file: StageFile, text: str, value: bool) -> None:
    floor_, block = stage_file.load(floor(text)).obstacles
    assert (floor_.shape, floor_.hydrodynamic) == ("plane", value)
    assert not block.hydrodynamic


@pytest.mark.parametrize("hydrodynamic", [True, False])
def test_what_is_authored_is_read_back(tmp_path: Path, hydrodynamic: bool) -> None:
    wall = Obstacle(
        prim="/World/Floor",
        shape="plane",
        position=Track.constant((0.0, 0.0, -1.0)),
        orientation=Track.constant((0.0, 0.0, 0.0, 1.0)),
        hydrodynamic=hydrodynamic,
    )
    builder = SceneBuilder()
    builder.add(Body(prim="/World/Bead", spheres=(Sphere(prim="/World/Bead/Ball", radius=0.5),)))
    builder.add(wall)
    path = builder.save(tmp_path / "wall.usda")
    assert Scene.load(path).obstacles == (wall,)
    assert ("OtObstacleAPI" in path.read_text()) == hydrodynamic


MOVING = """        double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 60: (0, 0, -1) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
        uniform token axis = "Z"
"""
API = 'prepend apiSchemas = ["PhysicsCollisionAPI", "OtObstacleAPI"]'


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            [(BLOCK, BLOCK.replace("API", 'API", "OtObstacleAPI').replace(
                "size = 2", "size = 2\n        bool ot:obstacle:hydrodynamic = true"))],
            "/World/Block: ot:obstacle:hydrodynamic = True: must be false on a Cube, true on a Plane",
        ),
        (
            [floor(), ('        uniform token axis = "Z"\n', MOVING)],
            "/World/Floor: ot:obstacle:hydrodynamic = True: must be false on an obstacle that moves",
        ),
        (
            [floor(), (API, 'prepend apiSchemas = ["OtObstacleAPI"]')],
            "/World/Floor: apiSchemas = OtObstacleAPI: must be on an obstacle: a prim with PhysicsCollisionAPI",
        ),
        (
            [floor(), (API, 'prepend apiSchemas = ["PhysicsCollisionAPI"]')],
            "/World/Floor: ot:obstacle:hydrodynamic = True: must be on a prim with OtObstacleAPI applied",
        ),
    ],
    ids=["cube", "moving", "no collider", "schema not applied"],
)  # fmt: skip
def test_bad_walls(stage_file: StageFile, changes: list[tuple[str, str]], message: str) -> None:
    with pytest.raises(InputError) as error:
        stage_file.load(*changes)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_wall_that_is_switched_off_is_none(stage_file: StageFile) -> None:
    off = (
        '        uniform token axis = "Z"\n',
        '        uniform token axis = "Z"\n        bool physics:collisionEnabled = 0\n',
    )
    assert [o.prim for o in stage_file.load(floor(), off).obstacles] == ["/World/Block"]


def test_axes_turn_the_normal(stage_file: StageFile) -> None:
    """A plane along Y is hydrodynamic along Y; the robot starts 2 µm in front of it."""
    robot = ("double3 xformOp:translate = (0, 0, 5)", "double3 xformOp:translate = (0, 2, 5)")
    cell = ("double3 xformOp:translate = (10, 0, 5)", "double3 xformOp:translate = (10, 4, 5)")
    cube = ("double3 xformOp:translate = (20, 0, 1)", "double3 xformOp:translate = (20, 4, 1)")
    wall = stage_file.load(floor(), ('axis = "Z"', 'axis = "Y"'), robot, cell, cube).obstacles[0]
    x, y, z, w = wall.orientation.values[0]
    normal = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(normal, [0.0, 1.0, 0.0], atol=1e-12)
