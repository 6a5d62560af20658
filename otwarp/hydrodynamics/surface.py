"""Friction of a rigid body whose surface is covered with blobs: a boundary integral with the right self term.

A rigid body's traction f drives the flow of a single layer, u(x) = ∫ G(x − y) f(y) dS. With nodes of area h² the
integral becomes a sum over RPY blobs of radius αh, which is positive definite whatever the arrangement, but leaves an
error of order h at each node: seen along the normal, on a lattice,

    8πh δu = (4/3α + Σ' 1/r + (2α²/3) Σ' 1/r³ − ∫ …) f = −n₀ f,     n₀ = −4/3α + 3.900 − 6.02 α²,

and along the surface with t₀ = −4/3α + 5.850 + 3.01 α² (lattice sums of the square lattice, −3.900 and 9.034; those of
the triangular one, −3.921 and 8.893, are nearly the same, so the exact arrangement matters little). Adding the self
mobility (n nn + t (1 − nn))/8πh to each blob takes the error to order h². The rest depends on the curvature H of the
surface, through s = hH, and is fitted once for all such that single spheres have their Stokes friction.

Sources: rigid multiblobs, F. Balboa Usabiaga et al., Commun. Appl. Math. Comput. Sci. 11, 217 (2016),
doi:10.2140/camcos.2016.11.217; lattice sums, L. Bonsall, A. A. Maradudin, Phys. Rev. B 15, 1959 (1977),
doi:10.1103/PhysRevB.15.1959; the self terms are derived and fitted here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.hydrodynamics.covering import Covering
from otwarp.hydrodynamics.rpy import cross_matrix, translation_translation

BLOB_RADIUS = 0.45
"""α: blob radius over the square root of the node's area. Near α = 0.48 the normal self term is smallest."""

NORMAL_SELF = (-0.2777, -0.1547, 1.5516, -0.7098)
TANGENT_SELF = (3.4979, -0.0261, -0.2170, -0.0096)
"""Powers of s = hH in the self terms n and t, fitted to coverings of a sphere with 12 to 1024 nodes (largest residuals
0.002). At s = 0 the lattice sums give −0.28 and 3.50."""

MOST_CURVED = 1.1
"""Largest s of the fit."""

CLOSE, APART = 0.4, 0.7
"""Distances to the nearest other node, in units of h, between which a negative self term fades in. In a crevice nodes
of two surfaces come closer than their spacing. There the blobs alone stay positive definite, and the liquid is at rest,
so that the self term does not matter."""


@dataclass(frozen=True, eq=False)
class SurfaceFriction:
    """Friction of one covering at unit viscosity.

    Attributes:
        resistance: (6, 6) about the origin of the covering.
        force: (n, 3, 6) force of each node on the liquid for the six unit motions: G⁻¹K.
    """

    resistance: np.ndarray
    force: np.ndarray


def rigid_motion(positions: np.ndarray) -> np.ndarray:
    """(n, 3, 6) velocity of points (n, 3) for unit translations, then unit rotations about the origin."""
    out = np.zeros((len(positions), 3, 6))
    out[:, :, :3] = np.eye(3)
    out[:, :, 3:] = -cross_matrix(positions)
    return out


def surface_friction(covering: Covering) -> SurfaceFriction:
    """Solve for the forces that move the covered body rigidly.

    Dense Cholesky: 72 n² bytes, 9 n³ operations for n nodes.
    """
    from scipy.linalg import cho_solve, cholesky

    count = len(covering.area)
    motion = rigid_motion(covering.position).reshape(3 * count, 6)
    for normal_allowed in (True, False):
        mobility = node_mobility(covering, negative_self=normal_allowed)
        try:
            # symmetric: the transpose is the same matrix in the order in which LAPACK works in place
            factor = cholesky(mobility.T, lower=True, overwrite_a=True, check_finite=False)
        except np.linalg.LinAlgError:
            if normal_allowed:
                continue
            raise
        force = cho_solve((factor, True), motion, check_finite=False)
        resistance = motion.T @ force
        return SurfaceFriction(0.5 * (resistance + resistance.T), force.reshape(count, 3, 6))
    raise AssertionError("unreachable")


def node_mobility(covering: Covering, *, negative_self: bool = True) -> np.ndarray:
    """(3n, 3n) velocities of the nodes per force on the nodes at unit viscosity.

    Args:
        covering: Nodes.
        negative_self: Whether self terms may be negative; without them the matrix is positive definite for certain.
    """
    h = np.sqrt(covering.area)
    n = len(h)
    displacement = covering.position[:, None] - covering.position[None]
    distance = np.sqrt(np.einsum("ijk,ijk->ij", displacement, displacement))
    np.fill_diagonal(distance, np.inf)
    nearest = distance.min(axis=1, initial=np.inf) / h
    radius = BLOB_RADIUS * h
    # coincident nodes have no direction; a distance of a thousandth of a blob changes nothing
    distance = np.maximum(np.where(np.isfinite(distance), distance, 1.0), 1e-3 * radius.min())
    ai, aj = np.broadcast_to(radius[:, None], (n, n)), np.broadcast_to(radius[None], (n, n))
    p, q = translation_translation(distance, ai, aj)
    np.fill_diagonal(p, 1.0 / (6.0 * np.pi * radius))
    np.fill_diagonal(q, 0.0)
    q /= distance * distance
    out = np.empty((n, 3, n, 3))
    for i in range(3):
        for j in range(i + 1):
            block = q * displacement[..., i] * displacement[..., j]
            out[:, i, :, j] = out[:, j, :, i] = block + p if i == j else block
    fade = np.clip((nearest - CLOSE) / (APART - CLOSE), 0.0, 1.0) if negative_self else np.zeros(n)
    index = np.arange(n)
    out[index, :, index, :] += _self_term(covering, h, fade)
    return out.reshape(3 * n, 3 * n)


def _self_term(covering: Covering, h: np.ndarray, fade: np.ndarray) -> np.ndarray:
    """(n, 3, 3) correction of each node's own mobility; its negative part is multiplied by `fade`."""
    s = np.minimum(h * covering.curvature, MOST_CURVED)
    along = np.polynomial.polynomial.polyval(s, NORMAL_SELF)
    along = np.where(along < 0.0, fade * along, along)
    across = np.polynomial.polynomial.polyval(s, TANGENT_SELF)
    outer = covering.normal[:, :, None] * covering.normal[:, None, :]
    value = across[:, None, None] * np.eye(3) + (along - across)[:, None, None] * outer
    return value / (8.0 * np.pi * h)[:, None, None]
