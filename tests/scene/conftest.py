"""A small hand-written stage that says a little of everything, and how to vary and load it."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.scene import Scene

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    endTimeCode = 60
    framesPerSecond = 30
    metersPerUnit = 1e-6
    startTimeCode = 0
    timeCodesPerSecond = 60
    upAxis = "Z"
)

def Xform "World" (prepend apiSchemas = ["OtSceneAPI"])
{
    double ot:medium:refractiveIndex = 1.33

    def Xform "Trap" (prepend apiSchemas = ["OtTrapAPI", "OtTrapLawAPI:isotropic"])
    {
        double ot:trap:power = 0.03
        double ot:trap:numericalAperture = 1.2
        token ot:trap:model = "piecewise"
        double ot:trap:wavelength = 1.064e-6
        rel ot:trap:holds = </World/Robot/Ball>
        double ot:trapLaw:isotropic:stiffness = 2
        double ot:trapLaw:isotropic:lengthUnit = 1e-6
        double ot:trapLaw:isotropic:forceUnit = 1e-12
        double3 xformOp:translate.timeSamples = { 0: (0, 0, 5), 60: (6, 0, 5) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Xform "Robot" (prepend apiSchemas = ["OtBodyAPI", "PhysicsRigidBodyAPI"])
    {
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]

        def Sphere "Ball" (prepend apiSchemas = ["OtSphereAPI"])
        {
            double radius = 1.5
            double ot:sphere:refractiveIndex = 1.5
            float3 xformOp:scale = (1, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"]
        }
    }

    def Sphere "Cell" (prepend apiSchemas = ["OtCellAPI"])
    {
        double radius = 3
        double3 xformOp:translate = (10, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Cube "Block" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double size = 2
        double3 xformOp:translate = (20, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Xform "Flow" (prepend apiSchemas = ["OtFlowAPI"])
    {
        token ot:flow:kind = "poiseuille"
        double ot:flow:speed = 3e-5
        double ot:flow:halfHeight = 1e-5
    }

    def Xform "Goal" (prepend apiSchemas = ["OtGoalAPI"])
    {
        rel ot:goal:cell = </World/Cell>
        rel ot:goal:robots = [</World/Robot>]
        double3 xformOp:translate = (40, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


class StageFile:
    """Writes variants of the stage into a folder."""

    def __init__(self, folder: Path):
        self.folder = folder

    def write(self, *changes: tuple[str, str], text: str = STAGE, name: str = "scene.usda") -> Path:
        """The stage with each (old, new) replaced once; `old` must be there, so that no case tests nothing."""
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new, 1)
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def load(self, *changes: tuple[str, str], text: str = STAGE) -> Scene:
        """Write and load."""
        return Scene.load(self.write(*changes, text=text))


@pytest.fixture
def stage_file(tmp_path: Path) -> StageFile:
    return StageFile(tmp_path)
