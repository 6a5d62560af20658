"""Reads obstacles: colliders that are no part of a body, at rest or moving along time samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.scene import vocabulary
from otwarp.scene.description import Obstacle
from otwarp.scene.meshes import fan
from otwarp.scene.obstacle_shapes import ROUND
from otwarp.scene.read.attributes import read_values
from otwarp.scene.read.motion import motion
from otwarp.scene.read.source import Source, track, vec3
from otwarp.scene.transforms import multiply

_HALF = float(np.sqrt(0.5))
_AXES = {"X": (0.0, _HALF, 0.0, _HALF), "Y": (-_HALF, 0.0, 0.0, _HALF), "Z": (0.0, 0.0, 0.0, 1.0)}
"""Rotation that takes +Z to each axis."""

_CONSTANT = 1e-6
"""Relative change of a scale that counts as none."""


def is_collider(source: Source, prim: Usd.Prim) -> bool:
    """Whether a prim has PhysicsCollisionAPI and it is not switched off."""
    name = "physics:collisionEnabled"
    return source.has(prim, "PhysicsCollisionAPI") and source.values.value(prim, name, absent=True, constant=True)


def read_obstacle(source: Source, prim: Usd.Prim) -> Obstacle:
    """Read one prim with PhysicsCollisionAPI.

    Raises:
        InputError: A shape that is not supported, a scale it cannot carry, or a scale that changes.
    """
    readers = {
        "Cube": _box,
        "Sphere": _sphere,
        **dict.fromkeys(ROUND, _round),
        "Plane": _plane,
        "Mesh": _mesh,
    }
    kind = str(prim.GetTypeName())
    if kind not in readers:
        raise source.bad(prim, "apiSchemas", "PhysicsCollisionAPI", f"on one of {', '.join(readers)}, not {kind}")
    times, positions, rotations, scales = motion(source, prim)
    if np.abs(scales - scales[0]).max() > _CONSTANT * np.abs(scales[0]).max():
        raise source.bad(prim, "xformOp:scale", "(time samples that change it)", "constant in time")
    axis = source.values.value(prim, "axis") if kind in (*ROUND, "Plane") else "Z"
    fields: dict[str, Any] = readers[kind](source, prim, scales[0], axis)
    turned = rotations if axis == "Z" else multiply(rotations, np.array(_AXES[axis]))
    return Obstacle(
        prim=str(prim.GetPath()),
        position=track(times, positions),
        orientation=track(times, turned),
        hydrodynamic=_hydrodynamic(source, prim),
        **fields,
    )


def _hydrodynamic(source: Source, prim: Usd.Prim) -> bool:
    applied = source.has(prim, vocabulary.OBSTACLE.name)
    return applied and read_values(source.file, prim, vocabulary.OBSTACLE)["hydrodynamic"]


def _box(source: Source, prim: Usd.Prim, scale: np.ndarray, axis: str) -> dict[str, Any]:
    half = source.geometry(prim, "size") / 2 * np.abs(scale)
    return {"shape": "box", "size": vec3(half)}


def _sphere(source: Source, prim: Usd.Prim, scale: np.ndarray, axis: str) -> dict[str, Any]:
    return {"shape": "sphere", "size": (source.geometry(prim, "radius") * source.uniform(prim, scale), 0.0, 0.0)}


def _round(source: Source, prim: Usd.Prim, scale: np.ndarray, axis: str) -> dict[str, Any]:
    radius, half = round_size(source, prim, scale, axis)
    return {"shape": ROUND[str(prim.GetTypeName())], "size": (radius, half, 0.0)}


def round_size(source: Source, prim: Usd.Prim, scale: np.ndarray, axis: str) -> tuple[float, float]:
    """Radius and half height (of the straight part) of a solid about an axis under `scale` [µm].

    Raises:
        InputError: A scale that makes it something else.
    """
    along = "XYZ".index(axis)
    across = np.delete(np.abs(scale), along)
    capsule = prim.IsA(UsdGeom.Capsule)
    uneven = np.ptp(np.abs(scale) if capsule else across) > _CONSTANT * across.max()
    if uneven:
        shown = ", ".join(f"{s / source.unit:g}" for s in scale)
        allowed = "uniform on a capsule" if capsule else f"equal across the axis of a {str(prim.GetTypeName()).lower()}"
        raise source.bad(prim, "xformOp:scale", f"({shown})", allowed)
    radius = source.geometry(prim, "radius") * float(across[0])
    half = source.geometry(prim, "height", positive=not capsule) / 2 * float(abs(scale[along]))
    return radius, half


def _plane(source: Source, prim: Usd.Prim, scale: np.ndarray, axis: str) -> dict[str, Any]:
    return {"shape": "plane"}


def _mesh(source: Source, prim: Usd.Prim, scale: np.ndarray, axis: str) -> dict[str, Any]:
    points = source.values.array(prim, "points", 3, constant=True)
    counts = source.values.array(prim, "faceVertexCounts", kind=int, constant=True)
    corners = source.values.array(prim, "faceVertexIndices", kind=int, constant=True)
    if not len(points) or not len(counts):
        raise source.bad(prim, "points", f"{len(points)} points, {len(counts)} faces", "a mesh of at least one face")
    if counts.min() < 3 or counts.sum() != len(corners):
        raise source.bad(prim, "faceVertexCounts", f"sum {counts.sum()}", f"at least 3 each, in all {len(corners)}")
    if corners.min() < 0 or corners.max() >= len(points):
        raise source.bad(prim, "faceVertexIndices", f"{corners.min()} … {corners.max()}", f"in [0, {len(points) - 1}]")
    triangles = fan(counts, corners)
    left_handed = source.values.value(prim, "orientation") == UsdGeom.Tokens.leftHanded
    if left_handed != (float(np.prod(scale)) < 0.0):  # keep the outside outside
        triangles = triangles[:, ::-1]
    return {
        "shape": "mesh",
        "vertices": points * scale,
        "triangles": np.ascontiguousarray(triangles, dtype=np.int32),
        "double_sided": source.values.value(prim, "doubleSided", constant=True),
    }
