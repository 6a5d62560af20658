"""A stage → the looks that it does not have: scenes written by hand give things their place, and often no colour."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdPhysics, UsdShade

from otwarp.scene.appearance import palette
from otwarp.scene.appearance.lights import define_lights
from otwarp.scene.appearance.materials import GLOW, Materials, author_extent, draw_beam
from otwarp.scene.read.attributes import applied_schemas
from otwarp.scene.read.typed import Values

TOLERANCE = "ot:goal:tolerance"
_OWNERS = ("OtBodyAPI", "OtCellAPI", "OtTrapAPI", "OtGoalAPI")


def with_missing_looks(stage: Usd.Stage) -> Usd.Stage:
    """The same layers, and in the session layer of the result, over that of `stage`, what they lack.

    Gprims without a material get one: of their display colour, or of what they are (each robot its own, cells and goals
    translucent, light glowing). Traps without geometry get a beam, goals without one a ball of their tolerance; a stage
    without lights gets a dome and a key light. Nothing that is authored is changed, nor is `stage`.
    """
    looks = Sdf.Layer.CreateAnonymous("looks.usda")
    looks.subLayerPaths.append(stage.GetSessionLayer().identifier)
    dressed = Usd.Stage.Open(stage.GetRootLayer(), looks)
    dressed.SetEditTarget(looks)
    values = Values(stage.GetRootLayer().GetDisplayName(), Usd.TimeCode.EarliestTime())
    owned = list(_owned(dressed))
    root = str(dressed.GetDefaultPrim().GetPath()) if dressed.GetDefaultPrim() else ""
    materials = Materials(dressed, root)
    drawn = {owner.GetPath() for prim, owner, _, _ in owned if prim.IsA(UsdGeom.Gprim) and owner}
    metres = UsdGeom.GetStageMetersPerUnit(dressed)
    for prim, owner, kind, index in owned:
        if prim.IsA(UsdGeom.Gprim):
            _colour(materials, values, prim, kind, index)
        elif prim == owner and prim.IsA(UsdGeom.Xformable) and prim.GetPath() not in drawn:
            if kind == "OtTrapAPI":
                draw_beam(dressed, materials, prim, _beam(values, prim), palette.BEAM_OPACITY, scale=1e-6 / metres)
            elif kind == "OtGoalAPI":
                _ball(dressed, materials, prim, values.number(prim, TOLERANCE, absent=1e-6) / metres)
    lit = any(prim.HasAPI(UsdLux.LightAPI) for prim in dressed.Traverse())
    if not lit and not dressed.GetPrimAtPath(f"{root}/Lights"):
        define_lights(dressed, root)
    return dressed


def _owned(stage: Usd.Stage) -> Iterator[tuple[Usd.Prim, Usd.Prim | None, str, int]]:
    """All prims with the body, cell, trap or goal that they belong to, what that is, and its index among robots."""
    robots = 0
    stack: list[tuple[Usd.Prim, str, int]] = []
    for prim in stage.Traverse():
        while stack and not prim.GetPath().HasPrefix(stack[-1][0].GetPath()):
            stack.pop()
        applied = applied_schemas(prim)
        if kind := next((name for name in _OWNERS if name in applied), ""):
            stack.append((prim, kind, robots))
            robots += kind == "OtBodyAPI"
        owner, owned, index = stack[-1] if stack else (None, "", 0)
        yield prim, owner, owned, index


def _colour(materials: Materials, values: Values, prim: Usd.Prim, kind: str, index: int) -> None:
    """Give a gprim without a material one, and display values where it has none."""
    if UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]:
        return
    color, opacity = _kind_look(prim, kind, index)
    primvars = UsdGeom.PrimvarsAPI(prim)
    given = [primvars.FindPrimvarWithInheritance(name) for name in ("displayColor", "displayOpacity")]
    if given[0] and given[0].HasValue():
        shown = _single(values, given[0])
        if shown is None:  # many colours, or none that can be read: those who draw it say so
            return
        color, opacity = (shown[0], shown[1], shown[2]), 1.0
    if given[1] and given[1].HasValue():
        shown = _single(values, given[1])
        if shown is None:
            return
        opacity = shown[0]
    # where they come from a prim above, they stay there
    if not (given[0] and given[0].HasValue()) and not (given[1] and given[1].HasValue()):
        materials.paint(prim, color, opacity, extent=False)
    materials.bind(prim, color, opacity, glow=GLOW if kind == "OtTrapAPI" else 0.0)


def _single(values: Values, primvar: UsdGeom.Primvar) -> list[float] | None:
    """The one value of a display primvar, None if it has not exactly one."""
    width, types = (3, ("color3f[]", "color3f")) if "Color" in primvar.GetName() else (1, ("float[]", "float"))
    found = values.array(primvar.GetAttr().GetPrim(), primvar.GetName(), width, types=types)
    if len(found) != 1 or primvar.IsIndexed():
        return None
    return np.clip(found.ravel(), 0.0, 1.0).tolist() if np.isfinite(found).all() else None


def _kind_look(prim: Usd.Prim, kind: str, index: int) -> tuple[palette.Color, float]:
    if kind == "OtBodyAPI":
        return palette.robot_color(index), 1.0
    if kind == "OtTrapAPI":
        return palette.BEAMS["none"], 1.0 if prim.IsA(UsdGeom.Sphere) else palette.BEAM_OPACITY
    if kind:
        return {"OtCellAPI": palette.CELL, "OtGoalAPI": palette.GOAL}[kind]
    if prim.HasAPI(UsdPhysics.CollisionAPI):
        return palette.GROUND if prim.IsA(UsdGeom.Plane) else palette.OBSTACLE
    return palette.OTHER


def _beam(values: Values, trap: Usd.Prim) -> palette.Color:
    return palette.BEAMS.get(str(values.value(trap, "ot:trap:hand", absent="none")), palette.BEAMS["none"])


def _ball(stage: Usd.Stage, materials: Materials, goal: Usd.Prim, radius: float) -> None:
    """A ball at a goal that is a bare Xform."""
    ball = UsdGeom.Sphere.Define(stage, goal.GetPath().AppendChild("Ball"))
    ball.CreateRadiusAttr(radius)
    author_extent(ball.GetPrim())
    materials.paint(ball.GetPrim(), *palette.GOAL)
    materials.bind(ball.GetPrim(), *palette.GOAL)
