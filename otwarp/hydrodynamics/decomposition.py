"""A closed mesh as a union of spheres, for optical forces sphere by sphere (MSDM).

Balls inscribed in the solid about the middles of a grid's cells, those of the medial axis, are chosen one by one, each
the one that fills most of what is left. Then centres and radii are moved together such that the union covers the cells
of the solid and no others, and at last all radii are changed by one amount, so that the volume is that of the mesh.

Sources: greedy covers, V. Chvátal, Math. Oper. Res. 4, 233 (1979), doi:10.1287/moor.4.3.233; unions of medial balls,
N. Amenta, S. Choi, R. K. Kolluri, Comput. Geom. 19, 127 (2001), doi:10.1016/S0925-7721(01)00017-7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.hydrodynamics.covering import Elements, exposed, outermost_spheres, spiral
from otwarp.hydrodynamics.mesh_surface import mesh_mobility
from otwarp.hydrodynamics.mobility import body_mobility
from otwarp.hydrodynamics.rigid import BodyMobility, relative_change, shift
from otwarp.hydrodynamics.solid import ClosedMesh, Solid, closed_mesh, solid_of

CELLS = 6000
"""Cells of the grid that are inside the mesh."""

SURFACE = 2000
"""Points on each sphere for the volume of their union."""

MOST_SPHERES = 128
"""Largest number of spheres; their fit takes some ten seconds."""

MOBILITY_ACCURACY = 0.01
"""Of the two mobilities that are compared."""

SOFTNESS = (1.0, 0.3)
"""Width of the smeared surface in each round of the fit, in cells."""

ITERATIONS = 60
"""Of the minimiser in each round."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Decomposition:
    """Spheres that stand for a mesh.

    Attributes:
        centres: (n, 3) µm, in the frame of the mesh.
        radii: (n,) µm.
        volume: Volume of the mesh [µm³].
        volume_error: Volume that is in the mesh or in the spheres but not in both, over the volume of the mesh.
        excess: Volume of the union of the spheres over that of the mesh, minus 1.
        mobility: Of the spheres, to 1 %.
        mesh_mobility: Of the mesh itself, to 1 %.
        mobility_error: Largest difference of the two about the origin, relative to the diagonal.
    """

    centres: np.ndarray
    radii: np.ndarray
    volume: float
    volume_error: float
    excess: float
    mobility: BodyMobility
    mesh_mobility: BodyMobility
    mobility_error: float


def decompose(
    mesh: Any, *, spheres: int | None = None, volume_error: float | None = None, metres_per_unit: float = 1e-6
) -> Decomposition:
    """Spheres that stand for a closed mesh.

    Args:
        mesh: File that trimesh reads, a `trimesh.Trimesh`, or (vertices, triangles).
        spheres: How many at most (what the grid does not resolve is left out); or
        volume_error: how much of the volume may be in the wrong place, in (0, 1): as many spheres as that takes. With
            neither, 0.1.
        metres_per_unit: Length of a unit of the mesh [m]: 1e-6 for µm, 1e-3 for mm.

    Raises:
        InputError: A mesh that cannot be read, is not closed, too small or too large, both wishes at once, one out of
            range, or more than `MOST_SPHERES` spheres needed.
    """
    if spheres is not None and volume_error is not None:
        raise InputError(f"argument spheres = {spheres}: must be left out beside a wanted volume error")
    if spheres is not None and not 1 <= spheres <= MOST_SPHERES:
        raise InputError(f"argument spheres = {spheres}: must be a whole number in [1, {MOST_SPHERES}]")
    wanted = 0.1 if volume_error is None else volume_error
    if not 0.0 < wanted < 1.0:
        raise InputError(f"argument volume_error = {wanted:g}: must be in (0, 1)")
    surface = closed_mesh(mesh, metres_per_unit)
    solid = solid_of(surface, CELLS)
    first, size = _greedy_cover(solid, spheres or MOST_SPHERES)
    best = None
    for count in [spheres] if spheres is not None else _counts(len(size)):
        centres, radii = _matched_volume(surface, *_fit(solid, first[:count], size[:count]))
        error = _misplaced(surface, solid, centres, radii)
        if best is None or error < best[0]:
            best = (error, centres, radii)
        if spheres is None and error <= wanted:
            break
    else:
        if spheres is None and best is not None:
            least = f"[{best[0]:.2g}, 1) for this mesh"
            text = f"argument volume_error = {wanted:g}: {MOST_SPHERES} spheres are not enough; allowed: {least}"
            raise InputError(text)
    assert best is not None
    return _report(surface, best[1], best[2], best[0])


def _counts(most: int) -> list[int]:
    """Numbers of spheres to try: every one at first, then steps of a fifth."""
    counts = [1]
    while counts[-1] < most:
        counts.append(min(max(counts[-1] + 1, round(1.2 * counts[-1])), most))
    return counts


def _report(surface: ClosedMesh, centres: np.ndarray, radii: np.ndarray, error: float) -> Decomposition:
    body = body_mobility(centres, radii, accuracy=MOBILITY_ACCURACY)
    exact = mesh_mobility(surface.vertices, surface.triangles, MOBILITY_ACCURACY)
    move = shift(body.reference - exact.reference)
    return Decomposition(
        centres=centres,
        radii=radii,
        volume=surface.volume,
        volume_error=error,
        excess=union_volume(centres, radii) / surface.volume - 1.0,
        mobility=body,
        mesh_mobility=exact,
        mobility_error=relative_change(exact.mobility, move @ body.mobility @ move.T),
    )


