"""Authored force laws of a trap: springs and the two-branch law of the paper (eq. 1), in one or two directions.

Each has the three functions of a force model, see `traps`. A curve is two functions of the squared distance and its
constants: `ratio`, f(d)/d [pN/µm per mW], and `curvature`, (df/dd − f/d)/d² [pN/µm³ per mW], as those of eq. 1 are.
"""

import warp as wp

from otwarp.kernels.core.reads import number_at
from otwarp.kernels.core.roots import reciprocal_root
from otwarp.kernels.core.step_constants import TrapConstants
from otwarp.kernels.core.types import TrapData, world_row


@wp.func
def piecewise_ratio(
    d2: float, stiffness: float, threshold2: float, inverse_square: float, offset: float, cutoff2: float
) -> float:
    """f(d)/d of the paper's piecewise law (eq. 1): K below the threshold, (A/d² + C)/d up to the cutoff, 0 beyond.

    `d2`, `threshold2` and `cutoff2` are squared distances [µm²]; the result is in pN/µm per mW.
    """
    ratio = stiffness
    if d2 >= threshold2:
        per_distance = reciprocal_root(d2)
        ratio = (inverse_square * per_distance * per_distance + offset) * per_distance
    if d2 >= cutoff2:
        ratio = 0.0
    return ratio


@wp.func
def harmonic_ratio(d2: float, stiffness: float, cutoff2: float) -> float:
    """f(d)/d of a linear spring that ends at the cutoff [pN/µm per mW], from squared distances [µm²]."""
    return wp.where(d2 < cutoff2, stiffness, 0.0)


@wp.func
def parameter(values: wp.array2d(dtype=wp.float32), world: int, trap: int) -> float:
    """A parameter of a trap in this world's row, or in the one of all; in the array's units."""
    return number_at(values, world_row(values.shape[0], world), trap)


@wp.func
def beam_frame(traps: TrapData, trap: int) -> TrapConstants:
    """World axes of the beam and its equilibrium [µm] from the focus; constants of the force are left 0."""
    law = TrapConstants()
    law.model = traps.model[trap]
    law.axis = traps.axis[trap]
    law.side = traps.side[trap]
    law.up = wp.cross(law.axis, law.side)
    law.equilibrium = traps.equilibrium[trap]
    return law


def prepare_law(branches: bool, split: bool) -> wp.Function:
    """`prepare` of an authored law: with the branches of eq. 1 or without, one curve or one across and one along.

    In ray optics the force is a function of d/r (Ashkin 1992, doi:10.1016/S0006-3495(92)81860-X). A law that was fitted
    for another radius is f(s·d), s the ratio of the radii: f(s·d)/d has s·K, A/s² and C in place of K, A and C, and its
    distances are divided by s.
    """

    @wp.func
    def scaled(law: TrapConstants, s: float) -> TrapConstants:
        """Constants of f(s·d) from those of f, distances not yet squared [µm]."""
        out = law
        out.stiffness = s * law.stiffness
        out.cutoff2 = law.cutoff2 / s
        if wp.static(branches):
            out.threshold2 = law.threshold2 / s
            out.inverse_square = law.inverse_square / (s * s)
        if wp.static(split):
            out.axial_stiffness = s * law.axial_stiffness
            out.axial_cutoff2 = law.axial_cutoff2 / s
        if wp.static(split and branches):
            out.axial_threshold2 = law.axial_threshold2 / s
            out.axial_inverse_square = law.axial_inverse_square / (s * s)
        return out

    @wp.func
    def prepare(traps: TrapData, world: int, trap: int, radius: float, kind: int) -> TrapConstants:
        """Constants of the law for a sphere of `radius` [µm], from this world's row of parameters or the one of all."""
        law = beam_frame(traps, trap)
        law.stiffness = parameter(traps.stiffness, world, trap)
        law.cutoff2 = parameter(traps.cutoff, world, trap)
        if wp.static(branches):
            law.threshold2 = parameter(traps.threshold, world, trap)
            law.inverse_square = parameter(traps.inverse_square, world, trap)
            law.offset = parameter(traps.offset, world, trap)
        if wp.static(split):
            law.axial_stiffness = parameter(traps.axial_stiffness, world, trap)
            law.axial_cutoff2 = parameter(traps.axial_cutoff, world, trap)
        if wp.static(split and branches):
            law.axial_threshold2 = parameter(traps.axial_threshold, world, trap)
            law.axial_inverse_square = parameter(traps.axial_inverse_square, world, trap)
            law.axial_offset = parameter(traps.axial_offset, world, trap)
        # a law that holds as it is needs no division
        if traps.law_radius[trap] > 0.0:
            law = scaled(law, traps.law_radius[trap] / radius)
        law.cutoff2 = law.cutoff2 * law.cutoff2
        law.threshold2 = law.threshold2 * law.threshold2
        law.axial_cutoff2 = law.axial_cutoff2 * law.axial_cutoff2
        law.axial_threshold2 = law.axial_threshold2 * law.axial_threshold2
        if wp.static(split):
            law.reach2 = wp.max(law.cutoff2, law.axial_cutoff2)
        return law

    return prepare


