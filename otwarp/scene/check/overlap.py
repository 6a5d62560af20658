"""Refuses scenes whose bodies start inside each other or inside an obstacle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from otwarp.scene.description import Body, Obstacle, Rod, Sphere, Vec3
from otwarp.scene.meshes import inside_mesh, nearest_distance
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.period import ghosts_of, nearest
from otwarp.scene.transforms import rotation_matrix
from otwarp.scene.vocabulary.values import bad

OVERLAP_TOLERANCE = 0.1
"""Overlap at the start that a file may say, relative to the smaller radius."""

INSIDE = 1.9
"""Overlap, relative to the smaller radius, beyond which the smaller is as good as inside: no contact parts them."""

_BEADS = 0.5
"""Distance, relative to its radius, of the spheres that stand for a rod: 3 % of the radius is the most they miss."""

_MOST = 10_000
"""Spheres that stand for one rod: a thinner one has gaps between them, and does not fill the memory."""

_LARGE = 4.0
"""Spheres larger than this times the median are compared with all others instead of through the grid."""

_HALF_SPACE = [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) > (0, 0, 0)]


def check_overlaps(
    where: str,
    bodies: Sequence[Body],
    obstacles: Sequence[Obstacle],
    share: float = OVERLAP_TOLERANCE,
    period: Vec3 = (0.0, 0.0, 0.0),
) -> None:
    """Check colliding spheres and rods of different bodies, and each of them against all obstacles, at the start.

    Args:
        where: What errors name first.
        bodies: The bodies.
        obstacles: The obstacles.
        share: Allowed overlap relative to the smaller radius.
        period: As `Settings.period` [µm].

    Raises:
        InputError: Names the pair that overlaps most, by how much, and the allowed overlap.
    """
    owners, centres, radii = colliding_spheres(bodies)
    if not len(owners):
        return
    which, shift = ghosts_of(centres, radii, period)
    a, b = candidate_pairs(centres[which] + shift, radii[which])
    a, b = which[a], which[b]
    other = owners[a] != owners[b]
    a, b = a[other], b[other]
    depth = radii[a] + radii[b] - np.linalg.norm(nearest(centres[a] - centres[b], period), axis=1)
    excess = depth - share * np.minimum(radii[a], radii[b])
    if len(excess) and excess.max() > 0.0:
        worst = int(excess.argmax())
        first, second = (bodies[int(owners[pair[worst]])].name for pair in (a, b))
        limit = share * min(radii[a[worst]], radii[b[worst]])
        raise bad(where, first, f"overlap with {second}", f"{depth[worst]:g} µm", f"at most {limit:g} µm at the start")
    for obstacle in obstacles:
        centres = obstacle.position.at(0.0) + nearest(centres - obstacle.position.at(0.0), period)
        depth = radii - (mesh_distance if obstacle.shape == "mesh" else signed_distance)(obstacle, centres, radii)
        excess = depth - share * radii
        worst = int(excess.argmax())
        if excess[worst] > 0.0:
            limit = f"at most {share * radii[worst]:g} µm at the start"
            name = bodies[owners[worst]].name
            raise bad(where, name, f"overlap with {obstacle.prim}", f"{depth[worst]:g} µm", limit)


def colliding_spheres(bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index of the body (n,), centre (n, 3) and radius (n,) [µm] of all that collides; rods as rows of spheres."""
    owners, centres, radii = [], [], []
    for index, body in enumerate(bodies):
        plain = len(body.spheres) == 1 and not body.rods and not any(body.spheres[0].offset)
        turn = None if plain else rotation_matrix(_array(body))
        for element in body.colliding:
            for offset in _beads(element):
                owners.append(index)
                radii.append(element.radius)
                centres.append(body.position if turn is None else turn @ offset + body.position)
    return np.array(owners, dtype=int), np.array(centres, dtype=float).reshape(-1, 3), np.array(radii, dtype=float)


def _beads(element: Sphere | Rod) -> np.ndarray:
    """(n, 3) centres in the body's frame of the spheres that an element is compared by: itself, or a row along it."""
    if isinstance(element, Sphere):
        return np.array([element.offset])
    start, end = np.array(element.start), np.array(element.end)
    count = 2 + int(min(float(np.linalg.norm(end - start)) / (_BEADS * element.radius), _MOST))
    return start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)


def _array(body: Body) -> np.ndarray:
    return np.array(body.orientation)


def candidate_pairs(centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index pairs (a, b) that hold every touching pair once: a cell grid for the many, brute force for the few large.

    Args:
        centres: (n, 3).
        radii: (n,).
    """
    large = np.flatnonzero(radii > _LARGE * np.median(radii))
    small = np.flatnonzero(radii <= _LARGE * np.median(radii))
    pairs = [np.empty((2, 0), dtype=int)]
    if len(small) > 1:
        pairs.append(small[_grid_pairs(centres[small], 2.0 * float(radii[small].max()))])
    for index in large:
        near = np.linalg.norm(centres - centres[index], axis=1) < radii + radii[index]
        near[large[large <= index]] = False
        found = np.flatnonzero(near)
        pairs.append(np.stack([np.full_like(found, index), found]))
    a, b = np.concatenate(pairs, axis=1)
    return a, b


def _grid_pairs(centres: np.ndarray, size: float) -> np.ndarray:
    cells = np.floor((centres - centres.min(axis=0)) / size).astype(np.int64)
    shape = cells.max(axis=0) + 3
    key = ((cells[:, 0] + 1) * shape[1] + cells[:, 1] + 1) * shape[2] + cells[:, 2] + 1
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    rank = np.arange(len(key))
    found = [_expand(order, rank, rank + 1, np.searchsorted(ordered, ordered, side="right"))]
    for i, j, k in _HALF_SPACE:
        wanted = ordered + (i * shape[1] + j) * shape[2] + k
        first, last = np.searchsorted(ordered, wanted, side="left"), np.searchsorted(ordered, wanted, side="right")
        found.append(_expand(order, rank, first, last))
    return np.concatenate(found, axis=1)


def _expand(order: np.ndarray, rank: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    count = last - first
    offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([order[np.repeat(rank, count)], order[np.repeat(first, count) + offset]])


def _local(obstacle: Obstacle, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) in the frame of an obstacle at the start."""
    turn = obstacle.orientation.at(0.0)
    return (points - obstacle.position.at(0.0)) @ rotation_matrix(turn / np.linalg.norm(turn))


def mesh_distance(obstacle: Obstacle, points: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Distance (n,) of points (n, 3) from a mesh at the start, searched up to `reach` (n,), negative inside [µm].

    Points outside that are further away get inf, points inside that are deeper −reach.
    """
    local, corners = _local(obstacle, points), obstacle.vertices[obstacle.triangles]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    near = np.flatnonzero(((local >= low - reach[:, None]) & (local <= high + reach[:, None])).all(axis=1))
    out = np.full(len(points), np.inf)
    mesh = (obstacle.vertices, obstacle.triangles)
    out[near] = nearest_distance(local[near], reach[near], *mesh)
    inside = near[inside_mesh(local[near], *mesh)]
    out[inside] = -np.minimum(out[inside], reach[inside])
    return out


def signed_distance(obstacle: Obstacle, points: np.ndarray, reach: np.ndarray | None = None) -> np.ndarray:
    """Distance (n,) of points (n, 3) from the surface of an analytic obstacle at the start, negative inside [µm].

    `reach` is there so that all shapes are asked alike; these distances are exact everywhere.
    """
    distance = SHAPES[obstacle.shape].distance
    assert distance is not None, "meshes have `mesh_distance`"
    return distance(_local(obstacle, points), np.array(obstacle.size))