def _greedy_cover(solid: Solid, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii of inscribed balls, each the one that fills most of what those before it leave."""
    from scipy.spatial import KDTree

    inside = solid.depth > 0.0
    place, depth = solid.place[inside], solid.depth[inside]
    pairs = KDTree(place).query_pairs(1.8 * solid.cell, output_type="ndarray")
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    step = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
    # a ball is not on the medial axis when a neighbour's reaches all but a tenth of a step around it
    swallowed = depth[pairs[:, 1]] - depth[pairs[:, 0]] >= 0.9 * step
    medial = np.ones(len(depth), dtype=bool)
    medial[pairs[swallowed, 0]] = False
    centre, radius = place[medial], depth[medial]
    covers = _distance(centre, place) <= radius[:, None] + 0.5 * solid.cell
    weights, left = covers.astype(np.float32), np.ones(len(place), dtype=np.float32)
    chosen = []
    for _ in range(min(count, len(centre))):
        chosen.append(int(np.argmax(weights @ left)))
        left[covers[chosen[-1]]] = 0.0
    return centre[chosen], radius[chosen]


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n, m) distances of points (n, 3) and (m, 3)."""
    squared = np.einsum("ni,ni->n", a, a)[:, None] - 2.0 * (a @ b.T) + np.einsum("mi,mi->m", b, b)
    return np.sqrt(np.maximum(squared, 0.0))


def _union_depth(place: np.ndarray, centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depth of points below the nearest surface of the union, positive inside, and the sphere that it is of."""
    depth = radii - _distance(place, centres)
    sphere = np.argmax(depth, axis=1)
    return depth[np.arange(len(place)), sphere], sphere


def _fit(solid: Solid, centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move and resize the spheres until their union fills the cells as the solid does.

    Least squares of the filling, with a surface that is smeared at first. Spheres that end inside others, or smaller
    than a cell, are left out.
    """
    from scipy.optimize import minimize

    count = len(radii)
    middle = solid.place.mean(axis=0)
    place = solid.place - middle

    def misfit(flat: np.ndarray, width: float) -> tuple[float, np.ndarray]:
        """Sum over cells of the squared misplaced filling, surfaces blurred to `width`, and its gradient."""
        c, r = flat[: 3 * count].reshape(-1, 3), flat[3 * count :]
        depth, sphere = _union_depth(place, c, r)
        fill = 0.5 + 0.5 * np.tanh(0.5 * depth / width)
        off = fill - solid.fill
        slope = 2.0 * off * fill * (1.0 - fill) / width
        away = place - c[sphere]
        away = slope[:, None] * away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12)
        moved = np.stack([np.bincount(sphere, away[:, i], count) for i in range(3)], axis=1)
        return float(off @ off), np.concatenate([moved.ravel(), np.bincount(sphere, slope, count)])

    flat = np.concatenate([(centres - middle).ravel(), radii])
    largest = 2.0 * float(solid.depth.max())  # beyond, a sphere would leave the cells that are looked at
    bounds = [(None, None)] * (3 * count) + [(0.0, largest)] * count
    for softness in SOFTNESS:
        width = softness * solid.cell
        options = {"maxiter": ITERATIONS}
        flat = minimize(misfit, flat, (width,), jac=True, method="L-BFGS-B", bounds=bounds, options=options).x
    centres, radii = flat[: 3 * count].reshape(-1, 3) + middle, flat[3 * count :]
    kept = outermost_spheres(centres, radii)
    kept = kept[radii[kept] >= min(solid.cell, radii.max())]
    return centres[kept], radii[kept]


def union_volume(centres: np.ndarray, radii: np.ndarray) -> float:
    """Volume of a union of spheres, ∮ x·n dS/3 over `SURFACE` points on each [µm³]; good to about 1e-3."""
    spheres = Elements(centres, centres, radii)
    total = 0.0
    for k, radius in enumerate(radii):
        point = spiral(spheres, k, SURFACE, np.eye(3))
        shown = point[exposed(spheres, k, point)]
        outward = np.einsum("ki,ki->k", shown - centres.mean(axis=0), shown - centres[k])
        total += 4.0 / 3.0 * np.pi * radius * float(outward.sum()) / SURFACE
    return total


def _matched_volume(surface: ClosedMesh, centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All radii changed by one amount such that the union has the volume of the mesh."""
    from scipy.optimize import brentq

    def grown(change: float) -> tuple[np.ndarray, np.ndarray]:
        kept = radii + change > 0.0
        return centres[kept], radii[kept] + change

    reach = float(radii.max())
    while union_volume(*grown(reach)) < surface.volume:
        reach *= 2.0
    low = -float(radii.max()) * (1.0 - 1e-6)
    change = brentq(lambda x: union_volume(*grown(x)) - surface.volume, low, reach, xtol=1e-5 * reach)
    return grown(float(change))  # type: ignore[arg-type]


def _misplaced(surface: ClosedMesh, solid: Solid, centres: np.ndarray, radii: np.ndarray) -> float:
    """Volume in the mesh or in the union but not in both, over the volume of the mesh."""
    fill = np.clip(0.5 + _union_depth(solid.place, centres, radii)[0] / solid.cell, 0.0, 1.0)
    shared = float(np.minimum(fill, solid.fill).sum() / solid.fill.sum())
    return 1.0 + union_volume(centres, radii) / surface.volume - 2.0 * shared
