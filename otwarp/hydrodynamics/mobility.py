"""Mobility of a rigid assembly of spheres: 6×6 about its centre of diffusion, and how it follows a background flow.

All matrices are geometric (unit viscosity), in the axes of the body's prim, in the order (force, torque) →
(velocity, angular velocity). Divide mobilities by, and multiply resistances with, the viscosity of the medium.

With the grand resistance 𝓡 = μ⁻¹ of the free spheres and the rigid motion K (v_i = U + Ω × r_i, ω_i = Ω), the body
has the resistance R = Kᵀ𝓡K, the mobility M = R⁻¹, and in a background flow moves with Σ_i C_i (u∞(x_i), ω∞(x_i)),
where C = M Kᵀ 𝓡: the motion for which the total hydrodynamic force and torque vanish.

Sources: H. Brenner, J. Colloid Interface Sci. 23, 407 (1967); S. C. Harvey, J. García de la Torre, Macromolecules 13,
960 (1980), doi:10.1021/ma60076a037.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from otwarp.errors import InputError
from otwarp.hydrodynamics.rpy import cross_matrix, grand_mobility

IMMERSION_TOLERANCE = 1e-12
"""Relative overhang below which a sphere counts as inside another: rounding of authored coordinates."""

NULL_EIGENVALUE = 1e-11
"""Smallest eigenvalue kept of the grand mobility scaled to unit diagonal. Directions below it are relative motions of
nearly coincident spheres; a rigid motion excites them in proportion to their distance, as is the eigenvalue, so the
resistance they would add is of this relative order."""

SYMMETRY_TOLERANCE = 1e-6
"""Asymmetry of an authored mobility that is taken for rounding, relative to its diagonal."""


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
    """

    reference: np.ndarray
    mobility: np.ndarray
    resistance: np.ndarray
    cholesky: np.ndarray
    flow_coupling: np.ndarray

    def __post_init__(self) -> None:
        for name in ("reference", "mobility", "resistance", "cholesky", "flow_coupling"):
            getattr(self, name).setflags(write=False)


def body_mobility(centres: np.ndarray, radii: np.ndarray) -> BodyMobility:
    """Mobility of spheres held rigidly together. Equal arguments are evaluated once and share the result.

    One sphere is exact: 1/6πa and 1/8πa³. Spheres inside another one touch no liquid and are left out. (A pair of
    which one is inside the other moves like the outer one anyway; next to a third sphere the RPY tensors would give
    the inner one a small spurious force, because they resolve no strain inside a sphere.)

    Args:
        centres: (n, 3) sphere centres in the prim's frame [µm].
        radii: (n,) µm.

    Raises:
        InputError: No sphere, shapes that do not match, a centre that is not finite or a radius that is not positive.

    Source: Zuk et al. 2014, doi:10.1017/jfm.2013.668; Harvey & García de la Torre 1980, doi:10.1021/ma60076a037.
    """
    centres, radii = _checked(centres, radii)
    return _evaluate(centres.tobytes(), radii.tobytes())


def body_mobilities(bodies: Iterable[tuple[np.ndarray, np.ndarray]]) -> list[BodyMobility]:
    """`body_mobility` of each (centres, radii); equal bodies share one evaluation and one result."""
    return [body_mobility(centres, radii) for centres, radii in bodies]


