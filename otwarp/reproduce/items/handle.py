"""The trap and the sphere of which force curves are computed, fitted and felt: a robot's handle in the default beam."""

from __future__ import annotations

import functools
from dataclasses import replace

from otwarp.laws import TrapLaw
from otwarp.optics import Beam, CurveFit, Particle
from otwarp.optics.fit import ForceCurves, fit_piecewise, sample_curves

BEAM = Beam(wavelength=1.064, numerical_aperture=1.25, power=20.0, polarization="circular")
HANDLE = Particle(radius=1.525, index=1.52)
"""A two-photon polymer sphere the size of the only handle that is drawn to scale."""


@functools.cache
def exact_curves(beam: Beam = BEAM, sphere: Particle = HANDLE) -> ForceCurves:
    """Exact restoring force [Q] over distance from the equilibrium [µm]."""
    return sample_curves(beam, sphere)


@functools.cache
def fits(beam: Beam = BEAM, sphere: Particle = HANDLE, *, continuous: bool = True) -> dict[str, CurveFit]:
    """Eq. 1 fitted to them: `radial`, `axial`, `isotropic`."""
    return fit_piecewise(beam, sphere, continuous=continuous, curves=exact_curves(beam, sphere))


def law(axis: str) -> TrapLaw:
    """The continuous fit of the handle along an axis, at 1 mW."""
    return replace(fits()[axis].law.per_mw(), radius=0.0)