@wp.func
def harmonic_isotropic(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
    """F = −K·d [pN per mW] inside the cutoff, equal in all directions."""
    d2 = wp.dot(displacement, displacement)
    return -harmonic_ratio(d2, law.stiffness, law.cutoff2) * displacement


@wp.func
def harmonic_split(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
    """F = −K_r·ρ − K_z·z [pN per mW], each inside its own cutoff, and nothing beyond the larger."""
    z = wp.dot(displacement, law.axis)
    d2 = wp.dot(displacement, displacement)
    f_r = harmonic_ratio(d2 - z * z, law.stiffness, law.cutoff2)
    f_z = harmonic_ratio(z * z, law.axial_stiffness, law.axial_cutoff2)
    if d2 >= law.reach2:
        f_r = float(0.0)
        f_z = float(0.0)
    # with ρ = d − z·axis: all of d as if across, and along the beam the difference
    return ((f_r - f_z) * z) * law.axis - f_r * displacement


@wp.func
def piecewise_curvature(
    d2: float, stiffness: float, threshold2: float, inverse_square: float, offset: float, cutoff2: float
) -> float:
    """(df/dd − f/d)/d² of the piecewise law [pN/µm³ per mW]; zero on its linear branch and beyond the cutoff."""
    curvature = float(0.0)
    if d2 >= threshold2 and d2 < cutoff2:
        per_distance2 = 1.0 / d2
        per_distance = wp.sqrt(per_distance2)
        curvature = -(3.0 * inverse_square * per_distance2 + offset) * per_distance * per_distance2
    return curvature


@wp.func
def harmonic_isotropic_stiffness(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.mat33:
    """K·1 [pN/µm per mW] inside the cutoff, 0 beyond."""
    k = harmonic_ratio(wp.dot(displacement, displacement), law.stiffness, law.cutoff2)
    return k * wp.identity(n=3, dtype=float)


@wp.func
def harmonic_split_stiffness(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.mat33:
    """K_r across and K_z along the beam [pN/µm per mW], each inside its own cutoff."""
    z = wp.dot(displacement, law.axis)
    d2 = wp.dot(displacement, displacement)
    f_r = harmonic_ratio(d2 - z * z, law.stiffness, law.cutoff2)
    f_z = harmonic_ratio(z * z, law.axial_stiffness, law.axial_cutoff2)
    result = f_r * wp.identity(n=3, dtype=float) + (f_z - f_r) * wp.outer(law.axis, law.axis)
    if d2 >= law.reach2:
        result = wp.mat33(0.0)
    return result


def isotropic_term(ratio: wp.Function) -> wp.Function:
    """`force` of one curve in all directions, from its f(d)/d."""

    @wp.func
    def isotropic(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
        """−f(d)·d̂ at a displacement d from the trap [µm], f by the curve: a force [pN/mW]."""
        d2 = wp.dot(displacement, displacement)
        f = ratio(d2, law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2)
        return -f * displacement

    return isotropic


def split_term(ratio: wp.Function) -> wp.Function:
    """`force` of separate curves across and along the beam, from their f(d)/d."""

    @wp.func
    def split(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
        """−f_r across and −f_z along the beam at a displacement [µm]: a force [pN/mW], 0 beyond the larger cutoff."""
        z = wp.dot(displacement, law.axis)
        across = displacement - z * law.axis
        force = wp.vec3(0.0)
        if wp.dot(displacement, displacement) < law.reach2:
            r2 = wp.dot(across, across)
            f_r = ratio(r2, law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2)
            f_z = ratio(
                z * z,
                law.axial_stiffness,
                law.axial_threshold2,
                law.axial_inverse_square,
                law.axial_offset,
                law.axial_cutoff2,
            )
            force = -f_r * across - (f_z * z) * law.axis
        return force

    return split


def isotropic_stiffness_term(ratio: wp.Function, curvature: wp.Function) -> wp.Function:
    """`stiffness` of one curve in all directions, from its f(d)/d and (df/dd − f/d)/d²."""

    @wp.func
    def isotropic_stiffness(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.mat33:
        """−∂F/∂d [pN/µm per mW]: f/d across the displacement [µm] and df/dd along it."""
        d2 = wp.dot(displacement, displacement)
        f = ratio(d2, law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2)
        c = curvature(d2, law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2)
        return f * wp.identity(n=3, dtype=float) + c * wp.outer(displacement, displacement)

    return isotropic_stiffness


def split_stiffness_term(ratio: wp.Function, curvature: wp.Function) -> wp.Function:
    """`stiffness` of separate curves across and along the beam."""

    @wp.func
    def split_stiffness(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.mat33:
        """−∂F/∂d [pN/µm per mW] at a displacement [µm]: f/d and df/dd of the curves across and along the beam."""
        z = wp.dot(displacement, law.axis)
        across = displacement - z * law.axis
        result = wp.mat33(0.0)
        if wp.dot(displacement, displacement) < law.reach2:
            r2 = wp.dot(across, across)
            z2 = z * z
            f_r = ratio(r2, law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2)
            c_r = curvature(r2, law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2)
            f_z = ratio(
                z2,
                law.axial_stiffness,
                law.axial_threshold2,
                law.axial_inverse_square,
                law.axial_offset,
                law.axial_cutoff2,
            )
            c_z = curvature(
                z2,
                law.axial_stiffness,
                law.axial_threshold2,
                law.axial_inverse_square,
                law.axial_offset,
                law.axial_cutoff2,
            )
            result = f_r * wp.identity(n=3, dtype=float) + c_r * wp.outer(across, across)
            result += (f_z + c_z * z2 - f_r) * wp.outer(law.axis, law.axis)
        return result

    return split_stiffness


CURVES: dict[str, tuple[int, wp.Function, wp.Function]] = {
    "piecewise": (2, piecewise_ratio, piecewise_curvature),
}
"""Curves by the names of `ot:trap:model`: key of the model of one curve, that of two has the next; ratio; curvature."""
