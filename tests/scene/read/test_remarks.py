"""What a file says without any effect is told, here of parts that are brought in from files of other conventions."""

from __future__ import annotations

import pytest

from otwarp.scene import Scene
from tests.scene.conftest import STAGE, StageFile

BLOCK = STAGE[STAGE.index('    def Cube "Block"') : STAGE.index('    def Xform "Flow"')]

PART = """#usda 1.0
(
    defaultPrim = "Part"
    metersPerUnit = {unit}
)

def Cube "Part" (prepend apiSchemas = ["PhysicsCollisionAPI"])
{{
    double size = 2
}}
"""


def brought_in(arc: str, op: str) -> str:
    """A prim far off that brings a file in, and is turned or scaled by one transform op, or by none."""
    order = ", ".join(f'"{word}"' for word in ["xformOp:translate", *op.split()[1:2]])
    return f"""    def "Part" (prepend {arc})
    {{
        {op}
        double3 xformOp:translate = (5e4, 0, 0)
        uniform token[] xformOpOrder = [{order}]
    }}

"""


def remarks(scene: Scene) -> list[str]:
    return [f"{finding.prim}: {finding.message}" for finding in scene.remarks]


@pytest.mark.parametrize("arc", ["references", "payload"])
@pytest.mark.parametrize(
    ("unit", "scale", "told"),
    [("1e-3", "(1, 1, 1)", True), ("1e-3", "(1000, 1000, 1000)", False), ("1e-6", "(3, 3, 3)", False)],
)
def test_a_part_in_another_unit_is_told_unless_it_is_scaled(arc, unit, scale, told, stage_file: StageFile) -> None:
    part = stage_file.write(text=PART.format(unit=unit), name="part.usda")
    prim = brought_in(f"{arc} = @./{part.name}@", f"double3 xformOp:scale = {scale}")
    found = [text for text in remarks(stage_file.load((BLOCK, prim + BLOCK))) if "metersPerUnit" in text]
    wanted = (
        "/World/Part: part.usda has metersPerUnit = 0.001, this stage 1e-06, and USD does not convert: "
        "its numbers count in units of the stage; scale the prim by 1000"
    )
    assert found == ([wanted] if told else [])


UPS = {
    "Y as it is": ("Y", "", True),
    "Z": ("Z", "", False),
    "turned upright": ("Y", "float xformOp:rotateX = 90", False),
    "turned upright, and leaning": ("Y", "float xformOp:rotateX = 110", False),
    "turned about Z": ("Y", "float xformOp:rotateZ = 90", True),
    "upside down": ("Y", "float xformOp:rotateX = -90", True),
}
"""How a part that is brought in says what is up, how it is turned, and whether that is told."""


@pytest.mark.parametrize("case", UPS)
def test_a_part_with_y_up_is_told_unless_it_is_turned(case: str, stage_file: StageFile) -> None:
    axis, turn, told = UPS[case]
    text = PART.format(unit="1e-6").replace("(\n    defaultPrim", f'(\n    upAxis = "{axis}"\n    defaultPrim', 1)
    part = stage_file.write(text=text, name="part.usda")
    prim = brought_in(f"references = @./{part.name}@", turn)
    found = [line for line in remarks(stage_file.load((BLOCK, prim + BLOCK))) if "upAxis" in line]
    wanted = (
        "/World/Part: part.usda has upAxis = Y, this stage Z, and USD does not turn it: "
        "its Y is the stage's Y; turn the prim by 90 degrees about X"
    )
    assert found == ([wanted] if told else [])
