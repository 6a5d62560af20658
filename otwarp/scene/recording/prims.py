"""Which USD attributes a frame of a run becomes: poses of prims, instances and trap powers.

Each source below says which attributes it samples (`attributes`), authors once what does not change (`author`), and
turns a frame into values (`samples`). Poses go into transform ops of their own (suffix `:run`), so that they never
clash with the type of an op of the scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from otwarp.scene.read.bodies import instance_orientations
from otwarp.scene.read.source import Source
from otwarp.scene.scene import Scene
from otwarp.scene.transforms import conjugate, decompose, multiply, rotate
from otwarp.scene.vocabulary.values import authored

if TYPE_CHECKING:
    from otwarp.simulation.frame import Frame

TRANSLATE, ORIENT, SCALE = "xformOp:translate:run", "xformOp:orient:run", "xformOp:scale:run"

EVEN = 1e-6
"""A parent whose three scales differ by more than this cannot hold a rotated child without shear."""


@dataclass(frozen=True)
class Sampled:
    """An attribute with time samples: its path, its type, and about how many bytes a sample takes in memory."""

    path: Sdf.Path
    type: Sdf.ValueTypeName
    size: int = 240


class SampleSource(Protocol):
    """What every source of samples offers."""

    attributes: list[Sampled]

    def author(self, layer: Sdf.Layer) -> None:
        """Author what does not change during the run."""
        ...

    def samples(self, frame: Frame, world: int) -> Iterator[Any]:
        """Values of one frame, in the order of `attributes`."""
        ...


def attribute(layer: Sdf.Layer, path: Sdf.Path, kind: Sdf.ValueTypeName, value: Any = None) -> Sdf.AttributeSpec:
    """Declare an attribute in a layer, with overs above it where nothing is yet."""
    spec = layer.GetAttributeAtPath(path)
    if spec is None:
        spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, path.GetPrimPath()), path.name, kind)
    if value is not None:
        spec.default = value
    return spec


def op_order(layer: Sdf.Layer, prim: Sdf.Path, ops: list[str]) -> None:
    """Author the transform ops of a prim."""
    spec = layer.GetAttributeAtPath(prim.AppendProperty("xformOpOrder"))
    if spec is None:
        owner = Sdf.CreatePrimInLayer(layer, prim)
        kind = Sdf.ValueTypeNames.TokenArray
        spec = Sdf.AttributeSpec(owner, "xformOpOrder", kind, Sdf.VariabilityUniform)
    spec.default = Vt.TokenArray(ops)


def vec3d(row: np.ndarray) -> Gf.Vec3d:
    """A USD vector."""
    return Gf.Vec3d(*row.tolist())


def quatd(row: np.ndarray) -> Gf.Quatd:
    """A USD quaternion of (x, y, z, w)."""
    x, y, z, w = row.tolist()
    return Gf.Quatd(w, x, y, z)


def into_frame(parent: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Rotations (..., 4) in world axes as seen from frames rotated by `parent` (..., 4): conj(parent)·turn."""
    return multiply(conjugate(parent), turn)


class Placed:
    """World poses of prims as ops in the frames of their parents."""

    def __init__(self, source: Source, paths: list[Sdf.Path]):
        self.paths, self.unit = paths, source.unit
        inverse, rotation, self.ops, self.scale = [], [], [], []
        for path in paths:
            prim = source.stage.GetPrimAtPath(path)
            own = decompose(source.matrix(prim)[None])[2][0]
            parent = _parent_matrix(source, prim)
            self.ops.append([*(["!resetXformStack!"] if parent is None else []), TRANSLATE, ORIENT])
            frame = np.eye(4) if parent is None else parent
            _, turn, size, _ = decompose(frame[None])
            inverse.append(np.linalg.inv(frame))
            rotation.append(turn[0])
            self.scale.append(own / size[0])
        self._inverse = np.array(inverse).reshape(-1, 4, 4)
        self._rotation = np.array(rotation).reshape(-1, 4)

    def author(self, layer: Sdf.Layer) -> None:
        """Author the order of the ops, and the scale where there is one."""
        kind = Sdf.ValueTypeNames.Double3
        for path, ops, scale in zip(self.paths, self.ops, self.scale, strict=True):
            attribute(layer, path.AppendProperty(TRANSLATE), kind)
            attribute(layer, path.AppendProperty(ORIENT), Sdf.ValueTypeNames.Quatd)
            if np.abs(scale - 1.0).max() > 1e-12:
                attribute(layer, path.AppendProperty(SCALE), kind, vec3d(scale))
                ops = [*ops, SCALE]
            op_order(layer, path, ops)

    def place(self, position: np.ndarray) -> np.ndarray:
        """(n, 3) translations in stage units of positions in µm."""
        stage = np.asarray(position, dtype=float) / self.unit
        return np.einsum("ni,nij->nj", stage, self._inverse[:, :3, :3]) + self._inverse[:, 3, :3]

    def turn(self, orientation: np.ndarray) -> np.ndarray:
        """(n, 4) rotations in the parents' frames."""
        return into_frame(self._rotation, np.asarray(orientation, dtype=float))


