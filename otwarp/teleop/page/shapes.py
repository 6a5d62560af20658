"""Triangles of the solids that are drawn: vertices (n, 3) and faces (m, 3), counter-clockwise seen from outside."""

from __future__ import annotations

from functools import cache

import numpy as np

from otwarp.scene.drawing.draw_list import BOX, CAPSULE, MESH, PLANE, SPHERE, TUBE, TriangleMesh

Triangles = tuple[np.ndarray, np.ndarray]

SIDES = 32
"""Flat sides of a round solid."""
FARTHEST_PLANE = 300.0
"""Half side at which an unbounded plane is cut off [µm]."""
BEAM_LENGTH, BEAM_WAIST, BEAM_RADIUS = 10.0, 0.22, 2.1
"""Half length, radius at the focus and at the ends of a drawn beam [µm]: a symbol, as in the scenes."""


@cache
def ball(subdivisions: int = 3) -> Triangles:
    """Unit sphere: an icosahedron whose triangles are cut in four `subdivisions` times (20·4ⁿ faces)."""
    g = (1.0 + 5.0**0.5) / 2.0
    corners = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    points = [np.array(c) / np.linalg.norm(c) for c in corners]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6)]
    faces += [(7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10)]
    faces += [(8, 6, 7), (9, 8, 1)]
    for _ in range(subdivisions):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, middles: dict[tuple[int, int], int] = middles) -> int:
            """Index of the point halfway between two, on the sphere."""
            key = (min(a, b), max(a, b))
            if key not in middles:
                m = points[a] + points[b]
                points.append(m / np.linalg.norm(m))
                middles[key] = len(points) - 1
            return middles[key]

        cut = []
        for a, b, c in faces:
            d, e, f = middle(a, b), middle(b, c), middle(c, a)
            cut += [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
        faces = cut
    return np.array(points), np.array(faces)


def box() -> Triangles:
    """Cube from −1 to 1; each face has its own corners, so that edges stay sharp."""
    points, faces = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            first = len(points)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                p = np.zeros(3)
                p[axis], p[a], p[b] = side, u * side, v
                points.append(p)
            faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return np.array(points), np.array(faces)


def turned(profile: np.ndarray, sides: int = SIDES) -> Triangles:
    """A curve (n, 2) of (radius, z), z rising, turned about z; open at its ends."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    r, z = profile[:, :1], profile[:, 1:]
    x, y, h = r * np.cos(angle), r * np.sin(angle), np.broadcast_to(z, (len(profile), sides))
    points = np.stack([x, y, h], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(len(profile) - 1), np.arange(sides), indexing="ij")
    k = (j + 1) % sides
    a, b, c, d = i * sides + j, i * sides + k, (i + 1) * sides + k, (i + 1) * sides + j
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return points, faces


def tube(top: float) -> Triangles:
    """Closed tube along z from −1 to 1 with radius 1 at −1 and `top` at +1."""
    wall = turned(np.array([[1.0, -1.0], [top, 1.0]]))
    caps = [turned(np.array([[0.0, -1.0], [1.0, -1.0]]))] + (
        [turned(np.array([[top, 1.0], [0.0, 1.0]]))] if top else []
    )
    return merged([wall, *caps])


def capsule(half: float) -> Triangles:
    """Radius 1 about the segment z = ±half."""
    angle = np.linspace(0.0, np.pi / 2.0, 6)
    upper = np.stack([np.cos(angle), half + np.sin(angle)], axis=1)
    return turned(np.concatenate([upper[::-1] * (1.0, -1.0), upper]), 18)


def rectangle(half_width: float, half_length: float) -> Triangles:
    """Rectangle in z = 0, normal +z."""
    w, h = min(half_width, FARTHEST_PLANE), min(half_length, FARTHEST_PLANE)
    return np.array([(-w, -h, 0), (w, -h, 0), (w, h, 0), (-w, h, 0)], dtype=float), np.array([(0, 1, 2), (0, 2, 3)])


def beam() -> Triangles:
    """A beam along z with its waist at the origin: w(z) = w₀·√(1 + (z/z₀)²), as that of a Gaussian beam [µm]."""
    rayleigh = BEAM_LENGTH / ((BEAM_RADIUS / BEAM_WAIST) ** 2 - 1.0) ** 0.5
    z = BEAM_LENGTH * np.sin(np.linspace(-np.pi / 2.0, np.pi / 2.0, 33)) ** 3  # closer together near the waist
    return turned(np.stack([BEAM_WAIST * np.sqrt(1.0 + (z / rayleigh) ** 2), z], axis=1), 24)


def solid(kind: int, size: tuple[float, float], mesh: TriangleMesh | None = None, *, small: bool = False) -> Triangles:
    """A canonical solid of `otwarp.scene.drawing.draw_list`; of a small ball nobody sees the corners of fewer faces."""
    if kind == SPHERE:
        return ball(2 if small else 3)
    if kind == BOX:
        return box()
    if kind == TUBE:
        return tube(size[0])
    if kind == CAPSULE:
        return capsule(size[0])
    if kind == PLANE:
        return rectangle(*size)
    if kind == MESH and mesh is not None:
        return mesh.points, mesh.triangles
    raise ValueError(f"solid kind = {kind}: must be one of the draw list's, a mesh with its triangles")


def placed(triangles: Triangles, matrix: np.ndarray) -> Triangles:
    """The same solid under an affine map (4, 4); a reflection turns the faces over."""
    points, faces = triangles
    moved = points @ matrix[:3, :3].T + matrix[:3, 3]
    return moved, faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0.0 else faces


def merged(many: list[Triangles]) -> Triangles:
    """Several solids as one."""
    shift = np.cumsum([0] + [len(points) for points, _ in many])
    return (
        np.concatenate([points for points, _ in many]),
        np.concatenate([faces + k for (_, faces), k in zip(many, shift, strict=False)]),
    )
