"""Writes layers atomically, and stages normalised to metres for tools that insist on `metersPerUnit = 1`."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from pxr import Gf, Sdf, Tf, Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.files import FULL
from otwarp.scene.read.diagnostics import reading, usd_reason
from otwarp.scene.read.source import Source, open_stage
from otwarp.scene.read.typed import Values

_SUFFIX = "metres"


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
    stage = open_stage(Path(path))
    with reading(str(path)):
        source = Source(stage, str(path))
        metres = source.unit * 1e-6
        flat = Usd.Stage.Open(stage.Flatten())
        for prim in flat.GetPseudoRoot().GetChildren():
            _scale(prim, metres)
        for prim in flat.Traverse():
            if prim.IsA(UsdGeom.Camera):
                _convert_camera(source.values, UsdGeom.Camera(prim), metres)
        UsdGeom.SetStageMetersPerUnit(flat, 1.0)
        return export_layer(flat.GetRootLayer(), Path(out))


def export_flattened(path: str | Path, out: str | Path) -> Path:
    """Write a stage with all that it refers to as one file, which is not changed when they are.

    Raises:
        InputError: `path` cannot be read, or `out` not written.
    """
    return export_layer(open_stage(Path(path)).Flatten(), Path(out))


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
    scale = xformable.AddScaleOp(UsdGeom.XformOp.PrecisionDouble, _SUFFIX + ("" if outermost else "Inverse"))
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


def export_layer(layer: Sdf.Layer, path: Path) -> Path:
    """Write a layer to `path` through a temporary file in the same folder, so that no partial file is ever seen.

    Raises:
        InputError: Wrong ending, or the file cannot be written.
        OSError: The disk is full; it names `path`.
    """
    if path.suffix not in (".usda", ".usdc", ".usd"):
        raise InputError(f"{path}: suffix = {path.suffix or '(none)'}: must be one of .usda, .usdc, .usd")
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}; must be in a writable folder") from None
    os.close(handle)
    temporary = Path(name)
    try:
        if not layer.Export(name):
            raise InputError(f"{path}: cannot be written: must be in a writable folder")
        temporary.chmod(0o644)
        temporary.replace(path)
    except Tf.ErrorException as error:
        for number in FULL:  # USD says so in words alone
            if os.strerror(number) in str(error):
                raise OSError(number, os.strerror(number), str(path)) from None
        raise InputError(f"{path}: cannot be written ({usd_reason(error)}); must be in a writable folder") from None
    finally:
        temporary.unlink(missing_ok=True)
    return path