def _parent_matrix(source: Source, prim: Usd.Prim) -> np.ndarray | None:
    """Local-to-world matrix of the parent; None where the prim's pose is better written in world coordinates.

    That is: the prim ignores its parents already, or they move by themselves, mirror, or are scaled unevenly.
    """
    if UsdGeom.Xformable(prim).GetResetXformStack():
        return None
    parent = prim.GetParent()
    above = parent
    while above and not above.IsPseudoRoot():
        if UsdGeom.Xformable(above) and UsdGeom.Xformable(above).TransformMightBeTimeVarying():
            return None
        above = above.GetParent()
    matrix = np.eye(4) if parent.IsPseudoRoot() else source.matrix(parent)
    scale = decompose(matrix[None])[2][0]
    even = scale.min() > 0.0 and scale.max() - scale.min() <= EVEN * scale.max()
    return matrix if even else None


class BodyPoses:
    """Bodies that are prims: translate and orient."""

    def __init__(self, source: Source, scene: Scene):
        self._index = [i for i, b in enumerate(scene.bodies) if b.instance is None]
        self._placed = Placed(source, [Sdf.Path(scene.bodies[i].prim) for i in self._index])
        self.attributes = [
            Sampled(path.AppendProperty(name), kind)
            for path in self._placed.paths
            for name, kind in ((TRANSLATE, Sdf.ValueTypeNames.Double3), (ORIENT, Sdf.ValueTypeNames.Quatd))
        ]

    def author(self, layer: Sdf.Layer) -> None:
        """Author the order of translation and rotation for every body, in a layer that does not change."""
        self._placed.author(layer)

    def samples(self, frame: Frame, world: int) -> Iterator[Any]:
        """Translation, then orientation of body after body in a frame, as the layer has them."""
        places = self._placed.place(frame.position[world, self._index])
        turns = self._placed.turn(frame.orientation[world, self._index])
        for place, turn in zip(places, turns, strict=True):
            yield vec3d(place)
            yield quatd(turn)


class Traps:
    """Traps: where their foci are and how strong they shine; beams do not turn."""

    def __init__(self, source: Source, scene: Scene):
        self._placed = Placed(source, [Sdf.Path(t.prim) for t in scene.traps])
        self._turns = self._placed.turn(np.array([t.orientation for t in scene.traps]).reshape(-1, 4))
        self.attributes = [
            Sampled(path.AppendProperty(name), kind)
            for path in self._placed.paths
            for name, kind in ((TRANSLATE, Sdf.ValueTypeNames.Double3), ("ot:trap:power", Sdf.ValueTypeNames.Double))
        ]

    def author(self, layer: Sdf.Layer) -> None:
        """Author the op orders and the orientations."""
        self._placed.author(layer)
        for path, turn in zip(self._placed.paths, self._turns, strict=True):
            attribute(layer, path.AppendProperty(ORIENT), Sdf.ValueTypeNames.Quatd, quatd(turn))

    def samples(self, frame: Frame, world: int) -> Iterator[Any]:
        """Translation, then power [W] of trap after trap in a frame, as the layer has them."""
        places = self._placed.place(frame.trap_position[world])
        digits = 7 if frame.trap_power.dtype == np.float32 else 15
        for place, power in zip(places, frame.trap_power[world], strict=True):
            yield vec3d(place)
            # without the digits that a number of the device does not have
            yield authored(float(f"{power:.{digits}g}"), "power")


@dataclass(frozen=True)
class _Instanced:
    """The bodies of one PointInstancer, and how it stood when they were read.

    Attributes:
        index: The bodies' indices in the scene.
        slots: Their indices in the instancer.
        matrix: (4, 4) local-to-world matrix of the instancer, in stage units.
        turn: (4,) its rotation.
        positions: (n, 3) of all instances, bodies or not, in the instancer's frame.
        orientations: (n, 4) of all instances.
        radius: (b, 1) the bodies' radii, in the instancer's frame.
        extent: (2, 3) box of the instances that are no bodies, empty (inf, −inf) without any.
        start: (b, 4) the bodies' orientations in the world.
        shift: (b, 3) from the body to the origin of its instance, in the instancer's frame: a cell may sit off the
            origin of its prototype.
    """

    index: list[int]
    slots: list[int]
    matrix: np.ndarray
    turn: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray
    radius: np.ndarray
    extent: np.ndarray
    start: np.ndarray
    shift: np.ndarray


