"""Writes one body as a stage of its own, to be referenced into scenes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, UsdPhysics

from otwarp.errors import InputError
from otwarp.scene.description import IDENTITY, Body
from otwarp.scene.write.builder import SceneBuilder
from otwarp.scene.write.export import export_layer


def write_body(body: Body, path: str | Path) -> Path:
    """Write a stage whose default prim is the body, with its spheres and rods below.

    A scene takes it in by `def Xform "robot" (prepend references = @body.usda@)` and places it with values
    of its own for `xformOp:translate` and `xformOp:orient`. Looks are display colours, because materials would have to
    live outside the body.

    Args:
        body: Its prim path is `/<name>` in the stage; pose and instance do not count.
        path: `.usda`, `.usdc` or `.usd`, written whole or not at all.

    Raises:
        InputError: The body cannot be said in USD, or the file cannot be written.
    """
    source = Sdf.Path(body.prim)
    if not source.IsAbsolutePath() or source.pathElementCount != 1:
        raise InputError(f"{path}: {body.prim}: path = {body.prim}: must be a root prim, /name")
    builder = SceneBuilder(root="/World")
    nested = f"{builder.root}{body.prim}"
    spheres = tuple(replace(s, prim=builder.root + s.prim) for s in body.spheres)
    rods = tuple(replace(r, prim=builder.root + r.prim) for r in body.rods)
    builder.add(replace(body, prim=nested, position=(0.0, 0.0, 0.0), orientation=IDENTITY, spheres=spheres, rods=rods))
    layer = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CopySpec(builder.stage.GetRootLayer(), Sdf.Path(nested), layer, source)
    stage = Usd.Stage.Open(layer)
    for prim in stage.Traverse():
        spec = layer.GetPrimAtPath(prim.GetPath())
        if "material:binding" in spec.relationships:
            prim.RemoveProperty("material:binding")
            kept = [name for name in spec.GetInfo("apiSchemas").prependedItems if name != "MaterialBindingAPI"]
            spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=kept))
    stage.SetDefaultPrim(stage.GetPrimAtPath(source))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1e-6)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1e-15)
    return export_layer(layer, Path(path))
