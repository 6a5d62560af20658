"""Reads rigid bodies: robots made of spheres and rods, single cells, and instanced cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.scene import vocabulary
from otwarp.scene.description import Body, Material, Rod, Sphere
from otwarp.scene.read.attributes import part, read_values
from otwarp.scene.read.obstacles import is_collider, round_size
from otwarp.scene.read.source import Source, quat, vec3
from otwarp.scene.read.typed import Values
from otwarp.scene.transforms import rotate


def read_robot(source: Source, prim: Usd.Prim) -> Body:
    """Read one prim with OtBodyAPI and the OtSphereAPI spheres and OtRodAPI rods below it.

    Raises:
        InputError: No sphere, a nested body, a mirrored one, or a sphere or rod that is scaled unevenly.
    """
    fields, _ = _fields(source, prim, vocabulary.BODY)
    position, rotation, scale = source.pose(prim)
    if np.prod(scale) < 0.0:
        shown = ", ".join(f"{s / source.unit:g}" for s in scale)
        raise source.bad(
            prim, "xformOp:scale", f"({shown}), mirrored", "no reflection on a body; move its spheres instead"
        )
    spheres, rods = [], []
    for child in Usd.PrimRange(prim, Usd.TraverseInstanceProxies()):
        if child != prim and (source.has(child, "OtBodyAPI") or source.has(child, "OtCellAPI")):
            raise source.bad(child, "apiSchemas", "a body", f"outside the body {prim.GetPath()}")
        if source.has(child, "OtSphereAPI"):
            spheres.append(_sphere(source, child, prim, scale))
        if source.has(child, "OtRodAPI"):
            rods.append(_rod(source, child, prim, scale))
    if not spheres:
        raise source.bad(prim, "OtSphereAPI", "(no sphere below)", "on at least one Sphere below the body")
    return Body(
        prim=str(prim.GetPath()),
        position=vec3(position),
        orientation=quat(rotation),
        spheres=tuple(spheres),
        rods=tuple(rods),
        **fields,
    )


def _fields(source: Source, prim: Usd.Prim, schema: vocabulary.Schema) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the attributes of a robot or a cell say of the body, and what they say of a cell's one sphere."""
    values = read_values(source.file, prim, schema)
    parts = {"material": Material(**part(values, "material")), "forces": part(values, "forces")}
    return part(values) | parts, part(values, "sphere")


def _sphere(source: Source, prim: Usd.Prim, body: Usd.Prim, body_scale: np.ndarray) -> Sphere:
    _require_sphere(source, prim, "OtSphereAPI")
    # Through the frame of the body, not the world, so that offsets are exact wherever the body is.
    offset = source.relative(prim, body)[3, :3] * body_scale
    scale = source.uniform(prim, source.pose(prim)[2])
    values = read_values(source.file, prim, vocabulary.SPHERE)
    return Sphere(
        prim=str(prim.GetPath()), offset=vec3(offset), radius=source.geometry(prim, "radius") * scale, **values
    )


def _rod(source: Source, prim: Usd.Prim, body: Usd.Prim, body_scale: np.ndarray) -> Rod:
    if not (prim.IsA(UsdGeom.Capsule) or prim.IsA(UsdGeom.Cylinder)):
        kind = prim.GetTypeName() or "typeless prim"
        raise source.bad(prim, "apiSchemas", "OtRodAPI", f"on a Capsule or Cylinder, not a {kind}")
    values = read_values(source.file, prim, vocabulary.ROD)
    axis = source.values.value(prim, "axis")
    radius, half = round_size(source, prim, source.pose(prim)[2], axis)
    relative = source.relative(prim, body)
    middle = relative[3, :3] * body_scale
    along = relative["XYZ".index(axis), :3] * body_scale
    along /= np.linalg.norm(along)
    if prim.IsA(UsdGeom.Cylinder):
        half -= radius  # the rounded ends stay within its flat ones
        if half < 0.0:
            shown, least = 2.0 * (half + radius) / source.unit, 2.0 * radius / source.unit
            raise source.bad(prim, "height", f"{shown:g}", f"{least:g} stage units or more, twice the radius, on a rod")
    return Rod(
        prim=str(prim.GetPath()),
        start=vec3(middle - half * along),
        end=vec3(middle + half * along),
        radius=radius,
        **values,
    )


