"""What authored prims look like: materials, display colours, extents, and the drawn beam of a trap."""

from __future__ import annotations

from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from otwarp.scene.appearance.palette import Color

GLOW = 0.5
"""Light that a beam's material sends out, over its colour."""


class Materials:
    """Materials of a stage, one per colour, opacity and glow, below `{root}/Looks`."""

    def __init__(self, stage: Usd.Stage, root: str):
        self._stage, self._root = stage, root

    def bind(self, prim: Usd.Prim, color: Color, opacity: float, *, glow: float = 0.0) -> None:
        """Bind a UsdPreviewSurface of this colour, which sends out `glow` times it, to `prim`."""
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(self._material(color, opacity, glow))

    def paint(self, prim: Usd.Prim, color: Color, opacity: float, *, extent: bool = True) -> None:
        """Author display colour and opacity on a gprim, for viewers that ignore materials, and its `extent`."""
        gprim = UsdGeom.Gprim(prim)
        gprim.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(Vt.Vec3fArray([Gf.Vec3f(*color)]))
        gprim.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set(Vt.FloatArray([opacity]))
        if extent:
            author_extent(prim)

    def _material(self, color: Color, opacity: float, glow: float) -> UsdShade.Material:
        name = "Glow_" if glow else "Color_"
        name += "".join(f"{round(255 * channel):02x}" for channel in (*color, opacity))
        path = Sdf.Path(f"{self._root}/Looks/{name}")
        if self._stage.GetPrimAtPath(path):
            return UsdShade.Material(self._stage.GetPrimAtPath(path))
        UsdGeom.Scope.Define(self._stage, path.GetParentPath())
        material = UsdShade.Material.Define(self._stage, path)
        shader = UsdShade.Shader.Define(self._stage, path.AppendChild("Surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
        if glow:
            emitted = Gf.Vec3f(*(round(glow * channel, 6) for channel in color))
            shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set(emitted)
        shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(opacity)
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.45)
        surface = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput().ConnectToSource(surface)
        return material


def author_extent(prim: Usd.Prim) -> None:
    """Author the extent that USD computes for a boundable prim."""
    boundable = UsdGeom.Boundable(prim)
    extent = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode.Default())
    if extent:
        boundable.CreateExtentAttr(extent)


def draw_beam(
    stage: Usd.Stage, materials: Materials, trap: Usd.Prim, color: Color, opacity: float, *, scale: float = 1.0
) -> None:
    """Draw a trap: a small sphere at the focus and two translucent cones that meet there.

    A symbol, not the beam's true profile: 20 µm long, with a half angle of 12° instead of the objective's 60° or so,
    so that several beams can be told apart. The cones keep the default purpose, which usdview,
    Blender and Isaac Sim all show. `scale` is a micrometre in units of the stage.
    """
    path = trap.GetPath()
    marker = UsdGeom.Sphere.Define(stage, path.AppendChild("Focus"))
    marker.CreateRadiusAttr(0.15 * scale)
    materials.paint(marker.GetPrim(), color, 1.0)
    materials.bind(marker.GetPrim(), color, 1.0, glow=GLOW)
    height, radius = 10.0 * scale, 2.1 * scale
    for name, side in (("BeamBelow", -1.0), ("BeamAbove", 1.0)):
        cone = UsdGeom.Cone.Define(stage, path.AppendChild(name))
        cone.CreateAxisAttr(UsdGeom.Tokens.z)
        cone.CreateHeightAttr(height)
        cone.CreateRadiusAttr(radius)
        cone.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(0.0, 0.0, side * height / 2))
        if side > 0.0:  # a USD cone points along +Z: turn the upper one over
            cone.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(0.0, 1.0, 0.0, 0.0))
        materials.paint(cone.GetPrim(), color, opacity)
        materials.bind(cone.GetPrim(), color, opacity, glow=GLOW)
