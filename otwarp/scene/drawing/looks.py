"""Colour, opacity and roughness of a prim: its bound preview surface, else its display primvars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from otwarp.scene.read.typed import Values

DEFAULT_COLOUR = (0.55, 0.57, 0.6)
DEFAULT_ROUGHNESS = 0.45


@dataclass(frozen=True)
class Look:
    """Linear colour (k, 3) and opacity (k,), k = 1 or one per instance, and roughness."""

    colour: np.ndarray
    opacity: np.ndarray
    roughness: float = DEFAULT_ROUGHNESS


PRIMVARS = {"displayColor": (("color3f[]", "color3f"), 3), "displayOpacity": (("float[]", "float"), 1)}
"""Primvars that are shown: their types, and the components of a value."""

INPUTS = {"diffuseColor": "color3f", "emissiveColor": "color3f", "opacity": "float", "roughness": "float"}
"""Inputs of a surface that are shown, and their types."""


def flattened(values: Values, primvar: UsdGeom.Primvar) -> np.ndarray | None:
    """(n, components) values of a primvar of `PRIMVARS`, its indices resolved, or None where there are none.

    Raises:
        InputError: Another type, or indices beyond the values.
    """
    if not primvar or not primvar.HasValue():
        return None
    prim, name = primvar.GetAttr().GetPrim(), primvar.GetName()
    types, width = PRIMVARS[str(primvar.GetPrimvarName())]
    found = values.array(prim, name, width, types=types)
    indices = values.array(prim, f"{name}:indices", kind=int, types=("int[]",))
    if len(indices):
        if indices.min() < 0 or indices.max() >= len(found):
            shown = f"{indices.min()} … {indices.max()}"
            raise values.bad(prim, f"{name}:indices", shown, f"in [0, {len(found) - 1}]")
        found = found[indices]
    return found if len(found) else None


def _surface_value(shader: UsdShade.Shader, name: str, values: Values) -> np.ndarray | None:
    shader_input = shader.GetInput(name)
    if not shader_input:
        return None
    sources = shader_input.GetValueProducingAttributes()
    # A texture or a primvar reader has no constant value: leave it to the display primvars.
    if not sources or UsdShade.Utils.GetType(sources[0].GetName()) != UsdShade.AttributeType.Input:
        return None
    value = values.array(sources[0].GetPrim(), sources[0].GetName(), types=(INPUTS[name],))
    return value if len(value) else None


class Looks:
    """Looks of prims at one time code; materials are resolved once."""

    def __init__(self, values: Values):
        self.values = values
        self._materials: dict[str, dict[str, np.ndarray]] = {}

    def _material(self, prim: Usd.Prim) -> dict[str, np.ndarray]:
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        if not material:
            return {}
        path = str(material.GetPath())
        if path not in self._materials:
            shader = material.ComputeSurfaceSource()[0]
            values = {name: _surface_value(shader, name, self.values) for name in INPUTS} if shader else {}
            self._materials[path] = {name: value for name, value in values.items() if value is not None}
        return self._materials[path]

    def of(self, prim: Usd.Prim, *, beam: bool) -> Look:
        """The look of `prim`; several display values on one prim are averaged, and light shows its emissive colour."""
        material = self._material(prim)
        colour, opacity = material.get("diffuseColor"), material.get("opacity")
        glow = material.get("emissiveColor")
        if beam and glow is not None and glow.max() > 0.0:
            colour = glow / glow.max()
        if colour is None:
            shown = flattened(self.values, UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor"))
            colour = np.asarray(DEFAULT_COLOUR) if shown is None else shown.mean(axis=0)
        if opacity is None:
            shown = flattened(self.values, UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayOpacity"))
            opacity = np.asarray(1.0) if shown is None else shown.mean()
        roughness = material.get("roughness", np.asarray(DEFAULT_ROUGHNESS)).item()
        return Look(
            np.clip(colour.reshape(1, 3), 0.0, 1.0), np.clip(opacity.reshape(1), 0.0, 1.0), np.clip(roughness, 0.0, 1.0)
        )

    def per_instance(self, instancer: Usd.Prim, count: int) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Colours (n, 3) and opacities (n,) that an instancer gives to its n instances, each by itself, or None."""
        given: list[np.ndarray | None] = []
        for name in PRIMVARS:
            values = flattened(self.values, UsdGeom.PrimvarsAPI(instancer).GetPrimvar(name))
            given.append(values if values is not None and len(values) == count else None)
        colour, opacity = given
        return colour, None if opacity is None else opacity[:, 0]