def read_cell(source: Source, prim: Usd.Prim) -> Body:
    """Read one Sphere with OtCellAPI.

    Raises:
        InputError: Not a Sphere, or scaled unevenly.
    """
    position, rotation, scale = source.pose(prim)
    radius = _cell_radius(source, prim) * source.uniform(prim, scale)
    fields, surface = _fields(source, prim, vocabulary.CELL)
    sphere = Sphere(prim=str(prim.GetPath()), radius=radius, **surface)
    return Body(
        prim=sphere.prim,
        kind="cell",
        position=vec3(position),
        orientation=quat(rotation),
        spheres=(sphere,),
        **fields,
    )


def _cell_radius(source: Source, prim: Usd.Prim) -> float:
    _require_sphere(source, prim, "OtCellAPI")
    return source.geometry(prim, "radius")


def _require_sphere(source: Source, prim: Usd.Prim, schema: str) -> None:
    if not prim.IsA(UsdGeom.Sphere):
        raise source.bad(prim, "apiSchemas", schema, f"on a Sphere, not a {prim.GetTypeName() or 'typeless prim'}")


def read_instances(source: Source, prim: Usd.Prim) -> list[Body]:
    """Read a PointInstancer whose prototypes are cells; one without cells is scenery and gives nothing.

    Raises:
        InputError: A prototype that holds a robot, several cells or an obstacle, bad indices, or an uneven scale.
    """
    instancer = UsdGeom.PointInstancer(prim)
    if is_collider(source, prim):
        raise source.bad(prim, "apiSchemas", "PhysicsCollisionAPI", "on prims that are obstacles, each by itself")
    prototypes = [source.stage.GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetForwardedTargets()]
    cells = [_prototype_cell(source, prim, prototype) for prototype in prototypes]
    if not any(cells):
        return []
    indices = source.values.array(prim, "protoIndices", kind=int)
    if indices.size and (indices.min() < 0 or indices.max() >= len(prototypes)):
        raise source.bad(prim, "protoIndices", f"{indices.min()} … {indices.max()}", f"in [0, {len(prototypes) - 1}]")
    local = instance_matrices(source.values, instancer, len(indices))
    shown = shown_instances(source.values, instancer, len(indices))
    world = source.matrix(prim)
    bodies: dict[int, Body] = {}
    for kind, (prototype, cell) in enumerate(zip(prototypes, cells, strict=True)):
        chosen = np.flatnonzero((indices == kind) & shown)
        if cell is not None and len(chosen):
            inner = source.relative(cell, prototype.GetParent())
            bodies |= _instances(source, prim, cell, chosen, inner @ local[chosen] @ world)
    return [bodies[index] for index in sorted(bodies)]


def instance_matrices(values: Values, instancer: UsdGeom.PointInstancer, count: int) -> np.ndarray:
    """(n, 4, 4) row-vector matrices of the instances, as USD computes them but for the rounding of their rotations."""
    prim = instancer.GetPrim()
    scales = values.array(prim, "scales", 3)
    given = {
        "positions": values.array(prim, "positions", 3),
        "orientations": instance_orientations(values, instancer, count),
        "scales": scales if len(scales) else np.ones((count, 3)),
    }
    for name, rows in given.items():
        if len(rows) != count:
            raise values.bad(prim, name, f"{len(rows)} instances", f"as many as protoIndices, {count}")
    out = np.tile(np.eye(4), (count, 1, 1))
    out[:, :3, :3] = given["scales"][:, :, None] * rotate(given["orientations"][:, None, :], np.eye(3))
    out[:, 3, :3] = given["positions"]
    return out


