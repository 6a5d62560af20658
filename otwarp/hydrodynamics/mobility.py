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

from collections.abc import Sequence
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from otwarp.errors import InputError
from otwarp.hydrodynamics.covering import outermost_spheres
from otwarp.hydrodynamics.rigid import BodyMobility, about_centre_of_diffusion, assemble, inverse, shift, symmetric
from otwarp.hydrodynamics.rpy import cross_matrix, grand_mobility

Rods = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Ends (m, 3), (m, 3) and radii (m,) of rods [µm]."""

LARGEST_ERROR = 0.5
"""Largest accuracy that may be asked for."""

NULL_EIGENVALUE = 1e-11
"""Smallest eigenvalue kept of the grand mobility scaled to unit diagonal. Directions below it are relative motions of
nearly coincident spheres; a rigid motion excites them in proportion to their distance, as is the eigenvalue, so the
resistance they would add is of this relative order."""

SYMMETRY_TOLERANCE = 1e-6
"""Asymmetry of an authored mobility that is taken for rounding, relative to its diagonal."""


def body_mobility(
    centres: np.ndarray,
    radii: np.ndarray,
    *,
    rods: Rods | None = None,
    accuracy: float = 0.0,
    cache: bool | Path = True,
    where: str = "argument accuracy",
) -> BodyMobility:
    """Mobility of spheres, and rods, held rigidly together. Equal arguments are evaluated once and share the result.

    One sphere is exact: 1/6πa and 1/8πa³. Without a wanted accuracy the RPY tensors of the spheres are used as they
    are: up to 5 % off for spheres that touch, and without rods. With one, the surface is covered with blobs, as finely
    as it takes.

    Spheres inside another one touch no liquid and are left out. (A pair of which one is inside the other moves like the
    outer one anyway; next to a third sphere the RPY tensors would give the inner one a small spurious force, because
    they resolve no strain inside a sphere.)

    Args:
        centres: (n, 3) sphere centres in the prim's frame [µm].
        radii: (n,) µm.
        rods: Ends (m, 3), (m, 3) and radii (m,) of the rods, which are rounded at their ends [µm].
        accuracy: Wanted relative error of the mobility, 0 or in (0, 0.5].
        cache: Whether blobs are looked up on disk first and kept there, or in which folder.
        where: What error messages call the accuracy, for instance by file, prim and attribute.

    Raises:
        InputError: No sphere, shapes that do not match, a value that is not finite, a radius that is not positive, an
            accuracy out of range or out of reach.

    Source: Zuk et al. 2014, doi:10.1017/jfm.2013.668; Harvey & García de la Torre 1980, doi:10.1021/ma60076a037.
    """
    centres, radii = _checked(centres, radii)
    if not (accuracy == 0.0 or 0.0 < accuracy <= LARGEST_ERROR):
        raise InputError(f"{where} = {accuracy:g}: must be 0 or in (0, {LARGEST_ERROR:g}]")
    starts, ends, widths = _checked_rods(rods)
    lone = len(widths) == 0 and (len(radii) == 1 or len(outermost_spheres(centres, radii)) == 1)
    if accuracy == 0.0 or lone:
        return _evaluate(centres.tobytes(), radii.tobytes())
    key = tuple(a.tobytes() for a in (centres, radii, starts, ends, widths))
    try:
        return _refined(key, float(accuracy), cache)
    except InputError as error:
        raise InputError(f"{where} = {accuracy:g}: {error}") from None


@lru_cache(maxsize=1024)
def _refined(key: tuple[bytes, ...], accuracy: float, cache: bool | Path) -> BodyMobility:
    from otwarp.hydrodynamics.blobs import assembly_mobility
    from otwarp.hydrodynamics.mobility_cache import cached

    flat = [np.frombuffer(b) for b in key]
    centres, starts, ends = (flat[i].reshape(-1, 3) for i in (0, 2, 3))
    geometry = centres, flat[1], (starts, ends, flat[4]), accuracy
    return cached(cache, *geometry, partial(assembly_mobility, *geometry))


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
    eigenvalues = np.linalg.eigvalsh(symmetric(scaled))
    if eigenvalues[0] <= NULL_EIGENVALUE:
        raise InputError(
            f"{where}: not positive definite, smallest of 6 eigenvalues is {eigenvalues[0]:.3g} (scaled to unit "
            f"diagonal); allowed: all eigenvalues above {NULL_EIGENVALUE:g}"
        )
    if radii is None:
        radii = _touching_radii(np.asarray(centres, dtype=float).reshape(-1, 3))
    spheres = body_mobility(centres, radii)
    reference, about_reference = about_centre_of_diffusion(symmetric(about_origin))
    # Seen from another point of the same rigid motion: U' = U + Ω × (reference' − reference).
    coupling = shift(spheres.reference - reference) @ spheres.flow_coupling
    return assemble(reference, about_reference, coupling)


def _checked(centres: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    centres, radii = np.array(centres, dtype=float), np.array(radii, dtype=float)
    if radii.ndim != 1 or len(radii) == 0:
        raise InputError(f"argument radii: shape {radii.shape}; allowed: (n,) with n at least 1")
    if centres.shape != (len(radii), 3):
        raise InputError(f"argument centres: shape {centres.shape}; allowed: ({len(radii)}, 3), one per radius")
    if not np.all(np.isfinite(centres)):
        k = int(np.argmin(np.all(np.isfinite(centres), axis=1)))
        raise InputError(f"argument centres: sphere {k} at {centres[k].tolist()}; allowed: finite numbers")
    _check_radii(radii, "radii: sphere")
    return centres + 0.0, radii  # + 0.0 turns −0 into 0, so that equal bodies have equal bytes.


def _checked_rods(rods: Rods | None) -> Rods:
    if rods is None:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)
    starts, ends, radii = (np.array(part, dtype=float) for part in rods)
    shapes = (starts.shape, ends.shape, radii.shape)
    if radii.ndim != 1 or starts.shape != (len(radii), 3) or ends.shape != starts.shape:
        raise InputError(f"argument rods: shapes {shapes}; allowed: (m, 3), (m, 3) and (m,)")
    if not (np.all(np.isfinite(starts)) and np.all(np.isfinite(ends))):
        raise InputError("argument rods: an end that is not finite; allowed: finite numbers")
    _check_radii(radii, "rods: rod")
    return starts + 0.0, ends + 0.0, radii


def _check_radii(radii: np.ndarray, what: str) -> None:
    good = np.isfinite(radii) & (radii > 0.0)
    if not np.all(good):
        k = int(np.argmin(good))
        raise InputError(f"argument {what} {k} has radius {radii[k]:g}; allowed: (0, inf)")


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
        return assemble(centres[kept[0]].copy(), mobility, coupling, error=0.0)
    # About the mean centre, so that a body far from its prim's origin loses no digits.
    middle = centres[kept].mean(axis=0)
    constrained, motion = _constrained_resistance(centres[kept] - middle, radii[kept])
    resistance = symmetric(motion.T @ constrained)
    about_middle = inverse(resistance)
    offset, mobility = about_centre_of_diffusion(about_middle)
    per_sphere = shift(-offset) @ about_middle @ constrained.T
    coupling[kept] = per_sphere.reshape(6, len(kept), 6).transpose(1, 0, 2)
    return assemble(middle + offset, mobility, coupling)


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


def _touching_radii(centres: np.ndarray) -> np.ndarray:
    distance = np.linalg.norm(centres[:, None, :] - centres[None, :, :], axis=-1)
    apart = distance[distance > 0.0]
    return np.full(len(centres), 0.5 * apart.min() if apart.size else 1.0)
