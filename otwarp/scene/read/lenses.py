"""Lenses of cameras that can show something."""

from __future__ import annotations

from pxr import Usd

from otwarp.scene.read.typed import Values

_LENS = ("focalLength", "horizontalAperture", "verticalAperture")


def check_lens(values: Values, prim: Usd.Prim) -> dict[str, float]:
    """Focal length and apertures of a UsdGeomCamera, in tenths of the stage unit.

    Raises:
        InputError: One that is not positive.
    """
    lens = {name: values.number(prim, name) for name in _LENS}
    for name, value in lens.items():
        if not 0.0 < value < float("inf"):
            raise values.bad(prim, name, value, "in (0, inf)")
    return lens
