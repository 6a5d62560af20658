"""Even coverings of the outer surface of spheres and rods that are stuck together.

A rod is a capsule: the points within its radius of a segment; a sphere is a rod whose two ends coincide. Each element
gets an equal-area spiral of nodes, and many more samples on a finer one. Samples inside another element are dropped,
nodes that keep too little of their cell go with them, and a few rounds of Lloyd's iteration spread the others evenly
over what is left, up to the seams.

Source: the spiral is that of R. Swinbank, R. J. Purser, Q. J. R. Meteorol. Soc. 132, 1769 (2006),
doi:10.1256/qj.05.227, stretched over the straight part; S. P. Lloyd, IEEE Trans. Inf. Theory 28, 129 (1982),
doi:10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SAMPLES = 24
"""Samples for each node; the area of a cell cut by a seam is known to about 1/SAMPLES."""

ROUNDS = 5
"""Rounds of Lloyd's iteration; further ones change no friction in its fourth digit."""

LEAST_EXPOSED = 0.35
"""Exposed part of its cell below which a node is dropped and its neighbours take over."""

COINCIDENT = 1e-9
"""Distance, relative to the radius, at which two surfaces count as one; the earlier element keeps it."""

IMMERSED = 1e-12
"""Relative overhang below which a sphere counts as inside another: rounding of authored coordinates."""

PAIRS = 4_000_000
"""Pairs of nodes and samples up to which all distances are looked at: loading the tree takes as long as that."""