def shown_instances(values: Values, instancer: UsdGeom.PointInstancer, count: int) -> np.ndarray:
    """(n,) which of the instances are neither inactive nor invisible.

    Raises:
        InputError: Not as many `ids` as instances.
    """
    mask = np.array(instancer.ComputeMaskAtTime(values.time), dtype=bool)
    if len(mask) not in (0, count):
        raise values.bad(instancer.GetPrim(), "ids", f"{len(mask)} ids", f"as many as protoIndices, {count}")
    return mask if len(mask) else np.ones(count, dtype=bool)


def instance_orientations(values: Values, instancer: UsdGeom.PointInstancer, count: int) -> np.ndarray:
    """(n, 4) quaternions (x, y, z, w) of the instances, identity where none are authored.

    They are normalised: the half precision of `orientations` is too coarse for a rotation without shear. The single
    precision of `orientationsf` goes before it, as in USD.
    """
    for name in ("orientationsf", "orientations"):
        turns = values.array(instancer.GetPrim(), name, 4)
        if len(turns):
            length = np.linalg.norm(turns, axis=1, keepdims=True)
            if not length.all():
                place = f"{name}[{np.argmin(length)}]"
                raise values.bad(instancer.GetPrim(), place, 0, "a quaternion that is not zero")
            return turns / length
    return np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))


def _prototype_cell(source: Source, instancer: Usd.Prim, prototype: Usd.Prim) -> Usd.Prim | None:
    if not prototype:
        raise source.bad(instancer, "prototypes", "(a path without a prim)", "paths of prims")
    found = []
    for prim in Usd.PrimRange(prototype, Usd.TraverseInstanceProxies()):
        if source.has(prim, "OtBodyAPI") or source.has(prim, "OtTrapAPI"):
            raise source.bad(prim, "apiSchemas", ", ".join(source.applied(prim)), "outside a PointInstancer")
        if source.has(prim, "OtCellAPI"):
            found.append(prim)
    if len(found) > 1:
        raise source.bad(instancer, "prototypes", f"{len(found)} cells in {prototype.GetPath()}", "one cell each")
    cell = found[0] if found else None
    for prim in Usd.PrimRange(prototype, Usd.TraverseInstanceProxies()):
        if is_collider(source, prim) and not (cell and prim.GetPath().HasPrefix(cell.GetPath())):
            # obstacles are not read from instances: leaving them out without a word would let bodies pass through
            allowed = "on a cell, or outside a PointInstancer: instances are cells, obstacles are prims of their own"
            raise source.bad(prim, "apiSchemas", "PhysicsCollisionAPI", allowed)
    return cell


def _instances(
    source: Source, instancer: Usd.Prim, cell: Usd.Prim, chosen: np.ndarray, matrices: np.ndarray
) -> dict[int, Body]:
    positions, rotations, scales = source.split(instancer, matrices)
    sizes = np.abs(scales)
    worst = int(np.argmax((sizes.max(axis=1) - sizes.min(axis=1)) / sizes.max(axis=1)))
    source.uniform(instancer, scales[worst])
    radii = _cell_radius(source, cell) * sizes[:, 0]
    fields, surface = _fields(source, cell, vocabulary.CELL)
    path, proto = str(instancer.GetPath()), str(cell.GetPath())
    spheres = {radius: (Sphere(prim=proto, radius=radius, **surface),) for radius in set(radii.tolist())}
    rows = zip(chosen.tolist(), positions.tolist(), rotations.tolist(), radii.tolist(), strict=True)
    return {
        index: Body(
            prim=path,
            kind="cell",
            instance=index,
            position=vec3(place),
            orientation=quat(turn),
            spheres=spheres[radius],
            **fields,
        )
        for index, place, turn, radius in rows
    }
