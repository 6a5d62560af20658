"""A stage with a prim of every kind that otwarp reads, and what can be said of each: for fuzzing."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdGeom

from otwarp.scene.read.attributes import NAMES
from tests.scene.conftest import STAGE

_PRIMS = """
    def Mesh "Wedge" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        point3f[] points = [(80, 0, 0), (90, 0, 0), (80, 10, 0), (80, 0, 10)]
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
        color3f[] primvars:displayColor = [(1, 0, 0)]
        rel material:binding = </World/Paint>
    }

    def Cylinder "Pillar" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double3 xformOp:translate.timeSamples = { 0: (60, 60, 5), 60: (61, 60, 5) }
        float xformOp:rotateX = 10
        quatf xformOp:orient = (1, 0, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX", "xformOp:orient"]
    }

    def Capsule "Pill" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (-60, 0, 0, 1))
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }

    def Plane "Floor" (prepend apiSchemas = ["PhysicsCollisionAPI", "OtObstacleAPI"])
    {
        double3 xformOp:translate = (0, 0, -50)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def Points "Dust"
    {
        point3f[] points = [(0, 90, 0), (1, 90, 0)]
        float[] widths = [1, 2]
    }

    def PointInstancer "Cells"
    {
        rel prototypes = </World/Cells/Cell>
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 70, 0), (0, 80, 0)]
        quath[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (2, 2, 2)]

        def Sphere "Cell" (prepend apiSchemas = ["OtCellAPI"])
        {
        }
    }

    def Xform "Bar" (prepend apiSchemas = ["OtBodyAPI"])
    {
        double3 xformOp:translate = (0, -40, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]

        def Sphere "Ball" (prepend apiSchemas = ["OtSphereAPI"])
        {
        }

        def Capsule "Rod" (prepend apiSchemas = ["OtRodAPI"])
        {
            double radius = 0.2
        }
    }

    def Camera "Eye" (prepend apiSchemas = ["OtCameraAPI"])
    {
        double3 xformOp:translate = (0, 0, 200)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def DistantLight "Sun"
    {
    }

    def RectLight "Lamp"
    {
    }

    def Material "Paint"
    {
        token outputs:surface.connect = </World/Paint/Shader.outputs:surface>

        def Shader "Shader"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.5, 0.5, 0.5)
            float inputs:opacity = 1
            float inputs:roughness = 0.5
            token outputs:surface
        }
    }
}
"""

EVERYTHING = STAGE.rstrip().removesuffix("}") + _PRIMS

_NATIVE = ("primvars:displayColor:indices", "xformOp:translate", "xformOp:scale", "xformOp:orient", "xformOp:transform")


def attributes(stage: Usd.Stage) -> list[tuple[str, str, str]]:
    """(prim, attribute, type) of all that a schema says, or that otwarp reads, of the prims of a stage."""
    found = []
    for prim in stage.Traverse():
        names = {name for name in prim.GetPropertyNames() if prim.GetAttribute(name)}
        if prim.IsA(UsdGeom.Xformable):
            names |= set(_NATIVE)
        for name in sorted(names):
            kind = str(prim.GetAttribute(name).GetTypeName()) if prim.GetAttribute(name) else "double3"
            found.append((str(prim.GetPath()), name, kind))
    return found


def known(name: str) -> bool:
    """Whether the vocabulary has an attribute of this name."""
    return name in NAMES


def override(base: str, prim: str, name: str, kind: str, value: object, *, sampled: bool = False) -> Sdf.Layer:
    """A layer above the file `base` that says one attribute of one prim."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.subLayerPaths.append(base)
    below = Sdf.Layer.FindOrOpen(base)
    for field in ("defaultPrim", "metersPerUnit", "upAxis", "startTimeCode", "endTimeCode", "timeCodesPerSecond"):
        layer.pseudoRoot.SetInfo(field, below.pseudoRoot.GetInfo(field))
    spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, prim), name, Sdf.ValueTypeNames.Find(kind))
    if sampled:
        layer.SetTimeSample(spec.path, 0.0, value)
        layer.SetTimeSample(spec.path, 60.0, value)
    else:
        spec.default = value
    return layer
