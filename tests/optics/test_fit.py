"""Fits of force curves: exact on curves of their own form, and of the paper's quality on real ones."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.optics.beam import Beam
from otwarp.optics.fit import fit_curve, fit_harmonic, fit_piecewise
from otwarp.optics.mie import Sphere

BEAM = Beam(power=1.0)


def law(d: np.ndarray, k: float, a: float, c: float, threshold: float, cutoff: float) -> np.ndarray:
    outer = (d >= threshold) & (d < cutoff)
    return np.where(d < threshold, k * d, 0.0) + np.where(outer, a / np.maximum(d, 1e-9) ** 2 + c, 0.0)


def test_a_curve_of_the_law_itself_is_found_again():
    """A continuous curve with K = 0.2, δ = 2 and D = 3 comes back to the spacing of the samples."""
    d = np.linspace(0.0, 4.0, 400)
    k, threshold, cutoff = 0.2, 2.0, 3.0
    a = k * threshold / (1.0 / threshold**2 - 1.0 / cutoff**2)
    q = law(d, k, a, -a / cutoff**2, threshold, cutoff)
    found = fit_curve("radial", d, q, BEAM, continuous=True)
    assert found.r_squared > 0.9999
    assert found.law.stiffness / BEAM.force_scale == pytest.approx(k, rel=1e-3)
    assert found.law.threshold == pytest.approx(threshold, abs=0.02)
    assert found.law.cutoff == pytest.approx(cutoff, abs=0.02)


def test_a_free_fit_is_no_worse_and_says_how_far_it_jumps():
    sphere = Sphere(radius=2.5, index=1.52)
    joined, free = fit_piecewise(BEAM, sphere), fit_piecewise(BEAM, sphere, continuous=False)
    for name in ("radial", "axial", "isotropic"):
        assert free[name].mse <= 1.01 * joined[name].mse
        assert joined[name].jump == 0.0
    assert free["radial"].r_squared > 0.9 and joined["axial"].r_squared > 0.98
    assert joined["isotropic"].r_squared < joined["radial"].r_squared


def test_the_harmonic_fit_has_the_trap_stiffness():
    """Within 0.1 µm the exact curve rises 0.2 % above its tangent (0.7 % within 0.2 µm)."""
    found = fit_harmonic(BEAM, Sphere(radius=2.5, index=1.52), reach=0.1)
    assert found["radial"].law.stiffness == pytest.approx(0.35608174, rel=5e-3)
