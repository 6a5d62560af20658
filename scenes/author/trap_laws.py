"""Trap laws of a 2.5 µm polymer sphere, fitted to exact optical forces, for spheres of any radius.

Fitted by `fit_trap_laws.py` to the Optical Tweezers Toolbox (Nieminen et al. 2007, doi:10.1088/1464-4258/9/8/S12):
radius 2.5 µm, index 1.52 in 1.33, 1.064 µm, NA 1.25, circular polarization, 1 mW. Its output (± standard error):

    law        K [pN/µm]        δ [µm]           cutoff [µm]      RMSE [pN]  R²      peak [pN]: samples, law
    RADIAL     0.5684 ± 0.0138  2.7989 ± 0.0307  3.5504 ± 0.0538  0.2301     0.8416  2.145, 1.591
    AXIAL      0.2338 ± 0.0025  2.5925 ± 0.0183  5.9555 ± 0.5096  0.0182     0.9882  0.545, 0.606
    ISOTROPIC  0.3948 ± 0.0267  2.7858 ± 0.0841  3.7567 ± 0.2081  0.3110     0.5547  -

What such a law leaves out: the radial force grows faster than linearly up to its peak, so the exact stiffness at the
equilibrium (0.3561 radial, 0.1823 axial) is lower than K; AXIAL is the downstream side, where the sphere escapes and
the force is the weaker (upstream the
samples peak at 1.192 pN); the samples end 3.5 µm downstream of the equilibrium,
so the axial cutoff is an extrapolation; ISOTROPIC is a compromise of two curves that differ fourfold at the peak.
"""

from __future__ import annotations

from otwarp.laws import TrapLaw

FITTED_RADIUS = 2.5
"""Radius of the sphere of the fit [µm]."""

EQUILIBRIUM = 0.4707
"""Stable equilibrium of that sphere, downstream of the focus [µm]."""

STIFFNESS_RADIAL, STIFFNESS_AXIAL = 0.3561, 0.1823
"""Exact stiffness of that sphere at the equilibrium, at 1 mW [pN/µm]."""

BEAD_STIFFNESS_RADIAL, BEAD_STIFFNESS_AXIAL, BEAD_EQUILIBRIUM = 1.036, 0.5544, 0.0534
"""Exact stiffness at 1 mW [pN/µm] and equilibrium [µm] of a polystyrene bead of radius 1 µm (index 1.59, NA 1.2)."""


def continuous_law(stiffness: float, threshold: float, cutoff: float, *, radius: float = FITTED_RADIUS) -> TrapLaw:
    """The law at 1 mW for a sphere of `radius` [µm] that is continuous at its threshold and zero at its cutoff."""
    inverse_square = stiffness * threshold / (1 / threshold**2 - 1 / cutoff**2)
    return TrapLaw(
        stiffness=stiffness,
        threshold=threshold,
        inverse_square=round(inverse_square, 9),
        offset=round(-inverse_square / cutoff**2, 9),
        cutoff=cutoff,
        power=1.0,
        radius=radius,
    )


RADIAL = continuous_law(0.5684, 2.7989, 3.5504)
AXIAL = continuous_law(0.2338, 2.5925, 5.9555)
ISOTROPIC = continuous_law(0.3948, 2.7858, 3.7567)


def equilibrium_of(radius: float) -> float:
    """Height of the equilibrium above the focus [µm] of a sphere of `radius` [µm], by ray-optics similarity."""
    return round(EQUILIBRIUM * radius / FITTED_RADIUS, 6)


def stiffness_of(law: TrapLaw, radius: float, power: float) -> float:
    """Slope [pN/µm] of `law` at its centre for a sphere of `radius` [µm] held with `power` [mW]."""
    return law.stiffness * (law.radius / radius) * (power / law.power)


def peak_force_of(law: TrapLaw, power: float) -> float:
    """Largest force [pN] of `law` with `power` [mW]: the force at its threshold."""
    return law.stiffness * law.threshold * (power / law.power)