GOLDEN_ANGLE = np.pi * (1.0 + np.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class Elements:
    """m spheres and rods: ends of their axes (m, 3), (m, 3) and radii (m,), all in one unit of length."""

    start: np.ndarray
    end: np.ndarray
    radius: np.ndarray

    @property
    def length(self) -> np.ndarray:
        """(m,) lengths of the axes, 0 for spheres."""
        return np.linalg.norm(self.end - self.start, axis=1)

    @property
    def area(self) -> np.ndarray:
        """(m,) whole surfaces, exposed or not."""
        return 2.0 * np.pi * self.radius * (2.0 * self.radius + self.length)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(k, m) distances of points (k, 3) from the axes of all elements."""
        return np.linalg.norm(points[:, None] - self.nearest(points), axis=-1)

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """(k, m, 3) points of the axes nearest to points (k, 3)."""
        axis = self.end - self.start
        squared = np.einsum("mi,mi->m", axis, axis)
        along = np.einsum("kmi,mi->km", points[:, None] - self.start, axis) / np.where(squared > 0.0, squared, 1.0)
        return self.start + np.clip(along, 0.0, 1.0)[..., None] * axis


def outermost_spheres(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Indices of the spheres (n, 3), (n,) that are not inside another one; of coincident equal ones the first stays."""
    distance = np.linalg.norm(centres[:, None, :] - centres[None, :, :], axis=-1)
    return np.flatnonzero(~swallowed(distance + radii[:, None] <= radii[None, :] * (1.0 + IMMERSED)))


def swallowed(inside: np.ndarray) -> np.ndarray:
    """(n,) which elements touch no liquid, from inside[i, j]: i is inside j.

    Two elements inside each other are equal: the earlier one swallows the later.
    """
    order = np.arange(len(inside))
    gone = inside & (~inside.T | (order < order[:, None]))
    np.fill_diagonal(gone, False)
    return np.any(gone, axis=1)


@dataclass(frozen=True, eq=False)
class Covering:
    """n nodes on a surface.

    Attributes:
        position: (n, 3).
        normal: (n, 3) outward unit vectors.
        area: (n,) surface that each node stands for.
        curvature: (n,) mean curvature of the surface at the node, positive where it bulges out.
        owner: (n,) element that each node lies on.
    """

    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    curvature: np.ndarray
    owner: np.ndarray


def node_counts(elements: Elements, fineness: float) -> np.ndarray:
    """(m,) nodes on the whole surface of each element when a sphere has `fineness`."""
    return np.ceil(fineness * elements.area / (4.0 * np.pi * elements.radius**2) - 1e-9).astype(int)


def cover(elements: Elements, fineness: float, frame: np.ndarray) -> Covering:
    """Cover the exposed surface of the union.

    Args:
        elements: Spheres and rods.
        fineness: Nodes on a whole sphere; the spacing is proportional to the radius of each element.
        frame: (3, 3) rows are the axes that the spirals are laid out by.
    """
    parts = [_cover_one(elements, k, n, frame) for k, n in enumerate(node_counts(elements, fineness))]
    position, normal, area = (np.concatenate([p[i] for p in parts]) for i in range(3))
    owner = np.repeat(np.arange(len(parts)), [len(p[0]) for p in parts])
    a, b, r = elements.start[owner], elements.end[owner], elements.radius[owner]
    axis = b - a
    squared = np.einsum("ni,ni->n", axis, axis)
    along = np.einsum("ni,ni->n", position - a, axis)
    straight = (along > 0.0) & (along < squared)
    return Covering(position, normal, area, np.where(straight, 0.5, 1.0) / r, owner)


def _cover_one(elements: Elements, k: int, count: int, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, normals and areas of the exposed part of element k."""
    samples = spiral(elements, k, SAMPLES * count, frame)
    shown = exposed(elements, k, samples)
    if not shown.any():
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)
    nodes = spiral(elements, k, count, frame)
    if not shown.all():
        cell = nearest_node(nodes, samples)
        part = np.bincount(cell[shown], minlength=count) / np.maximum(np.bincount(cell, minlength=count), 1)
        nodes = nodes[part >= min(LEAST_EXPOSED, 0.5 * part.max())]
    visible = samples[shown]
    for _ in range(ROUNDS):
        cell = nearest_node(nodes, visible)
        size = np.bincount(cell, minlength=len(nodes))
        taken = size > 0
        sums = np.stack([np.bincount(cell, visible[:, i], len(nodes)) for i in range(3)], axis=1)
        mean = sums[taken] / size[taken, None]
        # the mean of a cell that goes around the element is not on a side of it: such a node stays where it is
        sided = elements.distance(mean)[:, k] > 0.5 * elements.radius[k]
        nodes = _lift(elements, k, np.where(sided[:, None], mean, nodes[taken]))[0]
    size = np.bincount(nearest_node(nodes, visible), minlength=len(nodes))
    nodes, size = nodes[size > 0], size[size > 0]
    return *_lift(elements, k, nodes), size * elements.area[k] / len(samples)


def nearest_node(nodes: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Index of the node nearest to each sample; `nodes` (n, d), `samples` (k, d)."""
    if len(nodes) * len(samples) <= PAIRS:
        return np.argmax(samples @ nodes.T - 0.5 * np.einsum("ni,ni->n", nodes, nodes), axis=1)
    from scipy.spatial import KDTree

    return np.asarray(KDTree(nodes).query(samples)[1])


def exposed(elements: Elements, k: int, points: np.ndarray) -> np.ndarray:
    """Which points of element k's surface lie inside no other element."""
    inside = elements.distance(points) - elements.radius
    edge = np.where(np.arange(len(elements.radius)) < k, COINCIDENT, -COINCIDENT) * elements.radius
    buried = inside < edge
    buried[:, k] = False
    return np.logical_not(buried.any(axis=1))


def spiral(elements: Elements, k: int, count: int, frame: np.ndarray) -> np.ndarray:
    """(count, 3) points of equal area on the surface of element k: equal steps along its axis (the area between two
    planes across a sphere or a cylinder depends on their distance alone), golden angles around it."""
    radius, length = elements.radius[k], elements.length[k]
    x, y, z = frame
    if length > 0.0:
        z = (elements.end[k] - elements.start[k]) / length
        x = frame[int(np.argmin(np.abs(frame @ z)))]
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        y = np.cross(z, x)
    steps = np.arange(count) + 0.5
    along = (radius + 0.5 * length) * (1.0 - 2.0 * steps / count)
    beyond = np.maximum(np.abs(along) - 0.5 * length, 0.0)
    across = np.sqrt(np.maximum(radius**2 - beyond**2, 0.0))
    turn = GOLDEN_ANGLE * steps
    middle = 0.5 * (elements.start[k] + elements.end[k])
    plane = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y
    return middle + along[:, None] * z + across[:, None] * plane


def _lift(elements: Elements, k: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points moved onto the surface of element k along its normals, and those normals."""
    one = Elements(elements.start[k : k + 1], elements.end[k : k + 1], elements.radius[k : k + 1])
    axis = one.nearest(points)[:, 0]
    normal = points - axis
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return axis + one.radius * normal, normal
