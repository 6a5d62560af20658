"""A triangle mesh from a file, as an obstacle: read, repaired, checked, simplified on request.

What was repaired is said; what cannot be is refused, with what to do about it. Faces of a solid look outwards, those of
a chamber inwards: bodies belong into it. A sheet may be open and is solid from both sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.meshes import is_closed, nearest_distance
from otwarp.triangles import check_mesh_size, read_triangles

Kind = Literal["solid", "chamber", "sheet"]
ENDINGS = (".stl", ".obj", ".ply")
ALLOWED = "a triangle mesh in STL, OBJ or PLY"

LARGEST_FILE = 1 << 30
"""Bytes: more is read by nobody in reasonable time."""

MOST_TRIANGLES = 500_000
"""Of an obstacle; a scene of as many as text has some forty megabytes."""

SAMPLES, REACH = 1000, 0.05
"""How many corners are looked at for what simplifying moved, and how far, over the longest side."""


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A mesh that can be an obstacle.

    Attributes:
        kind: `solid`, `chamber` or `sheet`.
        vertices: (n, 3) µm.
        triangles: (m, 3) indices.
        repairs: What was mended, in words.
        size: Sides of the box around it [µm].
        volume: That it encloses [µm³], 0 for an open sheet.
        moved: How far simplifying moved the surface at most, at `SAMPLES` of its corners [µm]; 0 without, inf beyond
            `REACH` of its size.
    """

    kind: Kind
    vertices: np.ndarray
    triangles: np.ndarray
    repairs: tuple[str, ...]
    size: tuple[float, float, float]
    volume: float
    moved: float = 0.0


def read_surface(
    mesh: Any,
    *,
    metres_per_unit: float = 1e-6,
    kind: Kind = "solid",
    center: bool = False,
    simplify: int | None = None,
) -> Surface:
    """Read a mesh, mend what can be mended, and check the rest.

    Args:
        mesh: File that trimesh reads (STL, OBJ, PLY), a `trimesh.Trimesh`, or (vertices, triangles).
        metres_per_unit: Length of a unit of the mesh [m]: 1e-6 for µm, 1e-3 for mm.
        kind: What its surface bounds: a `solid` that is in the way, a `chamber` that bodies are in, or nothing, a
            `sheet`.
        center: Whether the middle of its box becomes the origin.
        simplify: Reduce it to about that many triangles.

    Raises:
        InputError: No such file, none that can be read, numbers that are not finite, a surface that stays open or flat,
            a size that no microscope would show, too many triangles, or the packages of `otwarp[mesh]` are missing.
    """
    if kind not in ("solid", "chamber", "sheet"):
        raise InputError(f"mesh: kind = {kind}: must be one of solid, chamber, sheet")
    if not (np.isfinite(metres_per_unit) and metres_per_unit > 0.0):
        raise InputError(f"mesh: metres_per_unit = {metres_per_unit:g}: must be in (0, inf)")
    name, found = _load(mesh)
    check_mesh_size(name, float(np.ptp(found.vertices, axis=0).max()), metres_per_unit)
    found.vertices = found.vertices * (metres_per_unit / 1e-6)  # before corners are joined: trimesh does within 1e-8
    repairs = _mended(found, kind)
    if kind != "sheet" and not found.is_watertight:
        raise InputError(f"{name}: {_hole(found)}; allowed: a closed surface, or --as sheet for a thin wall that is "
                         "solid from both sides")  # fmt: skip
    moved = 0.0
    if simplify is not None:
        found, moved = _simplified(name, found, kind, simplify)
    if len(found.faces) > MOST_TRIANGLES:
        raise InputError(f"{name}: has {len(found.faces):,} triangles; allowed: up to {MOST_TRIANGLES:,}, which "
                         "--simplify N reduces it to")  # fmt: skip
    vertices, triangles = np.asarray(found.vertices, dtype=float), np.asarray(found.faces, dtype=np.int32)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    if center:
        vertices = vertices - 0.5 * (low + high)
    closed = is_closed(vertices, triangles)
    volume = _volume(vertices, triangles) if closed else 0.0
    if kind != "sheet" and not (closed and volume > 1e-9 * float(np.prod(np.maximum(high - low, 1e-3)))):
        raise InputError(f"{name}: encloses a volume of {volume:.3g} µm³; allowed: a closed surface around a solid")
    x, y, z = (float(side) for side in high - low)
    return Surface(
        kind=kind, vertices=vertices, triangles=triangles[:, ::-1].copy() if kind == "chamber" else triangles,
        repairs=tuple(repairs), size=(x, y, z), volume=volume, moved=moved,
    )  # fmt: skip


