"""A scene or a recorded run as one USD file that looks the same, for programs that want metres, or meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, Vt

from otwarp.scene.appearance.missing import with_missing_looks
from otwarp.scene.drawing.draw_list import MESH
from otwarp.scene.drawing.shapes import ShapeReader
from otwarp.scene.export.meshes import joined, surface
from otwarp.scene.read.diagnostics import reading
from otwarp.scene.read.source import METRES, Source, open_stage
from otwarp.scene.read.typed import Values
from otwarp.scene.write.export import export_layer


def export_flattened(path: str | Path, out: str | Path) -> Path:
    """Write a stage with all that it refers to as one file, which is not changed when they are.

    Raises:
        InputError: `path` cannot be read, or `out` not written.
    """
    return export_layer(open_stage(Path(path)).Flatten(), Path(out))


def export_in_metres(path: str | Path, out: str | Path) -> Path:
    """Write a flattened copy of a stage with `metersPerUnit = 1` that looks and loads the same.

    Every topmost transformable prim is scaled, in double precision, so that single-precision points (meshes, point
    instancers) keep their values. Cameras are scaled back and have their own lengths converted instead, because a
    camera's clipping range and aperture do not follow its transform.

    Args:
        path: USD file with a scene, in any `metersPerUnit`.
        out: File to write: `.usda`, `.usdc` or `.usd`.

    Returns:
        `out`.

    Raises:
        InputError: The file cannot be read or written.
    """
    return export_stage(path, out, metres=True, looks=False)


def export_stage(
    path: str | Path, out: str | Path, *, metres: bool = False, meshes: bool = False, looks: bool = True
) -> Path:
    """Write a flattened copy of a stage or of a recorded run, as one file.

    Args:
        path: USD file with a scene, or the `run.usda` of a recorded run, in any `metersPerUnit`.
        out: File to write: `.usda`, `.usdc` or `.usd`.
        metres: As `export_in_metres`.
        meshes: Put a mesh in the place of every sphere, cube, cylinder, cone, capsule, plane and point. Such a copy is
            a drawing: it can no longer be run.
        looks: Add looks and lights where the scene has none.

    Returns:
        `out`.

    Raises:
        InputError: The file cannot be read or written.
    """
    opened = open_stage(Path(path))
    with reading(str(path)):
        source = Source(opened, str(path))
        flat = Usd.Stage.Open((with_missing_looks(opened) if looks else opened).Flatten())
        if meshes:
            _to_meshes(flat, source)
        if metres:
            _to_metres(flat, source)
        return export_layer(flat.GetRootLayer(), Path(out))


def _to_meshes(stage: Usd.Stage, source: Source) -> None:
    reader = ShapeReader(source.values)
    for prim in list(stage.Traverse()):
        if not prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Mesh):
            continue
        batches = [batch for batch in reader.read(prim, beam=False) if batch.kind != MESH]
        if not batches:
            continue
        # the sides of a plane that is seen from both would lie in each other: the mesh is double-sided
        parts = batches[:1] if prim.IsA(UsdGeom.Plane) else batches
        shape = joined([surface(batch, 1.0 / source.unit) for batch in parts])
        for name in _OF_SHAPES:
            prim.RemoveProperty(name)
        prim.SetTypeName("Mesh")
        mesh = UsdGeom.Mesh(prim)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(shape.points.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.triangles), 3))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.triangles.ravel().astype(np.int32)))
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(shape.normals.astype(np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(len(parts) < len(batches) or bool(source.values.value(prim, "doubleSided")))
        mesh.CreateExtentAttr(UsdGeom.Boundable.ComputeExtentFromPlugins(mesh, Usd.TimeCode.Default()))


_OF_SHAPES = ("radius", "radiusTop", "radiusBottom", "height", "axis", "size", "width", "length", "widths")
"""Properties of shapes that a mesh does not have."""


def _to_metres(stage: Usd.Stage, source: Source) -> None:
    metres = source.unit * 1e-6
    for prim in stage.GetPseudoRoot().GetChildren():
        _scale(prim, metres)
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Camera):
            _convert_camera(source.values, UsdGeom.Camera(prim), metres)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)


def _scale(prim: Usd.Prim, factor: float) -> None:
    """Put a scale outermost on the topmost xformables at or below `prim`, and on those that reset their stack."""
    xformable = UsdGeom.Xformable(prim)
    if xformable:
        _add_scale(xformable, factor, outermost=True)
        for child in Usd.PrimRange(prim):
            inner = UsdGeom.Xformable(child)
            if child != prim and inner and inner.GetResetXformStack():
                _add_scale(inner, factor, outermost=True)
        return
    for child in prim.GetChildren():
        _scale(child, factor)


def _add_scale(xformable: UsdGeom.Xformable, factor: float, *, outermost: bool) -> None:
    ops, reset = xformable.GetOrderedXformOps(), xformable.GetResetXformStack()
    scale = xformable.AddScaleOp(UsdGeom.XformOp.PrecisionDouble, METRES + ("" if outermost else "Inverse"))
    scale.Set(Gf.Vec3d(factor))
    xformable.SetXformOpOrder([scale, *ops] if outermost else [*ops, scale], reset)


def _convert_camera(values: Values, camera: UsdGeom.Camera, metres: float) -> None:
    _add_scale(camera, 1.0 / metres, outermost=False)
    for attribute in (
        camera.GetHorizontalApertureAttr(),
        camera.GetVerticalApertureAttr(),
        camera.GetFocalLengthAttr(),
        camera.GetFocusDistanceAttr(),
        camera.GetClippingRangeAttr(),
    ):
        for code in attribute.GetTimeSamples() or [Usd.TimeCode.Default()]:
            attribute.Set(values.value(camera.GetPrim(), attribute.GetName(), time=code) * metres, code)
