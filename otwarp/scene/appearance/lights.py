"""Lights of a stage, in units that any renderer shows rightly at its usual exposure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from otwarp.scene.appearance.palette import DOME, DOME_COLOR, KEY, KEY_COLOR, KEY_DIRECTION, Color
from otwarp.scene.transforms import look_at

_DIGITS = 9


def define_dome(stage: Usd.Stage, path: str | Sdf.Path, intensity: float, color: Color) -> Usd.Prim:
    """Light that is the same from everywhere, of this radiance."""
    light = UsdLux.DomeLight.Define(stage, path)
    light.CreateIntensityAttr(float(intensity))
    light.CreateColorAttr(Gf.Vec3f(*color))
    return light.GetPrim()


def define_distant(
    stage: Usd.Stage, path: str | Sdf.Path, direction: Sequence[float], intensity: float, color: Color
) -> Usd.Prim:
    """Light along `direction` (of any length, in the frame of the prim above it), of this irradiance.

    Without `normalize` USD would take the intensity for the radiance of a disc of one degree, as which the sun's own
    light is 50,000; programs that know nothing of the disc would show a white picture.
    """
    light = UsdLux.DistantLight.Define(stage, path)
    light.CreateIntensityAttr(float(intensity))
    light.CreateNormalizeAttr(True)
    light.CreateColorAttr(Gf.Vec3f(*color))
    light.CreateAngleAttr(1.0)
    turn = np.round(look_at(-np.asarray(direction, float), np.zeros(3), np.array([0.0, 0.0, 1.0])), _DIGITS) + 0.0
    x, y, z, w = turn.tolist()
    light.ClearXformOpOrder()
    light.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(0.0, 0.0, 0.0))
    light.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))
    return light.GetPrim()


def define_lights(stage: Usd.Stage, root: str) -> None:
    """A cool dome and a warm key light from the upper left, below `{root}/Lights`."""
    UsdGeom.Xform.Define(stage, f"{root}/Lights")
    define_dome(stage, f"{root}/Lights/dome", DOME, DOME_COLOR)
    define_distant(stage, f"{root}/Lights/key", KEY_DIRECTION, KEY, KEY_COLOR)
