"""Colour, opacity and roughness of a prim: its bound preview surface, else its display primvars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

DEFAULT_COLOUR = (0.55, 0.57, 0.6)
DEFAULT_ROUGHNESS = 0.45


@dataclass(frozen=True)
class Look:
    """Linear colour (k, 3) and opacity (k,), k = 1 or one per instance, and roughness."""

    colour: np.ndarray
    opacity: np.ndarray
    roughness: float = DEFAULT_ROUGHNESS


def primvar(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> np.ndarray | None:
    """Flattened values of a primvar, inherited ones included, or None."""
    found = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not found or not found.HasValue():
        return None
    values = found.ComputeFlattened(time)
    if values is None or len(values) == 0:
        return None
    return np.asarray(values, dtype=float)


def _surface_value(shader: UsdShade.Shader, name: str, time: Usd.TimeCode) -> np.ndarray | None:
    shader_input = shader.GetInput(name)
    if not shader_input:
        return None
    sources = shader_input.GetValueProducingAttributes()
    # A texture or a primvar reader has no constant value: leave it to the display primvars.
    if not sources or UsdShade.Utils.GetType(sources[0].GetName()) != UsdShade.AttributeType.Input:
        return None
    value = sources[0].Get(time)
    return None if value is None else np.asarray(value, dtype=float)


class Looks:
    """Looks of prims at one time code; materials are resolved once."""

    def __init__(self, time: Usd.TimeCode):
        self.time = time
        self._materials: dict[str, dict[str, np.ndarray]] = {}

    def _material(self, prim: Usd.Prim) -> dict[str, np.ndarray]:
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        if not material:
            return {}
        path = str(material.GetPath())
        if path not in self._materials:
            shader = material.ComputeSurfaceSource()[0]
            names = ("diffuseColor", "emissiveColor", "opacity", "roughness")
            values = {name: _surface_value(shader, name, self.time) for name in names} if shader else {}
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
            shown = primvar(prim, "displayColor", self.time)
            colour = np.asarray(DEFAULT_COLOUR) if shown is None else shown.reshape(-1, 3).mean(axis=0)
        if opacity is None:
            shown = primvar(prim, "displayOpacity", self.time)
            opacity = np.asarray(1.0) if shown is None else shown.mean()
        roughness = float(material.get("roughness", np.asarray(DEFAULT_ROUGHNESS)))
        return Look(
            np.clip(colour.reshape(1, 3), 0.0, 1.0), np.clip(opacity.reshape(1), 0.0, 1.0), np.clip(roughness, 0.0, 1.0)
        )

    def per_instance(self, instancer: Usd.Prim, count: int) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Colours (n, 3) and opacities (n,) that an instancer gives to its n instances, each by itself, or None."""
        given: list[np.ndarray | None] = []
        for name, shape in (("displayColor", (-1, 3)), ("displayOpacity", (-1,))):
            local = UsdGeom.PrimvarsAPI(instancer).GetPrimvar(name)
            values = local.ComputeFlattened(self.time) if local and local.HasValue() else None
            array = None if values is None else np.asarray(values, dtype=float).reshape(shape)
            given.append(array if array is not None and len(array) == count else None)
        return given[0], given[1]
