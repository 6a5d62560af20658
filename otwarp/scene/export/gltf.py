"""A scene or a recorded run → glTF 2.0 (`.glb`), which slides, browsers, ParaView and most 3-D programs show moving."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene.appearance.materials import GLOW
from otwarp.scene.appearance.missing import with_missing_looks
from otwarp.scene.drawing.draw_list import MESH
from otwarp.scene.drawing.looks import Look
from otwarp.scene.drawing.shapes import Batch, ShapeReader
from otwarp.scene.export.glb import INDICES, VERTICES, Arrays, write_glb
from otwarp.scene.export.meshes import Surface, surface
from otwarp.scene.export.nodes import Motion, local_matrices, shown
from otwarp.scene.read.attributes import applied_schemas
from otwarp.scene.read.bodies import instance_matrices, shown_instances
from otwarp.scene.read.diagnostics import reading
from otwarp.scene.read.lenses import check_lens
from otwarp.scene.read.source import Source, open_stage
from otwarp.scene.read.typed import Values

_UPRIGHT = [-float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5))]
"""A quarter turn about X: glTF has Y up."""

MOST_SAMPLES = 20_000_000
"""Poses of all moving nodes together: some 600 MB."""


def export_gltf(
    path: str | Path, out: str | Path, *, fps: float = 30.0, metres: bool = False, forces: bool = False
) -> Path:
    """Write a scene or a recorded run as a glTF file with one animation, in which a second is a simulated one.

    Nodes have the names of prims; spheres, cylinders … become triangles. A micrometre is one unit of the file, because
    most viewers put things of some micrometres in front of their nearest plane.

    Args:
        path: USD file with a scene, or the `run.usda` of a recorded run.
        out: File to write: `.glb`.
        fps: Poses per simulated second [1/s]; between them viewers interpolate.
        metres: Keep true sizes, in metres.
        forces: Write recorded force arrows.

    Returns:
        `out`.

    Raises:
        InputError: A file cannot be read or written, or it would hold more than `MOST_SAMPLES` poses.
    """
    out = Path(out)
    if out.suffix != ".glb":
        raise InputError(f"{out}: suffix = {out.suffix or '(none)'}: must be .glb")
    opened = open_stage(Path(path))
    with reading(str(path)):
        source = Source(opened, str(path))
        purposes = ("default", "render", "guide") if forces else ("default", "render")
        writer = _Writer(with_missing_looks(opened), source, fps, purposes, 1e-6 if metres else 1.0)
        return write_glb(out, writer.document(), writer.arrays)


def time_codes(source: Source, fps: float) -> list[float]:
    """Time codes of the poses: the first, then `fps` a second, never more than were recorded, and the last."""
    stage = source.stage
    if not stage.HasAuthoredTimeCodeRange():
        return [source.start]
    step = max(source.rate / fps, 1.0)
    span = max(stage.GetEndTimeCode() - source.start, 0.0)
    codes = [source.start + step * k for k in range(int(span / step + 1e-9) + 1)]
    return codes if stage.GetEndTimeCode() - codes[-1] < 1e-6 else [*codes, stage.GetEndTimeCode()]


class _Writer:
    """Builds the document: nodes from prims, from the root down.

    Attributes:
        arrays: Vertices and samples.
    """

    def __init__(self, stage: Usd.Stage, source: Source, fps: float, purposes: tuple[str, ...], unit: float):
        self.arrays = Arrays()
        self._stage, self._source, self._purposes, self._unit = stage, source, purposes, unit
        self._codes = time_codes(source, fps)
        self._reader = ShapeReader(source.values)
        self._nodes: list[dict[str, Any]] = []
        self._apart: list[int] = []
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._samples = 0
        self._tables: dict[str, list[Any]] = {"meshes": [], "materials": [], "cameras": []}
        self._known: dict[Any, int] = {}

    def document(self) -> dict[str, Any]:
        """All but the arrays."""
        tops = [n for n in (self._prim(prim) for prim in self._stage.GetPseudoRoot().GetChildren()) if n is not None]
        size = self._source.unit * self._unit
        root: dict[str, Any] = {"name": "otwarp", "rotation": _UPRIGHT, "children": tops + self._apart}
        if size != 1.0:
            root["scale"] = [size] * 3
        if not root["children"]:
            raise InputError(f"{self._source.file}: shapes = none visible: must be at least one")
        units = "metre" if self._unit == 1e-6 else "micrometre"
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "otwarp", "extras": {"unit": units}},
            "scene": 0,
            "scenes": [{"nodes": [len(self._nodes)]}],
            "nodes": [*self._nodes, root],
        }
        document |= {name: rows for name, rows in self._tables.items() if rows}
        if self._channels:
            document["animations"] = [{"name": "run", "channels": self._channels, "samplers": self._samplers}]
        return document

    def _prim(self, prim: Usd.Prim) -> int | None:
        """Index of the node of a prim, or None if it and what is below it show nothing, or stand in the world."""
        seen = shown(self._source.values, prim, self._codes)
        if not seen.any():
            return None
        self._source.values.check(prim)
        node: dict[str, Any] = {"name": prim.GetName()}
        children = []
        if prim.IsA(UsdGeom.PointInstancer):
            children = self._instances(prim) if self._drawn(prim) else []
        else:
            if prim.IsA(UsdGeom.Gprim) and self._drawn(prim):
                children += self._solids(prim, node)
            below = prim.GetFilteredChildren(Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
            children += [child for child in map(self._prim, below) if child is not None]
        if prim.IsA(UsdGeom.Camera):
            node["camera"] = self._camera(prim)
        if not (children or "mesh" in node or "camera" in node):
            return None
        if children:
            node["children"] = children
        matrices = local_matrices(prim, self._codes)
        many = max(len(matrices), len(seen))
        index = self._node(node, Motion.of(np.broadcast_to(matrices, (many, 4, 4)), np.broadcast_to(seen, many)))
        if UsdGeom.Xformable(prim) and UsdGeom.Xformable(prim).GetResetXformStack():
            self._apart.append(index)
            return None
        return index

    def _drawn(self, prim: Usd.Prim) -> bool:
        return UsdGeom.Imageable(prim).ComputePurpose() in self._purposes

    def _node(self, node: dict[str, Any], motion: Motion) -> int:
        self._nodes.append(node | motion.first())
        index = len(self._nodes) - 1
        for name, rows in motion.moving().items() if len(motion.scale) > 1 else ():
            self._samples += len(rows)
            if self._samples > MOST_SAMPLES:
                raise InputError(
                    f"{self._source.file}: poses = more than {MOST_SAMPLES}: too many for one file; take a lower --fps"
                )
            start = self._source.start
            times = self.arrays.add((np.array(self._codes) - start) / self._source.rate, bounds=True)
            self._samplers.append({"input": times, "output": self.arrays.add(rows), "interpolation": "LINEAR"})
            target = {"node": index, "path": name}
            self._channels.append({"sampler": len(self._samplers) - 1, "target": target})
        return index

    def _solids(self, prim: Usd.Prim, node: dict[str, Any]) -> list[int]:
        """Meshes of a gprim: one goes into its own node, more into nodes below it."""
        beam = self._below_trap(prim)
        meshes = [self._mesh(batch, batch.look, beam) for batch in self._reader.read(prim, beam=beam)]
        if len(meshes) == 1:
            node["mesh"] = meshes[0]
            return []
        return [self._node({"name": f"{prim.GetName()}_{k}", "mesh": mesh}, _AT_REST) for k, mesh in enumerate(meshes)]

    def _below_trap(self, prim: Usd.Prim) -> bool:
        while prim and not prim.IsPseudoRoot():
            if "OtTrapAPI" in applied_schemas(prim):
                return True
            prim = prim.GetParent()
        return False

    def _mesh(self, batch: Batch, look: Look, beam: bool) -> int:
        """Index of a mesh with a material; equal ones are one."""
        shape = self._triangles(batch) if batch.kind == MESH else surface(batch, 1.0 / self._source.unit)
        primitive = {
            "attributes": {
                "POSITION": self.arrays.add(shape.points, VERTICES, bounds=True),
                "NORMAL": self.arrays.add(shape.normals, VERTICES),
            },
            "indices": self.arrays.add(shape.triangles.ravel(), INDICES),
            "material": self._material(look, beam),
        }
        return self._row("meshes", {"primitives": [primitive]})

    def _triangles(self, batch: Batch) -> Surface:
        mesh = self._reader.meshes[batch.mesh]
        corners = np.arange(3 * len(mesh.triangles)).reshape(-1, 3)
        return Surface(mesh.points[mesh.triangles].reshape(-1, 3), mesh.normals.reshape(-1, 3), corners)

    def _material(self, look: Look, beam: bool) -> int:
        """Index of a material; of several colours on one prim, the mean."""
        colour, opacity = look.colour.mean(axis=0), float(look.opacity.mean())
        rough = {"metallicFactor": 0.0, "roughnessFactor": round(float(look.roughness), 4)}
        row: dict[str, Any] = {
            "pbrMetallicRoughness": {"baseColorFactor": np.round([*colour, opacity], 4).tolist(), **rough}
        }
        if opacity < 1.0:
            row |= {"alphaMode": "BLEND"}
        if beam:
            row |= {"emissiveFactor": np.round(GLOW * colour, 4).tolist()}
        else:
            row |= {"doubleSided": True}
        return self._row("materials", row)

    def _row(self, table: str, row: dict[str, Any]) -> int:
        key = (table, repr(row))
        if key not in self._known:
            self._known[key] = len(self._tables[table])
            self._tables[table].append(row)
        return self._known[key]

    def _instances(self, prim: Usd.Prim) -> list[int]:
        """A node for every instance, with what its prototype shows."""
        instancer = UsdGeom.PointInstancer(prim)
        kind = self._source.values.array(prim, "protoIndices", kind=int)
        moves = any(
            prim.GetAttribute(name).ValueMightBeTimeVarying() for name in ("positions", "orientations", "orientationsf")
        )
        codes = self._codes if moves else self._codes[:1]
        values = [Values(self._source.file, Usd.TimeCode(code)) for code in codes]
        matrices = np.array([instance_matrices(v, instancer, len(kind)) for v in values])
        mask = shown_instances(self._source.values, instancer, len(kind))
        colour, opacity = self._reader.looks.per_instance(prim, len(kind))
        nodes = []
        for index, path in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            solids, same = self._prototype(path), None
            for k in np.flatnonzero(mask & (kind == index)):
                if same is None or colour is not None or opacity is not None:
                    own = slice(k, k + 1)
                    looks = [
                        Look(
                            batch.look.colour if colour is None else colour[own],
                            batch.look.opacity if opacity is None else opacity[own],
                            batch.look.roughness,
                        )
                        for batch in solids
                    ]
                    same = [self._mesh(batch, look, False) for batch, look in zip(solids, looks, strict=True)]
                meshes = same
                name = f"{prim.GetName()}_{k}"
                node: dict[str, Any] = {"name": name}
                if len(meshes) == 1:
                    node["mesh"] = meshes[0]
                else:
                    node["children"] = [self._node({"name": f"{name}_{m}", "mesh": m}, _AT_REST) for m in meshes]
                if meshes:
                    nodes.append(self._node(node, Motion.of(matrices[:, k])))
        return nodes

    def _prototype(self, path: Sdf.Path) -> list[Batch]:
        """Solids of a prototype, in the frame of the prim above it."""
        top = self._stage.GetPrimAtPath(path)
        cache = UsdGeom.XformCache(self._source.start)
        batches = []
        for prim in Usd.PrimRange(top, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)) if top else ():
            if prim.IsA(UsdGeom.Gprim) and self._drawn(prim):
                own = np.array(cache.ComputeRelativeTransform(prim, top.GetParent())[0]).T
                batches += [b.placed(own[None], None, None) for b in self._reader.read(prim, beam=False)]
        return batches

    def _camera(self, prim: Usd.Prim) -> int:
        values, size = self._source.values, self._source.unit * self._unit
        lens = check_lens(values, prim)
        near, far = (float(v) * size for v in values.value(prim, "clippingRange"))
        planes = {"znear": max(near, 1e-3 * far), "zfar": far}
        if values.value(prim, "projection") == UsdGeom.Tokens.orthographic:
            half = [0.05 * lens[f"{way}Aperture"] * size for way in ("horizontal", "vertical")]
            row = {"type": "orthographic", "orthographic": {"xmag": half[0], "ymag": half[1], **planes}}
        else:
            angle = 2.0 * float(np.arctan(0.5 * lens["verticalAperture"] / lens["focalLength"]))
            aspect = lens["horizontalAperture"] / lens["verticalAperture"]
            row = {"type": "perspective", "perspective": {"yfov": angle, "aspectRatio": aspect, **planes}}
        return self._row("cameras", {"name": prim.GetName(), **row})


_AT_REST = Motion.of(np.eye(4)[None])
