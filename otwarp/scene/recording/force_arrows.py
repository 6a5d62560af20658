"""Force arrows of a recorded run: one prim per trap and per body, in world coordinates.

An arrow has the length |F|·`arrow_scale` (µm per pN, also authored as `customData` of the prim above the arrows),
points along the force on the body, and is hidden while it is too short to see. A trap's arrow starts where the sphere
it holds ends (at its focus, if it holds none). A contact arrow starts where the part of the body that touches things
ends: its colliding spheres that are not trapped (the dish of a robot), else its colliding spheres.
Instances of a PointInstancer get none: ten thousand arrows say less than none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt

from otwarp.scene.appearance.materials import GLOW, Materials
from otwarp.scene.description import Body, Sphere
from otwarp.scene.read.source import Source
from otwarp.scene.recording.prims import ORIENT, SCALE, TRANSLATE, Sampled, attribute, op_order, quatd, vec3d
from otwarp.scene.scene import Scene
from otwarp.scene.transforms import rotate

if TYPE_CHECKING:
    from otwarp.simulation.frame import Frame

ARROW_SCALE = 3.0
"""Default length of an arrow [µm/pN]."""

SHORTEST = 0.05
"""Length below which an arrow is hidden [µm]."""

SHAFT_RADIUS, HEAD_RADIUS, HEAD_LENGTH = 0.045, 0.12, 0.32
"""Proportions of an arrow of length 1."""

COLOURS = {"trap": (1.0, 0.62, 0.1), "contact": (0.86, 0.08, 0.2)}
"""Linear display colours: forces of traps, and of contacts."""


class ForceArrows:
    """Arrows below `<default prim>/Forces`, with the USD purpose `guide`."""

    def __init__(self, source: Source, scene: Scene, held: Sequence[tuple[int, int]], arrow_scale: float):
        self._unit, self._length = source.unit, arrow_scale
        root = source.stage.GetDefaultPrim().GetPath()
        name = "Forces"
        while source.stage.GetPrimAtPath(root.AppendChild(name)):
            name += "_run"
        self.root = root.AppendChild(name)
        self._bodies = [i for i, b in enumerate(scene.bodies) if b.instance is None]
        touching = [_touching(scene.bodies[i]) for i in self._bodies]
        self._centre = np.array([np.mean([s.offset for s in part], axis=0) for part in touching]).reshape(-1, 3)
        self._spheres = [
            (np.array([s.offset for s in part]) - centre, np.array([s.radius for s in part]))
            for part, centre in zip(touching, self._centre, strict=True)
        ]
        self._held = [b for b, _ in held]
        spheres = [scene.bodies[b].spheres[s] if b >= 0 else None for b, s in held]
        self._offset = np.array([s.offset if s else (0.0, 0.0, 0.0) for s in spheres]).reshape(-1, 3)
        self._radius = np.array([s.radius if s else 0.0 for s in spheres])
        labels = [("trap", t.prim) for t in scene.traps] + [("contact", scene.bodies[i].prim) for i in self._bodies]
        self._kinds = [kind for kind, _ in labels]
        self._arrows = [self.root.AppendChild(f"{kind}_{_identifier(prim)}") for kind, prim in labels]
        types = Sdf.ValueTypeNames
        self.attributes = [
            Sampled(path.AppendProperty(attr), kind)
            for path in self._arrows
            for attr, kind in (
                (TRANSLATE, types.Double3),
                (ORIENT, types.Quatd),
                (SCALE, types.Double3),
                ("visibility", types.Token),
            )
        ]

    def author(self, layer: Sdf.Layer) -> None:
        """Author the arrows: a shaft and a head of length 1 along +Z each."""
        top = _define(layer, self.root, "Xform")
        top.customData = {"micrometresPerPiconewton": self._length}
        top.SetInfo("documentation", f"Force arrows, {self._length:g} µm per pN.")
        purpose = Sdf.AttributeSpec(top, "purpose", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform)
        purpose.default = UsdGeom.Tokens.guide
        op_order(layer, self.root, ["!resetXformStack!"])
        for path, kind in zip(self._arrows, self._kinds, strict=True):
            _define(layer, path, "Xform")
            op_order(layer, path, [TRANSLATE, ORIENT, SCALE])
            shaft = 1.0 - HEAD_LENGTH
            _solid(layer, path.AppendChild("shaft"), "Cylinder", SHAFT_RADIUS, shaft, 0.5 * shaft, kind)
            _solid(layer, path.AppendChild("head"), "Cone", HEAD_RADIUS, HEAD_LENGTH, 1.0 - 0.5 * HEAD_LENGTH, kind)
        stage = Usd.Stage.Open(layer)
        materials = Materials(stage, str(self.root.GetParentPath()))
        for path, kind in zip(self._arrows, self._kinds, strict=True):
            materials.bind(stage.GetPrimAtPath(path), COLOURS[kind], 1.0, glow=GLOW)

    def samples(self, frame: Frame, world: int) -> Iterator[Any]:
        """Where each arrow starts, where it points, how long it is, and whether it is shown."""
        force = np.concatenate([frame.trap_force[world], frame.contact_force[world, self._bodies]]).astype(float)
        size = np.linalg.norm(force, axis=1)
        along = np.where(size[:, None] > 0.0, force / np.where(size > 0.0, size, 1.0)[:, None], (0.0, 0.0, 1.0))
        pose = frame.orientation[world, self._bodies]
        contact = frame.position[world, self._bodies] + rotate(pose, self._centre)
        tail = np.concatenate([self._held_spheres(frame, world), contact]).astype(float)
        n = len(self._radius)
        edge = np.concatenate([self._radius, self._outline(pose, along[n:])])
        tail = (tail + edge[:, None] * along) / self._unit
        length = size * self._length
        shown, length = length >= SHORTEST, np.maximum(length, SHORTEST) / self._unit
        for k, turn in enumerate(_from_z(along)):
            yield vec3d(tail[k])
            yield quatd(turn)
            yield Gf.Vec3d(length[k])
            yield UsdGeom.Tokens.inherited if shown[k] else UsdGeom.Tokens.invisible

    def _held_spheres(self, frame: Frame, world: int) -> np.ndarray:
        """(T, 3) centres of the spheres that traps hold; the focus of a trap that holds none [µm]."""
        place = frame.position[world, self._held] + rotate(frame.orientation[world, self._held], self._offset)
        return np.where(np.array(self._held)[:, None] >= 0, place, frame.trap_position[world])

    def _outline(self, orientation: np.ndarray, along: np.ndarray) -> np.ndarray:
        """(n,) distance from the centre of each touching part to where it ends in the direction of its arrow [µm]."""
        out = np.zeros(len(along))
        for k, (offsets, radii) in enumerate(self._spheres):
            out[k] = (rotate(orientation[k], offsets) @ along[k] + radii).max()
        return out


def _touching(body: Body) -> list[Sphere]:
    """The spheres of a body that contact forces act on, as far as can be said without knowing the contact."""
    colliding = [s for s in body.spheres if s.collides]
    return [s for s in colliding if not s.trapped] or colliding or list(body.spheres)


def _from_z(along: np.ndarray) -> np.ndarray:
    """(n, 4) shortest rotations that turn +Z into unit vectors (n, 3)."""
    q = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along)), 1.0 + along[:, 2]], axis=1)
    q[q[:, 3] < 1e-9] = (1.0, 0.0, 0.0, 0.0)
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def _identifier(prim: str) -> str:
    return Tf.MakeValidIdentifier(prim.strip("/").replace("/", "_"))


def _define(layer: Sdf.Layer, path: Sdf.Path, kind: str) -> Sdf.PrimSpec:
    spec = Sdf.CreatePrimInLayer(layer, path)
    spec.specifier, spec.typeName = Sdf.SpecifierDef, kind
    return spec


def _solid(
    layer: Sdf.Layer, path: Sdf.Path, kind: str, radius: float, height: float, centre: float, force: str
) -> None:
    _define(layer, path, kind)
    types, half = Sdf.ValueTypeNames, 0.5 * height
    axis = attribute(layer, path.AppendProperty("axis"), types.Token)
    axis.default = UsdGeom.Tokens.z
    attribute(layer, path.AppendProperty("radius"), types.Double, radius)
    attribute(layer, path.AppendProperty("height"), types.Double, height)
    box = Vt.Vec3fArray([Gf.Vec3f(-radius, -radius, -half), Gf.Vec3f(radius, radius, half)])
    attribute(layer, path.AppendProperty("extent"), types.Float3Array, box)
    colour = Vt.Vec3fArray([Gf.Vec3f(*COLOURS[force])])
    attribute(layer, path.AppendProperty("primvars:displayColor"), types.Color3fArray, colour)
    attribute(layer, path.AppendProperty("xformOp:translate"), types.Double3, Gf.Vec3d(0.0, 0.0, centre))
    op_order(layer, path, ["xformOp:translate"])