class Instances:
    """Bodies that are instances: the arrays of their PointInstancers. What is no body stays as it was authored."""

    def __init__(self, source: Source, scene: Scene):
        self._instanced: list[_Instanced] = []
        self._still: list[Sdf.Path] = []
        self.attributes, self._unit = [], source.unit
        bodies: dict[str, list[int]] = {}
        for i, body in enumerate(scene.bodies):
            if body.instance is not None:
                bodies.setdefault(body.prim, []).append(i)
        for prim, index in bodies.items():
            instancer = UsdGeom.PointInstancer(source.stage.GetPrimAtPath(prim))
            group = self._read(source, instancer, scene, index)
            self._instanced.append(group)
            size = 64 + 20 * len(group.positions)
            path = Sdf.Path(prim)
            self.attributes += [
                Sampled(path.AppendProperty("positions"), Sdf.ValueTypeNames.Point3fArray, size),
                Sampled(path.AppendProperty("orientations"), Sdf.ValueTypeNames.QuathArray, size),
                Sampled(path.AppendProperty("extent"), Sdf.ValueTypeNames.Float3Array),
            ]
            moving = ("velocities", "accelerations", "angularVelocities", "orientationsf")
            self._still += [path.AppendProperty(n) for n in moving if instancer.GetPrim().GetAttribute(n).HasValue()]

    def _read(self, source: Source, instancer: UsdGeom.PointInstancer, scene: Scene, index: list[int]) -> _Instanced:
        positions = source.values.array(instancer.GetPrim(), "positions", 3)
        matrix = source.matrix(instancer.GetPrim())
        slots = [scene.bodies[i].instance or 0 for i in index]
        centre = np.array([scene.bodies[i].position for i in index]) / source.unit
        size = decompose(matrix[None])[2][0]
        still = np.setdiff1d(np.arange(len(positions)), slots)
        extent = np.array([[np.inf] * 3, [-np.inf] * 3])
        if len(still):  # their sizes are not known apart: the box of all of them at the start
            extent = np.array(instancer.ComputeExtentAtTime(source.start, source.start), dtype=float)
        return _Instanced(
            index=index,
            slots=slots,
            matrix=matrix,
            turn=decompose(matrix[None])[1][0],
            positions=positions,
            orientations=instance_orientations(source.values, instancer, len(positions)),
            radius=np.array([[scene.bodies[i].spheres[0].radius] for i in index]) / (source.unit * np.abs(size).min()),
            extent=extent,
            start=np.array([scene.bodies[i].orientation for i in index]),
            shift=positions[slots] - _rows(centre, np.linalg.inv(matrix)),
        )

    def author(self, layer: Sdf.Layer) -> None:
        """Block attributes that would take precedence over the recorded ones."""
        kinds = {"orientationsf": Sdf.ValueTypeNames.QuatfArray}
        for path in self._still:
            attribute(layer, path, kinds.get(path.name, Sdf.ValueTypeNames.Vector3fArray), Sdf.ValueBlock())

    def samples(self, frame: Frame, world: int) -> Iterator[Any]:
        """Positions (float) and orientations (half, as the schema wants it) in the instancer's frame."""
        for group in self._instanced:
            # how far each body has turned since the start, seen from the instancer; the rotation of a cell inside its
            # prototype comes on top of the instance's own and must not be written into it
            since = multiply(frame.orientation[world, group.index], conjugate(group.start))
            since = into_frame(group.turn, multiply(since, group.turn))
            centre = _rows(frame.position[world, group.index] / self._unit, np.linalg.inv(group.matrix))
            local, turns = group.positions.copy(), group.orientations.copy()
            local[group.slots] = centre + rotate(since, group.shift)
            turns[group.slots] = multiply(since, turns[group.slots])
            yield Vt.Vec3fArray.FromNumpy(local.astype(np.float32))
            yield Vt.QuathArray.FromNumpy(turns.astype(np.float16))
            low = np.minimum((centre - group.radius).min(axis=0), group.extent[0])
            high = np.maximum((centre + group.radius).max(axis=0), group.extent[1])
            yield Vt.Vec3fArray.FromNumpy(np.stack([low, high]).astype(np.float32))


def _rows(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3] + matrix[3, :3]
