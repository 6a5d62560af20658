"""Scenes that give no colours: what is added, and that nothing that is authored changes."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade

from otwarp.scene import Scene
from otwarp.scene.appearance import palette
from otwarp.scene.appearance.missing import with_missing_looks
from otwarp.scene.drawing.drawables import read_drawables
from otwarp.scene.recording.appearance import missing_appearance
from scenes.author.__main__ import FOLDER, NAMES

PLAIN = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = {metres}
    upAxis = "Z"
)
def Xform "World" (prepend apiSchemas = ["OtSceneAPI"])
{{
    def Xform "a" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "OtBodyAPI"])
    {{
        double3 xformOp:translate = ({left}, 0, {height})
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Sphere "ball" (prepend apiSchemas = ["OtSphereAPI"])
        {{
            double radius = {radius}
        }}
    }}
    def Xform "b" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "OtBodyAPI"])
    {{
        double3 xformOp:translate = ({right}, 0, {height})
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Sphere "ball" (prepend apiSchemas = ["OtSphereAPI"])
        {{
            double radius = {radius}
            color3f[] primvars:displayColor = [(0.2, 0.3, 0.4)]
        }}
    }}
    def Sphere "cell" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "OtCellAPI"])
    {{
        double radius = {radius}
        double3 xformOp:translate = (0, 0, {height})
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Plane "floor" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {{
    }}
    def Xform "trap" (prepend apiSchemas = ["OtTrapAPI"])
    {{
        token ot:trap:model = "exact"
        double ot:trap:power = 0.005
        token ot:trap:hand = "right"
        double3 xformOp:translate = ({left}, 0, {height})
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Xform "goal" (prepend apiSchemas = ["OtGoalAPI"])
    {{
        rel ot:goal:cell = </World/cell>
        rel ot:goal:robots = [</World/a>, </World/b>]
        double ot:goal:tolerance = 2e-6
    }}
}}
"""


def plain(folder: Path, *, micrometre: float = 1.0) -> Path:
    """A scene without looks, in a stage where a micrometre is so many units."""
    sizes = {name: micrometre * x for name, x in {"left": -6.0, "right": 6.0, "height": 8.0, "radius": 1.5}.items()}
    file = folder / "plain.usda"
    file.write_text(PLAIN.format(metres=1e-6 / micrometre, **sizes))
    return file


def surface(stage: Usd.Stage, path: str) -> UsdShade.Shader:
    return UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(path)).ComputeBoundMaterial()[0].ComputeSurfaceSource()[0]


def look(stage: Usd.Stage, path: str) -> tuple[tuple[float, ...], float]:
    shader = surface(stage, path)
    color, opacity = (shader.GetInput(name).Get() for name in ("diffuseColor", "opacity"))
    return tuple(round(x, 6) for x in color), round(opacity, 6)


def test_kinds_can_be_told_apart_and_what_has_a_colour_keeps_it(tmp_path: Path):
    file = plain(tmp_path)
    stage = with_missing_looks(Usd.Stage.Open(str(file)))
    assert look(stage, "/World/a/ball") == (palette.ROBOTS[0], 1.0)
    assert look(stage, "/World/b/ball") == ((0.2, 0.3, 0.4), 1.0)
    assert look(stage, "/World/cell") == palette.CELL
    assert look(stage, "/World/floor") == palette.GROUND
    assert look(stage, "/World/goal/Ball") == palette.GOAL
    assert look(stage, "/World/trap/BeamAbove") == (palette.BEAMS["right"], palette.BEAM_OPACITY)
    assert max(surface(stage, "/World/trap/BeamAbove").GetInput("emissiveColor").Get()) == pytest.approx(0.5)
    assert stage.GetRootLayer().ExportToString() == Usd.Stage.Open(str(file)).GetRootLayer().ExportToString()


@pytest.mark.parametrize("micrometre", [1.0, 1e-6])
def test_sizes_are_those_of_the_stage(tmp_path: Path, micrometre: float):
    drawn = read_drawables(with_missing_looks(Usd.Stage.Open(str(plain(tmp_path, micrometre=micrometre)))))
    low, high = drawn.bounds()
    assert (high - low)[drawn.beam].max() == pytest.approx(10.0)  # a cone, 10 µm long
    assert 4.0 in np.round((high - low)[:, 0], 6).tolist()  # the goal, of 2 µm


def test_neighbouring_robots_differ_more_than_the_eye_confuses():
    for a, b in pairwise([*palette.ROBOTS, palette.ROBOTS[0]]):
        assert np.linalg.norm(np.array(a) - np.array(b)) > 0.4


def test_a_recording_gets_a_camera_that_has_everything_in_its_picture(tmp_path: Path):
    stage = Usd.Stage.Open(str(plain(tmp_path, micrometre=1e-6)))
    layer, camera = missing_appearance(stage)
    seen = Usd.Stage.Open(stage.GetRootLayer(), layer)
    frustum = UsdGeom.Camera(seen.GetPrimAtPath(camera)).GetCamera(0.0).frustum
    for name in ("a", "b", "cell", "goal"):
        box = UsdGeom.BBoxCache(0.0, ["default"]).ComputeWorldBound(seen.GetPrimAtPath(f"/World/{name}"))
        corners = [box.ComputeAlignedRange().GetCorner(k) for k in range(8)]
        assert all(frustum.Intersects(Gf.Vec3d(corner)) for corner in corners)
    assert not stage.GetPrimAtPath(camera)


@pytest.mark.parametrize("name", NAMES)
def test_shipped_scenes_lack_nothing_and_are_lit_for_a_white_that_is_just_not_clipped(name: str):
    stage = with_missing_looks(Usd.Stage.Open(str(FOLDER / f"{name}.usda")))
    assert not stage.GetSessionLayer().rootPrims
    assert stage.GetRootLayer().customLayerData["cameraSettings"]["boundCamera"] == "/World/view"
    radiance = 0.0
    for prim in stage.Traverse():
        if prim.HasAPI(UsdLux.LightAPI):
            intensity = UsdLux.LightAPI(prim).GetIntensityAttr().Get()
            sun = prim.IsA(UsdLux.DistantLight)
            assert not sun or UsdLux.LightAPI(prim).GetNormalizeAttr().Get()
            radiance += intensity / np.pi if sun else intensity
    assert 0.7 < radiance < 1.0


def test_a_scene_with_looks_added_is_the_same_scene(tmp_path: Path):
    file = plain(tmp_path)
    dressed = tmp_path / "dressed.usda"
    with_missing_looks(Usd.Stage.Open(str(file))).Export(str(dressed))
    a, b = Scene.load(file), Scene.load(dressed)
    assert (a.bodies, a.traps, a.goal, a.obstacles) == (b.bodies, b.traps, b.goal, b.obstacles)
