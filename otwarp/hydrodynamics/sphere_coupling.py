"""How a body covered with blobs follows a background flow that is known at the centres of its spheres.

The force-free body moves with Σ_b M f_bᵀ u∞(x_b) over its blobs. Each blob goes to its own sphere (one of a rod to the
sphere nearest to it), where u∞(x_b) ≈ u_i + ω_i × (x_b − x_i). That is exact in a rigid flow, but leaves out how the
flow strains around a sphere. The smallest change of the sums that keeps rigid flows exact then makes the response to
every uniform strain that the spheres can tell apart that of the blobs, so that bodies tumble in shear as they should.
"""

from __future__ import annotations

import numpy as np

from otwarp.hydrodynamics.covering import Covering
from otwarp.hydrodynamics.rpy import cross_matrix
from otwarp.hydrodynamics.symmetry import Symmetry

BLIND = 0.05
"""Singular value, relative to the largest, below which flow at the centres does not tell a strain from a rigid motion
(for spheres on a line, all strains but those along it); correcting for it would take huge coefficients."""


def sphere_coupling(
    covering: Covering, coupling: np.ndarray, centres: np.ndarray, radii: np.ndarray, group: list[Symmetry]
) -> np.ndarray:
    """Flow coupling of the spheres.

    Args:
        covering: Blobs about the origin; the first elements are the spheres, in order.
        coupling: (6, n, 3) velocity and angular velocity, about the origin, per flow velocity at each blob.
        centres: (s, 3) centres of the spheres.
        radii: (s,) their radii.
        group: Symmetries of the body.

    Returns:
        (s, 6, 6) C_i with (U, Ω) = Σ_i C_i (u_i, ω_i), about the origin.
    """
    shares = _own_blobs(covering, coupling, centres, radii)
    shares = _correct_strain(shares, covering, coupling, centres)
    turned = [(q.wrench_map, q.image[: len(radii)]) for q in group]
    return sum((q.T @ shares[image] @ q for q, image in turned), np.zeros_like(shares)) / len(turned)


def _own_blobs(covering: Covering, coupling: np.ndarray, centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    count = len(radii)
    nearest = np.argmin(np.linalg.norm(covering.position[:, None] - centres, axis=-1) - radii, axis=1)
    owner = np.where(covering.owner < count, covering.owner, nearest)
    turning = -np.einsum("abi,bij->baj", coupling, cross_matrix(covering.position - centres[owner]))
    per_blob = np.concatenate([coupling.transpose(1, 0, 2), turning], axis=2)
    out = np.zeros((count, 6, 6))
    np.add.at(out, owner, per_blob)
    return out


def _correct_strain(shares: np.ndarray, covering: Covering, coupling: np.ndarray, centres: np.ndarray) -> np.ndarray:
    count = len(centres)
    size = float(np.linalg.norm(centres, axis=1).max())
    if size == 0.0:
        return shares
    strains = np.array(
        [_strain(*pair) for pair in ((0, 1), (0, 2), (1, 2))] + [np.diag([1, -1, 0]), np.diag([1, 1, -2])]
    )
    wanted = np.einsum("abi,sij,bj->as", coupling, strains, covering.position)
    # per sphere (u, size·ω), so that both are velocities
    flat = (shares * np.repeat([1.0, 1.0 / size], 3)).transpose(1, 0, 2).reshape(6, 6 * count)
    seen = np.zeros((count, 6, 5))
    seen[:, :3] = np.einsum("sij,nj->nis", strains, centres)
    rigid = np.zeros((count, 6, 6))
    rigid[:, :3, :3] = rigid[:, 3:, 3:] = np.eye(3)
    rigid[:, :3, 3:] = -cross_matrix(centres)
    rigid[:, 3:] *= size
    seen, rigid = seen.reshape(-1, 5), rigid.reshape(-1, 6)
    basis = np.linalg.qr(rigid)[0]
    free = seen - basis @ (basis.T @ seen)
    flat = flat + (wanted - flat @ seen) @ np.linalg.pinv(free, rcond=BLIND)
    return flat.reshape(6, count, 6).transpose(1, 0, 2) * np.repeat([1.0, size], 3)


def _strain(i: int, j: int) -> np.ndarray:
    out = np.zeros((3, 3))
    out[i, j] = out[j, i] = 1.0
    return out
