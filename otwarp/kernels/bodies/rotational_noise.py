"""How a rigid body turns and moves thermally in one step, right to second order in D_r dt.

Rotation vectors of variance Σ = 2 k_B T M_rr dt make orientations decorrelate too fast or too slowly by O(D_r dt), for
rotations do not commute. With σ_k the principal values of Σ, the variances

    σ_k' = σ_k + ¼ σ_i σ_j − ⅙ σ_k (σ_i + σ_j),    that is    Σ' = Σ + ¼ adj Σ − ⅙ (tr Σ Σ − Σ²),

make the mean of every function of the orientation right to O(Σ³) in a step: by the commutators of so(3) the mean fourth
power of a Gaussian rotation vector Ω differs from three squares of the generator, E[Ω⁴] ≠ 3 (Σ_k σ_k X_k²)², by terms
that are themselves quadratic in the X_k, and these the variances take in. It costs nothing in a step.

A displacement drawn in the axes of the start of the step forgets that these turn meanwhile. Turned along with the body
by 1/√2 of its rotation vector it has the mean square, in all directions, of a displacement whose axes turn all the way:
the variance of an angle is on average half of what it is at the end.
"""

import warp as wp

from otwarp.kernels.core.types import vec6

PART = wp.constant(0.35355339059327379)
"""Half of 1/√2: the tangent of half the angle is its half, as far as a step goes."""


@wp.func
def turning_variance(s: wp.mat33) -> wp.mat33:
    """Σ' of a symmetric Σ [rad²]."""
    x = wp.vec3(s[0, 0], s[0, 1], s[0, 2])
    y = wp.vec3(s[1, 0], s[1, 1], s[1, 2])
    z = wp.vec3(s[2, 0], s[2, 1], s[2, 2])
    adjugate = wp.matrix_from_rows(wp.cross(y, z), wp.cross(z, x), wp.cross(x, y))
    return s + 0.25 * adjugate - (wp.trace(s) * s - s * s) / 6.0


@wp.func
def turning_root(coupling: wp.mat33, rotation: vec6) -> vec6:
    """Lower factor C' with B Bᵀ + C' C'ᵀ = Σ' for Σ = B Bᵀ + C Cᵀ [rad], of B = `coupling` and C = `rotation`.

    Triangles are kept as (xx, yy, zz, yx, zx, zy). Where a step is so long that there is none, it is C.
    """
    c = wp.mat33(
        rotation[0], 0.0, 0.0, rotation[3], rotation[1], 0.0, rotation[4], rotation[5], rotation[2]
    )  # fmt: skip
    along = coupling * wp.transpose(coupling)
    m = turning_variance(along + c * wp.transpose(c)) - along
    root = rotation
    if m[0, 0] > 0.0:
        xx = wp.sqrt(m[0, 0])
        yx = m[1, 0] / xx
        zx = m[2, 0] / xx
        y = m[1, 1] - yx * yx
        if y > 0.0:
            yy = wp.sqrt(y)
            zy = (m[2, 1] - zx * yx) / yy
            z = m[2, 2] - zx * zx - zy * zy
            if z > 0.0:
                root = vec6(xx, yy, wp.sqrt(z), yx, zx, zy)
    return root


@wp.func
def turned_along(linear: wp.vec3, angular: wp.vec3) -> wp.vec3:
    """A displacement [µm] turned by 1/√2 of the rotation vector [rad] of its step; its length stays (Cayley)."""
    c = PART * angular
    across = (2.0 / (1.0 + wp.dot(c, c))) * wp.cross(c, linear)
    return linear + across + wp.cross(c, across)