def from_override(
    mobility: Sequence[float] | np.ndarray,
    centres: np.ndarray,
    radii: np.ndarray | None = None,
    *,
    where: str = "argument mobility",
) -> BodyMobility:
    """Body with a given mobility; its spheres only say how it follows a background flow.

    Args:
        mobility: 36 numbers, row by row, about the prim's origin in the prim's axes at unit viscosity
            [1/µm, 1/µm², 1/µm³], order (force, torque) → (velocity, angular velocity).
        centres: (n, 3) sphere centres in the prim's frame [µm].
        radii: (n,) µm; None takes equal spheres that touch where they are closest.
        where: What the error message names, for instance the file, prim and attribute.

    Raises:
        InputError: Not 36 finite numbers, not symmetric, or not positive definite.
    """
    values = np.asarray(mobility, dtype=float)
    if values.size != 36 or not np.all(np.isfinite(values)):
        raise InputError(f"{where}: {values.size} values, not 36 finite numbers; allowed: 36 finite numbers")
    about_origin = values.reshape(6, 6)
    diagonal = np.diag(about_origin)
    if np.any(diagonal <= 0.0):
        k = int(np.argmin(diagonal))
        raise InputError(f"{where}: diagonal element {k + 1} of 6 is {diagonal[k]:g}; allowed: (0, inf)")
    scale = 1.0 / np.sqrt(diagonal)
    scaled = about_origin * scale[:, None] * scale[None, :]
    asymmetry = float(np.max(np.abs(scaled - scaled.T)))
    if asymmetry > SYMMETRY_TOLERANCE:
        row, column = np.unravel_index(int(np.argmax(np.abs(scaled - scaled.T))), (6, 6))
        raise InputError(
            f"{where}: not symmetric, elements ({row + 1}, {column + 1}) = {about_origin[row, column]:g} and "
            f"({column + 1}, {row + 1}) = {about_origin[column, row]:g}; allowed: a symmetric positive definite matrix"
        )
    eigenvalues = np.linalg.eigvalsh(_symmetric(scaled))
    if eigenvalues[0] <= NULL_EIGENVALUE:
        raise InputError(
            f"{where}: not positive definite, smallest of 6 eigenvalues is {eigenvalues[0]:.3g} (scaled to unit "
            f"diagonal); allowed: all eigenvalues above {NULL_EIGENVALUE:g}"
        )
    if radii is None:
        radii = _touching_radii(np.asarray(centres, dtype=float).reshape(-1, 3))
    spheres = body_mobility(centres, radii)
    reference, about_reference = _about_centre_of_diffusion(_symmetric(about_origin))
    # Seen from another point of the same rigid motion: U' = U + Ω × (reference' − reference).
    coupling = _shift(spheres.reference - reference) @ spheres.flow_coupling
    return _assemble(reference, about_reference, coupling)


