"""What a recorded run adds to its scene so that any program shows it: changed values, missing looks, a camera."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils

from otwarp.scene.appearance.missing import with_missing_looks
from otwarp.scene.drawing.draw_list import View
from otwarp.scene.drawing.drawables import read_drawables
from otwarp.scene.drawing.view import find_camera
from otwarp.scene.transforms import quaternions

_FOCAL_LENGTH = 50.0
_DIGITS = 9


def changed_values(stage: Usd.Stage) -> Sdf.Layer:
    """A layer with the values that the stage's session layer has in place of its file's, and extents that suit them."""
    changed = stage.GetSessionLayer()
    shapes = [UsdGeom.Boundable(stage.GetPrimAtPath(path)) for path in _prims(changed)]
    with Usd.EditContext(stage, changed):
        for shape in shapes:
            if shape and shape.GetExtentAttr().HasAuthoredValue():
                extent = UsdGeom.Boundable.ComputeExtentFromPlugins(shape, Usd.TimeCode.Default())
                if extent is not None:
                    shape.GetExtentAttr().Set(extent)
    kept = Sdf.Layer.CreateAnonymous("changed.usda")
    kept.TransferContent(changed)
    return kept


def _prims(layer: Sdf.Layer) -> list[Sdf.Path]:
    found: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, lambda path: found.append(path) if path.IsPrimPath() else None)
    return found


def missing_appearance(stage: Usd.Stage) -> tuple[Sdf.Layer, Sdf.Path]:
    """A layer with all that the scene lacks, and the path of the camera to look through."""
    dressed = with_missing_looks(stage)
    camera = find_camera(dressed, None, stage.GetRootLayer().GetDisplayName())
    if camera is None:
        unit = UsdGeom.GetStageMetersPerUnit(stage) * 1e6
        path = stage.GetDefaultPrim().GetPath().AppendChild("view")
        while dressed.GetPrimAtPath(path):
            path = path.ReplaceName(path.name + "_run")
        camera = _define_camera(dressed, path, read_drawables(dressed).view, unit)
    return dressed.GetSessionLayer(), camera.GetPath()


def add_layer(layer: Sdf.Layer, added: Sdf.Layer) -> None:
    """Put the prims of one layer into another, which keeps what it says of them itself."""
    prims = Sdf.Layer.CreateAnonymous()  # without the layers that the one added lies over
    for spec in added.rootPrims:
        Sdf.CopySpec(added, spec.path, prims, spec.path)
    UsdUtils.StitchLayers(layer, prims)


def _define_camera(stage: Usd.Stage, path: Sdf.Path, view: View, unit: float) -> Usd.Prim:
    """A perspective camera with this view [µm], on a stage whose unit is `unit` µm."""
    camera = UsdGeom.Camera.Define(stage, path)
    camera.CreateProjectionAttr(UsdGeom.Tokens.perspective)
    camera.CreateFocalLengthAttr(_FOCAL_LENGTH)
    camera.CreateHorizontalApertureAttr(_FOCAL_LENGTH * view.width)
    camera.CreateVerticalApertureAttr(_FOCAL_LENGTH * view.height)
    distance = view.focus / unit
    camera.CreateFocusDistanceAttr(distance)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * distance, 20.0 * distance))
    # in the world, whatever the prims above it do
    camera.SetResetXformStack(True)
    axes = np.stack([view.right, view.up, -view.forward], axis=1)
    x, y, z, w = np.round(quaternions(axes[None])[0], _DIGITS).tolist()
    place = np.round(view.position / unit, _DIGITS).tolist()
    camera.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*place))
    camera.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))
    return camera.GetPrim()