def _load(mesh: Any) -> tuple[str, Any]:
    """What errors call it, and the mesh with finite corners, as it is."""
    if isinstance(mesh, (str, Path)) and Path(mesh).is_file():
        file = Path(mesh)
        if file.suffix.lower() not in ENDINGS:
            raise InputError(f"{mesh}: suffix = {file.suffix or '(none)'}; allowed: {ALLOWED}")
        if file.stat().st_size > LARGEST_FILE:
            raise InputError(
                f"{mesh}: has {file.stat().st_size / 2**30:.3g} GiB; allowed: up to 1 GiB, simplified before"
            )
    return read_triangles(mesh, "mesh", ALLOWED)


def _mended(mesh: Any, kind: Kind) -> list[str]:
    """Join corners, drop triangles without three of them or twice there, close small holes, turn faces: in place."""
    from trimesh import repair

    said, before = [], len(mesh.faces)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)  # STL keeps the corners of each triangle apart
    a, b, c = np.asarray(mesh.faces).T
    mesh.update_faces((a != b) & (b != c) & (c != a))
    mesh.update_faces(mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    if len(mesh.faces) < before:
        said.append(f"{before - len(mesh.faces)} triangles dropped that had no area or were there twice")
    if kind != "sheet" and len(mesh.faces) and not mesh.is_watertight:
        closed = len(mesh.faces)
        repair.fill_holes(mesh)
        if len(mesh.faces) > closed:
            said.append(f"holes closed with {len(mesh.faces) - closed} triangles")
    if len(mesh.faces) and not mesh.is_winding_consistent:
        repair.fix_winding(mesh)
        said.append("faces turned that looked the other way than their neighbours")
    if mesh.is_watertight and _volume(mesh.vertices, mesh.faces) < 0.0:
        mesh.invert()
        said.append("all faces looked inwards and were turned")
    return said


def _volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Enclosed by a closed surface, negative where its faces look inwards."""
    a, b, c = (np.asarray(vertices, dtype=float)[np.asarray(triangles)[:, k]] for k in range(3))
    return float(np.einsum("ni,ni->", a - a[0], np.cross(b - a[0], c - a[0]))) / 6.0


def _hole(mesh: Any) -> str:
    """Where a surface is not closed."""
    edges = np.asarray(mesh.edges_sorted)
    once, counts = np.unique(edges, axis=0, return_counts=True)
    odd = once[counts != 2]
    x, y, z = np.asarray(mesh.vertices)[odd[0]].mean(axis=0)
    what = "has holes" if (counts < 2).any() else "has edges of more than two triangles"
    return f"the surface {what}, {len(odd)} edges in all, the first near ({x:.4g}, {y:.4g}, {z:.4g}) µm"


def _simplified(name: str, mesh: Any, kind: Kind, count: int) -> tuple[Any, float]:
    """A mesh of about `count` triangles, and how far the surface moved."""
    if not count >= 4:
        raise InputError(f"{name}: --simplify is {count}; allowed: 4 triangles or more")
    if count >= len(mesh.faces):
        return mesh, 0.0
    try:
        less = mesh.simplify_quadric_decimation(face_count=count)
    except ImportError:
        raise InputError("mesh: --simplify needs fast-simplification: pip install 'otwarp[mesh]'") from None
    less.merge_vertices()
    if len(less.faces) == 0 or (kind != "sheet" and not less.is_watertight):
        raise InputError(f"{name}: simplified to {count} triangles it is no longer closed; allowed: more of them")
    corners = np.asarray(mesh.vertices)
    some = corners[:: max(1, len(corners) // SAMPLES)]
    reach = np.full(len(some), REACH * float(np.ptp(mesh.vertices, axis=0).max()))
    moved = nearest_distance(some, reach, np.asarray(less.vertices), np.asarray(less.faces))
    return less, float(moved.max())
