"""Generalised Rotne–Prager–Yamakawa mobility of unequal, possibly overlapping spheres, at unit viscosity.

Each pair tensor is a scalar function of the distance times I, r̂r̂ or the cross product with r̂, in three ranges:
apart (r > a_i + a_j), overlapping, and one sphere inside the other (r ≤ |a_i − a_j|). The tensors are continuous
from range to range and the grand mobility is positive definite for any arrangement of distinct spheres.

Sources: P. J. Zuk, E. Wajnryb, K. A. Mizerski, P. Szymczak, J. Fluid Mech. 741, R5 (2014), doi:10.1017/jfm.2013.668;
E. Wajnryb, K. A. Mizerski, P. J. Zuk, P. Szymczak, J. Fluid Mech. 731, R3 (2013), doi:10.1017/jfm.2013.402.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

CONCENTRIC = 1e-12
"""Distance, relative to the sum of the radii, below which two spheres count as concentric; the change is as small."""


def _by_range(r: Array, ai: Array, aj: Array, apart: Array, overlapping: Array, inside: Array) -> Array:
    return np.where(r > ai + aj, apart, np.where(r > np.abs(ai - aj), overlapping, inside))


def translation_translation(r: Array, ai: Array, aj: Array) -> tuple[Array, Array]:
    """Velocity of sphere i per force on sphere j: μ = p I + q r̂r̂.

    apart:        p = (1 + (a_i² + a_j²)/3r²)/8πr,  q = (1 − (a_i² + a_j²)/r²)/8πr
    overlapping:  p = (16r³(a_i + a_j) − ((a_i − a_j)² + 3r²)²)/(192π a_i a_j r³),
                  q = 3((a_i − a_j)² − r²)²/(192π a_i a_j r³)
    inside:       p = 1/6π max(a_i, a_j),  q = 0

    Args:
        r: Distances of the centres, > 0 where the spheres are not one inside the other [µm].
        ai: Radii of the moving spheres, same shape [µm].
        aj: Radii of the forced spheres, same shape [µm].

    Returns:
        (p, q) [1/µm], the shape of `r`.
    """
    r2, r3 = r * r, r**3
    squares, difference2 = ai**2 + aj**2, (ai - aj) ** 2
    far, near = 1.0 / (8.0 * np.pi * r), 1.0 / (192.0 * np.pi * ai * aj * r3)
    p = _by_range(
        *(r, ai, aj),
        far * (1.0 + squares / (3.0 * r2)),
        near * (16.0 * r3 * (ai + aj) - (difference2 + 3.0 * r2) ** 2),
        1.0 / (6.0 * np.pi * np.maximum(ai, aj)),
    )
    q = _by_range(r, ai, aj, far * (1.0 - squares / r2), near * 3.0 * (difference2 - r2) ** 2, np.zeros_like(r))
    return p, q


def rotation_translation(r: Array, ai: Array, aj: Array) -> Array:
    """Angular velocity of sphere i per force on sphere j: ω = c F × r̂, with r̂ from j to i.

    apart:        c = 1/8πr²
    overlapping:  c = (a_i − a_j + r)²(a_j² + 2a_j(a_i + r) − 3(a_i − r)²)/(128π a_i³ a_j r²)
    inside:       c = r/8πa_i³ when j is inside i, 0 when i is inside j

    Args:
        r: Distances of the centres [µm].
        ai: Radii of the turning spheres [µm].
        aj: Radii of the forced spheres [µm].

    Returns:
        c [1/µm²], the shape of `r`.
    """
    r2 = r * r
    overlapping = (ai - aj + r) ** 2 * (aj**2 + 2.0 * aj * (ai + r) - 3.0 * (ai - r) ** 2)
    return _by_range(
        *(r, ai, aj),
        1.0 / (8.0 * np.pi * r2),
        overlapping / (128.0 * np.pi * ai**3 * aj * r2),
        np.where(ai > aj, r / (8.0 * np.pi * ai**3), 0.0),
    )


def rotation_rotation(r: Array, ai: Array, aj: Array) -> tuple[Array, Array]:
    """Angular velocity of sphere i per torque on sphere j: μ = p I + q r̂r̂.

    apart:        p = −1/16πr³,  q = 3/16πr³
    overlapping:  p = (5r⁶ − 27r⁴(a_i² + a_j²) + 32r³(a_i³ + a_j³) − 9r²(a_i² − a_j²)² − (a_i − a_j)⁴s)/D,
                  q = 3((a_i − a_j)² − r²)²(s − r²)/D,  s = a_i² + 4a_ia_j + a_j²,  D = 512π a_i³a_j³r³
    inside:       p = 1/8π max(a_i, a_j)³,  q = 0

    Args:
        r: Distances of the centres [µm].
        ai: Radii of the turning spheres [µm].
        aj: Radii of the spheres under torque [µm].

    Returns:
        (p, q) [1/µm³], the shape of `r`.
    """
    r2, r3 = r * r, r**3
    difference2 = (ai - aj) ** 2
    s = ai**2 + 4.0 * ai * aj + aj**2
    far, near = 1.0 / (16.0 * np.pi * r3), 1.0 / (512.0 * np.pi * ai**3 * aj**3 * r3)
    polynomial = (
        5.0 * r3**2
        - 27.0 * r2**2 * (ai**2 + aj**2)
        + 32.0 * r3 * (ai**3 + aj**3)
        - 9.0 * r2 * (ai**2 - aj**2) ** 2
        - difference2**2 * s
    )
    p = _by_range(r, ai, aj, -far, near * polynomial, 1.0 / (8.0 * np.pi * np.maximum(ai, aj) ** 3))
    q = _by_range(r, ai, aj, 3.0 * far, near * 3.0 * (difference2 - r2) ** 2 * (s - r2), np.zeros_like(r))
    return p, q


def cross_matrix(vectors: Array) -> Array:
    """The matrices [v]× with [v]× w = v × w, for `vectors` (..., 3); returns (..., 3, 3)."""
    v = np.asarray(vectors, dtype=float)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return out - np.swapaxes(out, -1, -2)


def grand_mobility(centres: Array, radii: Array) -> Array:
    """Mobility of n free spheres in an unbounded liquid of unit viscosity.

    (v_1, ω_1, …, v_n, ω_n) = μ (F_1, T_1, …, F_n, T_n), forces and torques about each sphere's own centre. Divide by
    the viscosity for the physical mobility.

    Args:
        centres: (n, 3) µm.
        radii: (n,) µm, positive.

    Returns:
        (6n, 6n) symmetric matrix, sphere by sphere, velocity before angular velocity [1/µm, 1/µm², 1/µm³]. It is
        singular only when two equal spheres coincide.

    Source: Zuk et al. 2014, doi:10.1017/jfm.2013.668.
    """
    centres = np.asarray(centres, dtype=float).reshape(-1, 3)
    radii = np.asarray(radii, dtype=float).reshape(-1)
    n = len(radii)
    displacement = centres[:, None, :] - centres[None, :, :]
    distance = np.sqrt(np.sum(displacement**2, axis=-1))
    ai, aj = np.broadcast_to(radii[:, None], (n, n)), np.broadcast_to(radii[None, :], (n, n))
    # Concentric spheres (each with itself, above all) have no direction: they get their own value below, and any
    # finite stand-in for their distance keeps the formulas quiet until then.
    concentric = distance <= CONCENTRIC * (ai + aj)
    r = np.where(concentric, ai + aj, distance)
    unit = np.where(concentric[..., None], 0.0, displacement / r[..., None])
    larger = np.maximum(ai, aj)

    identity, projector = np.eye(3), unit[..., :, None] * unit[..., None, :]
    tt, tt_radial = translation_translation(r, ai, aj)
    rr, rr_radial = rotation_rotation(r, ai, aj)
    tt = np.where(concentric, 1.0 / (6.0 * np.pi * larger), tt)
    rr = np.where(concentric, 1.0 / (8.0 * np.pi * larger**3), rr)
    tt_radial, rr_radial = np.where(concentric, 0.0, tt_radial), np.where(concentric, 0.0, rr_radial)
    # ω = c F × r̂ = −c [r̂]× F; `unit` is zero for concentric spheres, which do not couple.
    rt = -rotation_translation(r, ai, aj)[..., None, None] * cross_matrix(unit)

    mu = np.empty((n, 6, n, 6))
    mu[:, :3, :, :3] = np.swapaxes(tt[..., None, None] * identity + tt_radial[..., None, None] * projector, 1, 2)
    mu[:, 3:, :, 3:] = np.swapaxes(rr[..., None, None] * identity + rr_radial[..., None, None] * projector, 1, 2)
    mu[:, 3:, :, :3] = np.swapaxes(rt, 1, 2)
    mu[:, :3, :, 3:] = np.transpose(rt, (1, 3, 0, 2))  # Lorentz reciprocity: the transpose of rotation–translation.
    return mu.reshape(6 * n, 6 * n)
