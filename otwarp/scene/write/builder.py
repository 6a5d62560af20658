"""The authoring side: `SceneBuilder` writes the description dataclasses as a USD stage that loads back equal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from otwarp.errors import InputError
from otwarp.laws import TrapLaw
from otwarp.scene import vocabulary
from otwarp.scene.appearance import palette
from otwarp.scene.appearance.lights import define_distant, define_dome
from otwarp.scene.appearance.materials import Materials, author_extent, draw_beam
from otwarp.scene.appearance.palette import Color
from otwarp.scene.check.item import Item, check_item
from otwarp.scene.check.scene import check_settings
from otwarp.scene.description import Body, Camera, Flow, Goal, Medium, Obstacle, Rod, Settings, Trap
from otwarp.scene.read.load import read_stage
from otwarp.scene.scene import Scene
from otwarp.scene.schema import register
from otwarp.scene.transforms import align_z, look_at, rotate
from otwarp.scene.vocabulary.values import authored
from otwarp.scene.write.attributes import author_values
from otwarp.scene.write.export import export_layer
from otwarp.scene.write.obstacles import define_obstacle
from otwarp.scene.write.pieces import Pieces
from otwarp.scene.write.poses import DIGITS, author_pose, author_tracks, rounded

register()

_FOCAL_LENGTH = 50.0
_LAW_UNITS = {"length_unit": 1e-6, "force_unit": 1e-12}


class SceneBuilder(Pieces):
    """Authors a scene: one stage, native units (µm), every value written out.

    Args:
        root: Path of the default prim.
        medium: The liquid.
        settings: How the scene is to be stepped; its duration and frame rate become the stage's time codes, one per
            frame.

    Raises:
        InputError: A liquid or settings that no file could say.
    """

    def __init__(self, *, root: str = "/World", medium: Medium | None = None, settings: Settings | None = None):
        medium, settings = medium or Medium(), settings or Settings()
        check_settings("SceneBuilder", root, medium, settings)
        self.root, self._medium, self._rate, self._robots = root, medium, settings.frames_per_second, 0
        self._stage = Usd.Stage.CreateInMemory("scene.usda")
        self._materials = Materials(self._stage, root)
        world = UsdGeom.Xform.Define(self._stage, root).GetPrim()
        self._stage.SetDefaultPrim(world)
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1e-6)
        UsdPhysics.SetStageKilogramsPerUnit(self._stage, 1e-15)
        self._stage.SetFramesPerSecond(self._rate)
        self._stage.SetTimeCodesPerSecond(self._rate)
        self._stage.SetStartTimeCode(0.0)
        self._stage.SetEndTimeCode(settings.duration * self._rate)
        author_values(world, vocabulary.SCENE, medium=medium, settings=settings)

    @property
    def stage(self) -> Usd.Stage:
        """The stage being authored."""
        return self._stage

    def add(self, item: Item, *, color: Color | None = None, opacity: float | None = None) -> Usd.Prim:
        """Author one item at the path `item.prim`; parents that do not exist become Xforms.

        Args:
            item: Trap, Body, Obstacle, Flow, Camera or Goal, in internal units.
            color: Display colour, linear RGB in [0, 1]; by default one for each kind, and for each robot.
            opacity: In [0, 1]; for a trap, of its beam.

        Returns:
            The prim, to add looks of one's own.

        Raises:
            InputError: The path is taken or not below the root, or the item cannot be said in USD.
        """
        check_item("SceneBuilder", item, self._medium)
        self._check_path(item.prim, taken=isinstance(item, Camera) or item.prim == self.root)
        default_color, default_opacity = palette.look_of(item, self._robots)
        color = default_color if color is None else color
        opacity = default_opacity if opacity is None else opacity
        writers: dict[type, Any] = {
            Trap: self._trap,
            Body: self._body,
            Obstacle: self._obstacle,
            Flow: self._flow,
            Camera: self._camera,
            Goal: self._goal,
        }
        return writers[type(item)](item, color, opacity)

    def add_cells(
        self,
        path: str,
        prototype: Body,
        positions: np.ndarray | Sequence[Sequence[float]],
        *,
        scales: np.ndarray | None = None,
        color: Color = (0.45, 0.65, 0.85),
        opacity: float = 1.0,
    ) -> Usd.Prim:
        """Author many equal cells as a PointInstancer; each loads back as a Body with an instance index.

        Args:
            path: Prim path of the instancer.
            prototype: The cell; its prim path and pose do not count.
            positions: (n, 3) centres in the instancer's frame [µm], rounded to single precision as USD stores them.
            scales: (n,) factors on the radius.
            color: Display colour.
            opacity: In [0, 1].

        Raises:
            InputError: The path is taken, or the prototype is not a cell.
        """
        self._check_path(path)
        points = np.asarray(positions, dtype=np.float32).reshape(-1, 3)
        instancer = UsdGeom.PointInstancer.Define(self._stage, self._parents(path))
        cell = self._stage.GetPrimAtPath(path).GetPath().AppendPath("Prototypes/Cell")
        self._parents(str(cell))
        prim = self._cell(str(cell), prototype, color, opacity)
        instancer.CreatePrototypesRel().SetTargets([prim.GetPath()])
        instancer.CreateProtoIndicesAttr(Vt.IntArray(len(points), 0))
        instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(points))
        if scales is not None:
            factors = np.repeat(np.asarray(scales, dtype=np.float32)[:, None], 3, axis=1)
            instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(factors)))
        author_extent(instancer.GetPrim())
        return instancer.GetPrim()

    def add_rod(
        self,
        body_prim: str,
        name: str,
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        *,
        color: Color = palette.ROBOTS[0],
        opacity: float = 1.0,
    ) -> Usd.Prim:
        """Draw a rod; looks only, no physics. Rods that collide or drag are `Rod`s of the body that `add` is given.

        Args:
            body_prim: Path of the body.
            name: Of the rod below it.
            start, end: Centres of its rounded ends in the body's frame [µm].
            radius: [µm].
            color: Linear RGB.
            opacity: 0 … 1.

        Raises:
            InputError: A length or radius [µm] that is not positive, or the path is taken.
        """
        return self._capsule(f"{body_prim}/{name}", start, end, radius, color, opacity)

    def _capsule(
        self, path: str, start: Sequence[float], end: Sequence[float], radius: float, color: Color, opacity: float
    ) -> Usd.Prim:
        self._check_path(path)
        a, b = np.asarray(start, float), np.asarray(end, float)
        length = float(np.linalg.norm(b - a))
        if not (length > 0.0 and radius > 0.0):
            raise InputError(f"SceneBuilder: {path}: length, radius = {length:g}, {radius:g}: must be in (0, inf) µm")
        rod = UsdGeom.Capsule.Define(self._stage, self._parents(path))
        rod.CreateAxisAttr(UsdGeom.Tokens.z)
        rod.CreateHeightAttr(round(length, DIGITS))
        rod.CreateRadiusAttr(float(radius))
        author_pose(rod.GetPrim(), rounded((a + b) / 2), rounded(align_z((b - a) / length)))
        self._look(rod.GetPrim(), color, opacity)
        return rod.GetPrim()

    def add_light(
        self,
        prim: str,
        *,
        kind: str = "distant",
        direction: Sequence[float] = (-0.4, 0.3, -1.0),
        intensity: float | None = None,
        color: Color = (1.0, 1.0, 1.0),
    ) -> Usd.Prim:
        """Author a light.

        Args:
            prim: Its path.
            kind: `distant`, shining along `direction` (of any length), or `dome`, the same from everywhere.
            direction: See `kind`; in world coordinates.
            intensity: Irradiance of a distant light, radiance of a dome; by default a strength at which white things
                are just not shown as white.
            color: Linear RGB in [0, 1].

        Raises:
            InputError: Another kind, or the path is taken.
        """
        self._check_path(prim)
        if kind not in ("distant", "dome"):
            raise InputError(f"SceneBuilder: {prim}: kind = {kind}: must be one of distant, dome")
        path = self._parents(prim)
        if kind == "dome":
            return define_dome(self._stage, path, palette.DOME if intensity is None else intensity, color)
        return define_distant(self._stage, path, direction, palette.KEY if intensity is None else intensity, color)

    def add_view(
        self,
        prim: str,
        eye: Sequence[float],
        target: Sequence[float],
        *,
        field_of_view: float = 40.0,
        up: Sequence[float] = (0.0, 0.0, 1.0),
        aspect: float = 16.0 / 9.0,
        orthographic: bool = False,
    ) -> Usd.Prim:
        """Author a camera that looks from `eye` to `target` (world, µm).

        Args:
            prim: Path of the camera; one made by `add(Camera(...))` is moved.
            eye: Where it stands.
            target: What it looks at and focuses on.
            field_of_view: Horizontal angle of view [degrees]; with `orthographic`, width of the view [µm].
            up: Direction that is up in the picture.
            aspect: Width over height.
            orthographic: Parallel projection.

        Raises:
            InputError: Eye and target coincide, or the path is taken by another kind of prim.
        """
        self._check_path(prim, taken=True)
        a, b = np.asarray(eye, float), np.asarray(target, float)
        distance = float(np.linalg.norm(b - a))
        if not distance > 0.0:
            raise InputError(f"SceneBuilder: {prim}: eye = {tuple(eye)}: must differ from target")
        camera = UsdGeom.Camera.Define(self._stage, self._parents(prim))
        if not self._stage.GetRootLayer().customLayerData:  # Omniverse's convention for what a stage is first seen by
            self._stage.GetRootLayer().customLayerData = {"cameraSettings": {"boundCamera": prim}}
        if orthographic:
            width = 10.0 * field_of_view  # apertures are in tenths of a stage unit
        else:
            width = 2.0 * _FOCAL_LENGTH * np.tan(np.radians(field_of_view) / 2)
            camera.CreateFocalLengthAttr(_FOCAL_LENGTH)
        camera.CreateProjectionAttr(UsdGeom.Tokens.orthographic if orthographic else UsdGeom.Tokens.perspective)
        camera.CreateHorizontalApertureAttr(float(width))
        camera.CreateVerticalApertureAttr(float(width / aspect))
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * distance, 20.0 * distance))
        camera.CreateFocusDistanceAttr(distance)
        author_pose(camera.GetPrim(), a, rounded(look_at(a, b, np.asarray(up, float))))
        return camera.GetPrim()

    def scene(self) -> Scene:
        """The scene as the stage now says it, through the reader that serves files.

        Raises:
            InputError: What was authored could not be loaded.
        """
        return Scene(**read_stage(self._stage, file="SceneBuilder"))

    def save(self, path: str | Path) -> Path:
        """Check the scene and write it to `path`, `.usda`, `.usdc` or `.usd`: the whole file or none.

        Raises:
            InputError: The scene could not be loaded back, or the file cannot be written.
        """
        self.scene()
        return export_layer(self._stage.GetRootLayer(), Path(path))

    def _check_path(self, path: str, *, taken: bool = False) -> None:
        if not Sdf.Path.IsValidPathString(path) or not (path == self.root or path.startswith(self.root + "/")):
            raise InputError(f"SceneBuilder: {path}: path = {path}: must be a prim path at or below {self.root}")
        if not taken and self._stage.GetPrimAtPath(path):
            raise InputError(f"SceneBuilder: {path}: path = {path}: must not be taken already")

    def _parents(self, path: str) -> Sdf.Path:
        target = Sdf.Path(path)
        for parent in target.GetParentPath().GetPrefixes():
            if not self._stage.GetPrimAtPath(parent):
                UsdGeom.Xform.Define(self._stage, parent)
        return target

    def _look(self, prim: Usd.Prim, color: Color, opacity: float) -> None:
        self._materials.paint(prim, color, opacity)
        self._materials.bind(prim, color, opacity)

    def _trap(self, trap: Trap, color: Color, opacity: float) -> Usd.Prim:
        prim = UsdGeom.Xform.Define(self._stage, self._parents(trap.prim)).GetPrim()
        author_tracks(prim, self._rate, trap.position, trap.orientation)
        times, values = trap.power.times, trap.power.values[:, 0]
        changed = {"power": values[0], "holds": [trap.holds] * bool(trap.holds)}
        author_values(prim, vocabulary.TRAP, vars(trap) | changed)
        if len(times) > 1:
            power = prim.GetAttribute("ot:trap:power")
            power.Clear()
            for time, value in zip(times, values, strict=True):
                power.Set(authored(value, "power"), float(time) * self._rate)
        for instance, law in _laws(trap):
            author_values(prim, vocabulary.TRAP_LAW, _law(law), instance=instance, si=True)
        draw_beam(self._stage, self._materials, prim, color, opacity)
        return prim

    def _body(self, body: Body, color: Color, opacity: float) -> Usd.Prim:
        if body.kind == "cell":
            prim = self._cell(body.prim, body, color, opacity)
            author_pose(prim, body.position, body.orientation)
            return prim
        prim = UsdGeom.Xform.Define(self._stage, self._parents(body.prim)).GetPrim()
        self._robots += 1
        author_pose(prim, body.position, body.orientation)
        UsdPhysics.RigidBodyAPI.Apply(prim)
        if body.material.adhesion != 0.0:
            raise InputError(f"SceneBuilder: {body.prim}: adhesion = {body.material.adhesion:g}: must be 0 for a robot")
        author_values(prim, vocabulary.BODY, body)
        for part in (*body.spheres, *body.rods):
            if not part.prim.startswith(body.prim + "/"):
                raise InputError(f"SceneBuilder: {part.prim}: path = {part.prim}: must be below its body {body.prim}")
            self._check_path(part.prim)
            if isinstance(part, Rod):
                capsule = self._capsule(part.prim, part.start, part.end, part.radius, color, opacity)
                author_values(capsule, vocabulary.ROD, part)
            else:
                ball = self._ball(part.prim, part.radius)
                author_pose(ball, part.offset, None)
                author_values(ball, vocabulary.SPHERE, part)
                self._look(ball, color, opacity)
        return prim

    def _ball(self, path: str, radius: float) -> Usd.Prim:
        ball = UsdGeom.Sphere.Define(self._stage, self._parents(path))
        ball.CreateRadiusAttr(float(radius))
        return ball.GetPrim()

    def _cell(self, path: str, body: Body, color: Color, opacity: float) -> Usd.Prim:
        sphere = body.spheres[0]
        plain = sphere.offset == (0.0, 0.0, 0.0) and sphere.collides and sphere.drag and body.mobility is None
        if body.kind != "cell" or len(body.spheres) != 1 or body.rods or not plain:
            raise InputError(
                f"SceneBuilder: {path}: kind = {body.kind}: must be cell, with one centred colliding sphere, no rods"
            )
        ball = self._ball(path, sphere.radius)
        UsdPhysics.RigidBodyAPI.Apply(ball)
        author_values(ball, vocabulary.CELL, body, sphere=sphere)
        self._look(ball, color, opacity)
        return ball

    def _obstacle(self, obstacle: Obstacle, color: Color, opacity: float) -> Usd.Prim:
        prim = define_obstacle(self._stage, self._parents(obstacle.prim), obstacle, self._rate)
        self._look(prim, color, opacity)
        return prim

    def _flow(self, flow: Flow, color: Color, opacity: float) -> Usd.Prim:
        prim = UsdGeom.Xform.Define(self._stage, self._parents(flow.prim)).GetPrim()
        if flow.prim != self.root:
            author_pose(prim, flow.origin, flow.orientation)
        elif any(flow.origin) or any(flow.orientation[:3]):
            raise InputError(f"SceneBuilder: {flow.prim}: origin = {flow.origin}: must be 0 on the default prim")
        author_values(prim, vocabulary.FLOW, flow)
        return prim

    def _camera(self, camera: Camera, color: Color, opacity: float) -> Usd.Prim:
        if not self._stage.GetPrimAtPath(camera.prim):  # the microscope's own view: along its axis, focused
            ends = np.array([(*camera.center, camera.focus + 100.0), (*camera.center, camera.focus), (0.0, 1.0, 0.0)])
            eye, target, up = rotate(np.array(camera.orientation), ends).tolist()
            width, height = camera.frame
            self.add_view(
                camera.prim, eye, target, up=up, field_of_view=width, aspect=width / height, orthographic=True
            )
        prim = self._stage.GetPrimAtPath(camera.prim)
        author_values(prim, vocabulary.CAMERA, camera)
        return prim

    def _goal(self, goal: Goal, color: Color, opacity: float) -> Usd.Prim:
        ball = self._ball(goal.prim, goal.tolerance)
        author_pose(ball, goal.position, None)
        author_values(ball, vocabulary.GOAL, vars(goal) | {"cell": [goal.cell]})
        self._look(ball, color, opacity)
        return ball


def _laws(trap: Trap) -> list[tuple[str, TrapLaw]]:
    if trap.radial is None:
        if trap.axial is not None:
            raise InputError(f"SceneBuilder: {trap.prim}: radial = None: must be a TrapLaw beside an axial one")
        return []
    return [("isotropic", trap.radial)] if trap.axial is None else [("radial", trap.radial), ("axial", trap.axial)]


def _law(law: TrapLaw) -> dict[str, Any]:
    # Lengths in µm and forces in pN are authored as they are, beside their units; the power is in watts.
    return vars(law) | _LAW_UNITS | {"power": authored(law.power, "power")}
