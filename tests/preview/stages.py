"""Stages written by hand with plain USD calls, so that these tests do not lean on otwarp's own author."""

from __future__ import annotations

import math
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics, Vt


def new_stage(path: Path | None = None, *, metres_per_unit: float = 1e-6, up: str = "Z") -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path)) if path else Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, metres_per_unit)
    UsdGeom.SetStageUpAxis(stage, getattr(UsdGeom.Tokens, up.lower()))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    return stage


def place(prim: UsdGeom.Gprim, at=(0, 0, 0), turn=None, scale=None) -> None:
    if any(at):
        prim.AddTranslateOp().Set(Gf.Vec3d(*map(float, at)))
    if turn:
        prim.AddRotateXYZOp().Set(Gf.Vec3f(*turn))
    if scale:
        prim.AddScaleOp().Set(Gf.Vec3f(*scale))


def paint(prim: UsdGeom.Gprim, colour, opacity=1.0) -> None:
    prim.CreateDisplayColorAttr([Gf.Vec3f(*colour)])
    if opacity < 1.0:
        prim.CreateDisplayOpacityAttr([opacity])


def sphere(stage, path, radius, at=(0, 0, 0), colour=(0.8, 0.8, 0.8), opacity=1.0) -> UsdGeom.Sphere:
    prim = UsdGeom.Sphere.Define(stage, path)
    prim.CreateRadiusAttr(radius)
    place(prim, at)
    paint(prim, colour, opacity)
    return prim


def camera(stage, path="/World/Camera", *, eye, target=(0, 0, 0), width=36.0, height=20.25, focal=50.0, ortho=False):
    """A camera that looks from `eye` to `target` with +Z up (+Y when looking along Z)."""
    prim = UsdGeom.Camera.Define(stage, path)
    up = Gf.Vec3d(0, 1, 0) if eye[0] == target[0] and eye[1] == target[1] else Gf.Vec3d(0, 0, 1)
    matrix = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*map(float, eye)), Gf.Vec3d(*map(float, target)), up).GetInverse()
    prim.AddTransformOp().Set(matrix)
    prim.CreateHorizontalApertureAttr(width)
    prim.CreateVerticalApertureAttr(height)
    prim.CreateFocalLengthAttr(focal)
    prim.CreateClippingRangeAttr(Gf.Vec2f(0.1, 1e5))
    prim.CreateFocusDistanceAttr((Gf.Vec3d(*map(float, eye)) - Gf.Vec3d(*map(float, target))).GetLength())
    if ortho:
        prim.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
    return prim


def distant_light(stage, direction, intensity=1.0, path="/World/Sun") -> UsdLux.DistantLight:
    """A distant light shining along `direction`."""
    light = UsdLux.DistantLight.Define(stage, path)
    turn = Gf.Rotation(Gf.Vec3d(0, 0, -1), Gf.Vec3d(*map(float, direction)))
    light.AddTransformOp().Set(Gf.Matrix4d().SetRotate(turn))
    light.CreateIntensityAttr(intensity)
    return light


def trap(stage, path, at=(0, 0, 0), colour=(1.0, 0.16, 0.08)) -> UsdGeom.Xform:
    """A trap with its beam: two cones that meet at the focus."""
    prim = UsdGeom.Xform.Define(stage, path)
    prim.GetPrim().SetMetadata("apiSchemas", Sdf.TokenListOp.CreateExplicit(["OtTrapAPI"]))
    prim.AddTranslateOp().Set(Gf.Vec3d(*map(float, at)))
    for name, sign in (("Below", -1.0), ("Above", 1.0)):
        cone = UsdGeom.Cone.Define(stage, f"{path}/{name}")
        cone.CreateRadiusAttr(2.4)
        cone.CreateHeightAttr(7.0)
        place(cone, (0, 0, 3.5 * sign), turn=None if sign < 0 else (180, 0, 0))
        paint(cone, colour, 0.25)
    return prim


