"""Even covering of a closed triangle mesh with blobs, and the mobility of the rigid body that it bounds.

The triangles are sampled in proportion to their area. Nodes start far from each other and are spread by Lloyd's
iteration over the samples. Distances count normals too, so that no cell reaches through a thin wall.

Sources: farthest-point sampling, T. F. Gonzalez, Theor. Comput. Sci. 38, 293 (1985), doi:10.1016/0304-3975(85)90224-5;
S. P. Lloyd, IEEE Trans. Inf. Theory 28, 129 (1982), doi:10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

import numpy as np

from otwarp.hydrodynamics.blobs import MOST_BLOBS, refine, too_many
from otwarp.hydrodynamics.covering import Covering, nearest_node
from otwarp.hydrodynamics.rigid import BodyMobility, about_centre_of_diffusion, assemble

SAMPLES = 24
"""Samples for each node, more where triangles are small."""

ROUNDS = 8
"""Rounds of Lloyd's iteration; the start is less even than a spiral."""

COARSEST = 60
"""Nodes of the first level."""

PLASTIC = 1.324717957244746
"""Root of x³ = x + 1; its inverse powers give the most even sequence of points in the plane (M. Roberts 2018)."""


def mesh_mobility(vertices: np.ndarray, triangles: np.ndarray, accuracy: float) -> BodyMobility:
    """Mobility of the rigid body bounded by a mesh.

    Args:
        vertices: (v, 3) µm.
        triangles: (t, 3) vertex indices, anticlockwise from outside.
        accuracy: Wanted relative error, in (0, 0.5].

    Returns:
        The mobility, with one flow coupling, that to the flow at the centre of diffusion.

    Raises:
        InputError: More than `otwarp.hydrodynamics.blobs.MOST_BLOBS` blobs would be needed.
    """
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middle = np.average(corners.mean(axis=1), axis=0, weights=area)

    def covering(count: int) -> Covering:
        if count > MOST_BLOBS:
            raise too_many(count)
        return cover_mesh(vertices - middle, triangles, count)

    found = refine(covering, COARSEST, accuracy)
    offset, about_reference = about_centre_of_diffusion(found.mobility)
    return assemble(
        middle + offset,
        about_reference,
        np.eye(6)[None],
        error=found.error,
        blobs=len(found.covering.area),
    )


def cover_mesh(vertices: np.ndarray, triangles: np.ndarray, count: int) -> Covering:
    """Cover a mesh with nearly `count` nodes of nearly equal area.

    Args:
        vertices: (v, 3).
        triangles: (t, 3) vertex indices, anticlockwise from outside.
        count: Wanted number of nodes.
    """
    point, normal, area = sample_mesh(vertices, triangles, SAMPLES * count)
    spacing = np.sqrt(area.sum() / count)
    feature = np.concatenate([point, spacing * normal], axis=1)
    node = feature[_far_apart(feature, count)]
    for _ in range(ROUNDS):
        node = _means(feature, area, nearest_node(node, feature), len(node))[0]
    cell = nearest_node(node, feature)
    mean, share = _means(feature, area, cell, len(node))
    direction = mean[:, 3:] / np.maximum(np.linalg.norm(mean[:, 3:], axis=1, keepdims=True), 1e-300)
    # up from the centroid of the cell, which is below a curved surface, to the tangent plane of the sample above it
    above = nearest_node(point, mean[:, :3])
    lift = np.einsum("ni,ni->n", point[above] - mean[:, :3], direction)
    spread = point - mean[cell, :3]
    width = np.bincount(cell, area * np.einsum("ni,ni->n", spread, spread), len(node)) / (2.0 * share)
    curvature = np.maximum(lift, 0.0) / np.maximum(width, 1e-300)
    owner = np.zeros(len(node), dtype=int)
    return Covering(mean[:, :3] + lift[:, None] * direction, direction, share, curvature, owner)


def sample_mesh(vertices: np.ndarray, triangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """About `count` points evenly on the triangles, one at least on each: positions, unit normals and areas."""
    corners = vertices[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    solid = area > 0.0
    corners, cross, area = corners[solid], cross[solid], area[solid]
    many = np.maximum(np.rint(count * area / area.sum()), 1.0).astype(int)
    owner = np.repeat(np.arange(len(many)), many)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(many) - many, many)
    u, v = (0.5 + step / PLASTIC) % 1.0, (0.5 + step / PLASTIC**2) % 1.0
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    lone = (many == 1)[owner]
    u, v = np.where(lone, 1.0 / 3.0, u), np.where(lone, 1.0 / 3.0, v)
    a, b, c = (corners[owner, k] for k in range(3))
    point = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return point, (cross / (2.0 * area[:, None]))[owner], (area / many)[owner]


def _far_apart(feature: np.ndarray, count: int) -> np.ndarray:
    """Indices of `count` samples, each the farthest from those before it."""
    chosen = np.zeros(min(count, len(feature)), dtype=int)
    distance = np.full(len(feature), np.inf)
    for k in range(1, len(chosen)):
        away = feature - feature[chosen[k - 1]]
        distance = np.minimum(distance, np.einsum("ni,ni->n", away, away))
        chosen[k] = int(np.argmax(distance))
    return chosen


def _means(feature: np.ndarray, area: np.ndarray, cell: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean feature and area of each cell, cells without samples left out."""
    share = np.bincount(cell, area, count)
    sums = np.stack([np.bincount(cell, area * f, count) for f in feature.T], axis=1)
    taken = share > 0.0
    return sums[taken] / share[taken, None], share[taken]
