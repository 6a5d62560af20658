"""The mobility of one rigid body, and how 6×6 mobilities change with the point they are about.

All matrices are geometric (unit viscosity), in the order (force, torque) → (velocity, angular velocity).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.hydrodynamics.rpy import cross_matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyMobility:
    """Geometric mobility (unit viscosity) of a rigid body, in the axes of its prim. The arrays are read-only.

    Attributes:
        reference: (3,) centre of diffusion from the prim's origin [µm].
        mobility: (6, 6) about the reference, symmetric positive definite [1/µm, 1/µm², 1/µm³].
        resistance: (6, 6) inverse of `mobility` [µm, µm², µm³].
        cholesky: (6, 6) lower triangle L with L Lᵀ = `mobility`.
        flow_coupling: (n, 6, 6) C_i: (velocity at the reference, angular velocity) = Σ_i C_i (u∞(x_i), ω∞(x_i)), in
            the order of the spheres; zero for a sphere inside another [1, µm, 1/µm].
        error: Estimated error, relative to the diagonal; 0 for one sphere, NaN where nothing estimates it (RPY tensors
            of several spheres, a given mobility).
        blobs: Number of surface blobs of the finest level that it comes from, 0 for none.
    """

    reference: np.ndarray
    mobility: np.ndarray
    resistance: np.ndarray
    cholesky: np.ndarray
    flow_coupling: np.ndarray
    error: float = float("nan")
    blobs: int = 0

    def __post_init__(self) -> None:
        for name in ("reference", "mobility", "resistance", "cholesky", "flow_coupling"):
            getattr(self, name).setflags(write=False)


def assemble(
    reference: np.ndarray,
    mobility: np.ndarray,
    coupling: np.ndarray,
    *,
    error: float = float("nan"),
    blobs: int = 0,
) -> BodyMobility:
    """`BodyMobility` from its independent parts, see there: inverse and Cholesky factor follow."""
    return BodyMobility(
        reference=reference,
        mobility=mobility,
        resistance=inverse(mobility),
        cholesky=np.linalg.cholesky(mobility),
        flow_coupling=coupling,
        error=error,
        blobs=blobs,
    )


def about_centre_of_diffusion(mobility: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre of diffusion from the point that `mobility` is about, and the mobility about it.

    About a point ρ the coupling b (force → angular velocity) becomes b + c[ρ]×, with c the rotation block; it is
    symmetric where (tr(c) I − c) ρ = −vec(b − bᵀ).

    Source: S. C. Harvey, J. García de la Torre, Macromolecules 13, 960 (1980), doi:10.1021/ma60076a037.
    """
    b, c = mobility[3:, :3], mobility[3:, 3:]
    skew = b - b.T
    axial = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    offset = -np.linalg.solve(np.trace(c) * np.eye(3) - c, axial)
    moved = shift(-offset)
    return offset, symmetric(moved @ mobility @ moved.T)


def shift(lever: np.ndarray) -> np.ndarray:
    """(6, 6) matrix that turns (U, Ω) at a point P into the motion at P − `lever`: U + lever × Ω."""
    out = np.eye(6)
    out[:3, 3:] = cross_matrix(lever)
    return out


def symmetric(matrix: np.ndarray) -> np.ndarray:
    """The symmetric part of a square matrix."""
    return 0.5 * (matrix + matrix.T)


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric positive definite matrix of mixed dimensions, scaled to unit diagonal first."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    return symmetric(np.linalg.inv(matrix * scale[:, None] * scale[None, :]) * scale[:, None] * scale[None, :])


def relative_change(new: np.ndarray, old: np.ndarray) -> float:
    """Largest difference of two mobilities, each element relative to the diagonal elements of its row and column."""
    scale = 1.0 / np.sqrt(np.diag(new))
    return float(np.max(np.abs(new - old) * scale[:, None] * scale[None, :]))