def _checked(centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    centres, radii = np.array(centres, dtype=float), np.array(radii, dtype=float)
    if radii.ndim != 1 or len(radii) == 0:
        raise InputError(f"argument radii: shape {radii.shape}; allowed: (n,) with n at least 1")
    if centres.shape != (len(radii), 3):
        raise InputError(f"argument centres: shape {centres.shape}; allowed: ({len(radii)}, 3), one per radius")
    if not np.all(np.isfinite(centres)):
        k = int(np.argmin(np.all(np.isfinite(centres), axis=1)))
        raise InputError(f"argument centres: sphere {k} at {centres[k].tolist()}; allowed: finite numbers")
    good = np.isfinite(radii) & (radii > 0.0)
    if not np.all(good):
        k = int(np.argmin(good))
        raise InputError(f"argument radii: sphere {k} has radius {radii[k]:g}; allowed: (0, inf)")
    return centres + 0.0, radii  # + 0.0 turns −0 into 0, so that equal bodies have equal bytes.


@lru_cache(maxsize=4096)
def _evaluate(centres_bytes: bytes, radii_bytes: bytes) -> BodyMobility:
    radii = np.frombuffer(radii_bytes)
    centres = np.frombuffer(centres_bytes).reshape(-1, 3)
    kept = outermost_spheres(centres, radii)
    coupling = np.zeros((len(radii), 6, 6))
    if len(kept) == 1:
        a = radii[kept[0]]
        coupling[kept[0]] = np.eye(6)
        mobility = np.diag([1.0 / (6.0 * np.pi * a)] * 3 + [1.0 / (8.0 * np.pi * a**3)] * 3)
        return _assemble(centres[kept[0]].copy(), mobility, coupling)
    # About the mean centre, so that a body far from its prim's origin loses no digits.
    middle = centres[kept].mean(axis=0)
    constrained, motion = _constrained_resistance(centres[kept] - middle, radii[kept])
    resistance = _symmetric(motion.T @ constrained)
    about_middle = _inverse(resistance)
    offset, mobility = _about_centre_of_diffusion(about_middle)
    per_sphere = _shift(-offset) @ about_middle @ constrained.T
    coupling[kept] = per_sphere.reshape(6, len(kept), 6).transpose(1, 0, 2)
    return _assemble(middle + offset, mobility, coupling)


def outermost_spheres(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Indices of the spheres that are not inside another one; of coincident equal spheres the first stays."""
    distance = np.linalg.norm(centres[:, None, :] - centres[None, :, :], axis=-1)
    inside = distance + radii[:, None] <= radii[None, :] * (1.0 + IMMERSION_TOLERANCE)  # [i, j]: i is inside j
    # Two spheres inside each other are equal: the earlier one swallows the later.
    earlier = np.arange(len(radii))[None, :] < np.arange(len(radii))[:, None]
    swallowed = inside & (~inside.T | earlier)
    np.fill_diagonal(swallowed, False)
    return np.flatnonzero(~swallowed.any(axis=1))


def _constrained_resistance(centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(𝓡K, K), each (6n, 6), about the origin of `centres`.

    The grand mobility is scaled to unit diagonal, so that the spread of radii and the two kinds of coordinate do not
    spoil its condition, and inverted through its eigenvectors with the null directions left out.
    """
    motion = np.zeros((len(radii), 6, 6))
    motion[:, :3, :3] = motion[:, 3:, 3:] = np.eye(3)
    motion[:, :3, 3:] = -cross_matrix(centres)
    motion = motion.reshape(-1, 6)
    mu = grand_mobility(centres, radii)
    scale = 1.0 / np.sqrt(np.diag(mu))
    eigenvalues, vectors = np.linalg.eigh(mu * scale[:, None] * scale[None, :])
    kept = eigenvalues > NULL_EIGENVALUE
    projected = vectors[:, kept].T @ (scale[:, None] * motion)
    return scale[:, None] * (vectors[:, kept] @ (projected / eigenvalues[kept, None])), motion


def _about_centre_of_diffusion(mobility: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre of diffusion from the point that `mobility` is about, and the mobility about it.

    About a point ρ the coupling b (force → angular velocity) becomes b + c[ρ]×, with c the rotation block; it is
    symmetric where (tr(c) I − c) ρ = −vec(b − bᵀ).
    """
    b, c = mobility[3:, :3], mobility[3:, 3:]
    skew = b - b.T
    axial = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    offset = -np.linalg.solve(np.trace(c) * np.eye(3) - c, axial)
    shift = _shift(-offset)
    return offset, _symmetric(shift @ mobility @ shift.T)


def _shift(lever: np.ndarray) -> np.ndarray:
    """(6, 6) matrix that turns (U, Ω) at a point P into the motion at P − `lever`: U + lever × Ω."""
    out = np.eye(6)
    out[:3, 3:] = cross_matrix(lever)
    return out


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric positive definite matrix of mixed dimensions, scaled to unit diagonal first."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    return _symmetric(np.linalg.inv(matrix * scale[:, None] * scale[None, :]) * scale[:, None] * scale[None, :])


def _assemble(reference: np.ndarray, mobility: np.ndarray, coupling: np.ndarray) -> BodyMobility:
    return BodyMobility(
        reference=reference,
        mobility=mobility,
        resistance=_inverse(mobility),
        cholesky=np.linalg.cholesky(mobility),
        flow_coupling=coupling,
    )


def _touching_radii(centres: np.ndarray) -> np.ndarray:
    distance = np.linalg.norm(centres[:, None, :] - centres[None, :, :], axis=-1)
    apart = distance[distance > 0.0]
    return np.full(len(centres), 0.5 * apart.min() if apart.size else 1.0)
