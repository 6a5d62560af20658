"""A body as a file of its own: a scene that references and places it has it there, and nothing to warn of."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.scene import Body, Scene, Sphere, write_body
from otwarp.scene.read.validate import validate

BODY = Body(prim="/tool", position=(1.0, 2.0, 3.0), spheres=(Sphere(prim="/tool/a", radius=1.0),))
SCENE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.000001
    upAxis = "Z"
    startTimeCode = 0
    endTimeCode = 60
    timeCodesPerSecond = 60
)
def Xform "World" (prepend apiSchemas = ["OtSceneAPI"])
{
    def Xform "robot" (prepend references = @tool.usda@)
    {%s
    }
}
"""
PLACE = """
        double3 xformOp:translate = (0, 0, 10)
        uniform token[] xformOpOrder = ["xformOp:translate"]"""


BARE = PLACE.rpartition("\n")[0]
"""In the order of the file itself."""


@pytest.mark.parametrize(("said", "place"), [(PLACE, (0, 0, 10)), (BARE, (0, 0, 10)), ("", (0, 0, 0))])
def test_a_scene_references_and_places_a_body(said: str, place: tuple[float, ...], tmp_path: Path) -> None:
    write_body(BODY, tmp_path / "tool.usda")
    file = tmp_path / "scene.usda"
    file.write_text(SCENE % said)
    (robot,) = Scene.load(file).bodies
    assert robot.position == place and robot.spheres[0].radius == 1.0
    assert [f.message for f in validate(file).findings if "no effect" in f.message] == []