def robot(stage, path, at, turn=0.0, colour=(0.95, 0.62, 0.12)) -> None:
    """Five spheres on rods: handle, arm, hub, arm, handle."""
    body = UsdGeom.Xform.Define(stage, path)
    body.AddTranslateOp().Set(Gf.Vec3d(*map(float, at)))
    body.AddRotateZOp().Set(turn)
    for k, (y, z, r) in enumerate(
        ((-4.8, 0.8, 1.5), (-2.4, 0.1, 0.9), (0, -0.2, 1.4), (2.4, 0.1, 0.9), (4.8, 0.8, 1.5))
    ):
        sphere(stage, f"{path}/S{k}", r, (0.0, y, z), colour)
    for k, sign in enumerate((-1.0, 1.0)):
        rod = UsdGeom.Capsule.Define(stage, f"{path}/Rod{k}")
        rod.CreateAxisAttr("Y")
        rod.CreateRadiusAttr(0.75)
        rod.CreateHeightAttr(4.0)
        place(rod, (0, 2.6 * sign, 0.15), turn=(9.0 * sign, 0, 0))
        paint(rod, colour)
    for k in range(8):
        ball = Gf.Rotation(Gf.Vec3d(1, 0, 0), 45.0 * k).TransformDir(Gf.Vec3d(0, 1.5, 0))
        sphere(stage, f"{path}/Ring{k}", 0.55, (1.1, ball[1], ball[2]), colour)


def delivery(path: Path | None = None) -> Usd.Stage:
    """Two robots carry a cell past pillars and cubes, with six traps, floor, lights and a camera: about 60 prims."""
    stage = new_stage(path)
    robot(stage, "/World/Left", (-5.2, 0, 3))
    robot(stage, "/World/Right", (5.2, 0, 3), turn=180.0, colour=(0.1, 0.55, 0.85))
    sphere(stage, "/World/Cell", 3.4, (0, 0, 3.5), (0.55, 0.9, 0.72), 0.35)
    sphere(stage, "/World/Nucleus", 1.2, (0.3, 0.3, 3.3), (0.28, 0.4, 0.62), 0.8)
    for side, x in (("L", -5.2), ("R", 5.2)):
        for k, (y, z) in enumerate(((-4.8, 3.8), (0.0, 2.8), (4.8, 3.8))):
            trap(stage, f"/World/Trap{side}{k}", (x, y, z))
    for k, (x, y) in enumerate(((-14, 10), (13, -7))):
        pillar = UsdGeom.Cylinder.Define(stage, f"/World/Pillar{k}")
        pillar.CreateRadiusAttr(3.0)
        pillar.CreateHeightAttr(12.0)
        place(pillar, (x, y, 6.0))
        paint(pillar, (0.5, 0.53, 0.58))
    for k, (x, y, turn) in enumerate(((-15, -6, 20), (15, 8, 50), (3, 15, 10), (-3, -13, 35))):
        cube = UsdGeom.Cube.Define(stage, f"/World/Cube{k}")
        cube.CreateSizeAttr(4.0)
        place(cube, (x, y, 2.0), turn=(0, 0, turn))
        paint(cube, (0.72, 0.3, 0.28))
    floor = UsdGeom.Plane.Define(stage, "/World/Floor")
    UsdPhysics.CollisionAPI.Apply(floor.GetPrim())
    paint(floor, (0.25, 0.3, 0.36))
    camera(stage, eye=(16, -44, 30), target=(0, 0, 2.0), focal=44.0)
    return stage


def cells(count: int, *, radius: float = 2.0, spacing: float = 6.0) -> Usd.Stage:
    """`count` cells on a square lattice by one PointInstancer, coloured one by one."""
    stage = new_stage()
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/Cells")
    sphere(stage, "/World/Cells/Prototypes/Cell", radius)
    instancer.CreatePrototypesRel().AddTarget("/World/Cells/Prototypes/Cell")
    side = math.ceil(count**0.5)
    points = [(spacing * (k % side), spacing * (k // side), radius) for k in range(count)]
    instancer.CreatePositionsAttr(Vt.Vec3fArray([Gf.Vec3f(*p) for p in points]))
    instancer.CreateProtoIndicesAttr([0] * count)
    colours = [Gf.Vec3f(0.3 + 0.6 * ((k * 7) % 11) / 11.0, 0.5, 0.9 - 0.5 * ((k * 3) % 7) / 7.0) for k in range(count)]
    primvar = UsdGeom.PrimvarsAPI(instancer).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex")
    primvar.Set(colours)
    return stage


def recorded_run(folder: Path) -> Path:
    """Folder of a run of 7 frames at 10 per second, from time code 3: a ball that moves 1 µm per frame."""
    folder.mkdir()
    stage = new_stage(folder / "run.usda")
    move = sphere(stage, "/World/Ball", 3.0).AddTranslateOp()
    for k in range(7):
        move.Set(Gf.Vec3d(k, 0, 0), 3 + k)
    camera(stage, eye=(0, 0, 60), width=320.0, height=180.0, ortho=True)
    stage.SetStartTimeCode(3)
    stage.SetEndTimeCode(9)
    stage.SetTimeCodesPerSecond(10)
    stage.Save()
    return folder
