"""Potential energy of a sphere in a trap, for the laws whose force is the slope of one.

Curves of the distance alone are conservative, and so are separate curves across and along the beam, whose forces depend
on ρ and on z alone, as far as the trap reaches. Tabulated and exact forces are not: light pushes.
"""

import warp as wp

from otwarp.kernels.core.step_constants import TrapConstants
from otwarp.kernels.optics.traps import trap_term


@wp.func
def harmonic_energy(
    d2: float, stiffness: float, threshold2: float, inverse_square: float, offset: float, cutoff2: float
) -> float:
    """½ K d² of a spring that ends at the cutoff [pN·µm per mW], from squared distances [µm²]; constant beyond."""
    return 0.5 * stiffness * wp.min(d2, cutoff2)


@wp.func
def piecewise_energy(
    d2: float, stiffness: float, threshold2: float, inverse_square: float, offset: float, cutoff2: float
) -> float:
    """∫ f dd of the paper's piecewise law (eq. 1) from 0 to d [pN·µm per mW], from squared distances [µm²].

    ½ K d² up to the threshold δ, from there on A (1/δ − 1/d) + C (d − δ) more, and constant beyond the cutoff.
    """
    reached2 = wp.min(d2, cutoff2)
    energy = 0.5 * stiffness * wp.min(reached2, threshold2)
    if reached2 > threshold2:
        first = wp.sqrt(threshold2)
        last = wp.sqrt(reached2)
        energy += (inverse_square / (first * last) + offset) * (last - first)
    return energy


ENERGIES = {"harmonic": harmonic_energy, "piecewise": piecewise_energy}
"""Energies by the names of `ot:trap:model`."""


def trap_energy_term(models: tuple[str, ...]) -> wp.Function:
    """`(law, displacement) -> energy per mW` for the models a scene uses: those of the only one, or a branch.

    NaN of a model whose force has no potential.
    """
    head = _energy_of(models[0])
    if len(models) == 1:
        return head
    rest, key = trap_energy_term(models[1:]), trap_term(models[0]).key

    @wp.func
    def energy(law: TrapConstants, displacement: wp.vec3) -> float:
        """Energy [pN·µm per mW] of this model, or of one of the rest, by the law's key."""
        e = rest(law, displacement)
        if law.model == wp.static(key):
            e = head(law, displacement)
        return e

    return energy


def _energy_of(model: str) -> wp.Function:
    """The energy of one model."""
    name, _, form = model.rpartition("_")
    if name not in ENERGIES:

        @wp.func
        def none(law: TrapConstants, displacement: wp.vec3) -> float:
            """NaN: the force at a displacement [µm] has no potential."""
            return float(wp.nan)

        return none
    curve = ENERGIES[name]

    @wp.func
    def isotropic(law: TrapConstants, displacement: wp.vec3) -> float:
        """Energy [pN·µm per mW] at a displacement from the trap [µm] of one curve in all directions."""
        d2 = wp.dot(displacement, displacement)
        return curve(d2, law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2)

    @wp.func
    def split(law: TrapConstants, displacement: wp.vec3) -> float:
        """Energy [pN·µm per mW] at a displacement from the trap [µm] of the curves across and along the beam."""
        z = wp.dot(displacement, law.axis)
        z2 = z * z
        r2 = wp.dot(displacement, displacement) - z2
        return curve(
            wp.max(r2, 0.0), law.stiffness, law.threshold2, law.inverse_square, law.offset, law.cutoff2
        ) + curve(
            z2,
            law.axial_stiffness,
            law.axial_threshold2,
            law.axial_inverse_square,
            law.axial_offset,
            law.axial_cutoff2,
        )

    return split if form == "split" else isotropic
