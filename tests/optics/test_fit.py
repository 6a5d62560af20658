"""Fits of force curves: exact on curves of their own form, and of the paper's quality on real ones."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.optics.beam import Beam
from otwarp.optics.fit import (
    ForceCurves,
    fit_curve,
    fit_harmonic,
    fit_piecewise,
    pull,
    sample_curves,
    trap_region,
    weak_side,
)
from otwarp.optics.mie import Particle

BEAM = Beam(power=1.0)


SPHERE = Particle(radius=2.5, index=1.52)


@pytest.fixture(scope="module")
def curves() -> ForceCurves:
    return sample_curves(BEAM, SPHERE)


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


@pytest.mark.thorough
def test_a_free_fit_is_no_worse_and_says_how_far_it_jumps(curves):
    joined, free = (fit_piecewise(BEAM, SPHERE, continuous=c, curves=curves) for c in (True, False))
    for name in ("radial", "axial", "isotropic"):
        assert free[name].mse <= 1.01 * joined[name].mse
        assert joined[name].jump == 0.0
        w = free[name].law
        below, above = (float(pull(w, np.array(w.threshold + s))) for s in (-1e-9, 1e-9))
        assert free[name].jump == pytest.approx(above - below, abs=1e-6)
    assert free["radial"].r_squared > 0.9 and joined["axial"].r_squared > 0.98
    assert joined["isotropic"].r_squared < joined["radial"].r_squared


@pytest.mark.thorough
def test_errors_are_those_of_the_law_over_the_trap_region(curves):
    region = 1.5 * 2.5 + 2.0 * 1.064
    assert trap_region(BEAM, SPHERE) == pytest.approx(region)
    d, q = curves["radial"]
    for found in (fit_piecewise(BEAM, SPHERE, curves=curves), fit_harmonic(BEAM, SPHERE, curves=curves)):
        f = found["radial"]
        residual = pull(f.law, d) / BEAM.force_scale - q
        assert f.region == pytest.approx(region) == d.max()
        assert (f.mse, f.worst) == pytest.approx((np.mean(residual**2), np.abs(residual).max()))
        assert np.abs(residual[d == f.worst_at]).max() == pytest.approx(f.worst)
        assert f.r_squared == pytest.approx(1.0 - np.sum(residual**2) / np.sum((q - q.mean()) ** 2))


def test_the_axial_law_is_that_of_the_side_on_which_the_sphere_is_lost(curves):
    assert weak_side(curves) == "downstream"
    assert curves["downstream"][1].max() < curves["upstream"][1].max()
    other = {**curves, "downstream": curves["upstream"], "upstream": curves["downstream"]}
    assert weak_side(other) == "upstream"
    assert fit_piecewise(BEAM, SPHERE, curves=other)["axial"] == fit_piecewise(BEAM, SPHERE, curves=curves)["axial"]


def test_the_harmonic_fit_has_the_trap_stiffness(curves):
    """Within 0.1 µm the exact curve rises 0.2 % above its tangent (0.7 % within 0.2 µm)."""
    found = fit_harmonic(BEAM, SPHERE, reach=0.1, curves=curves)
    assert found["radial"].fitted <= 0.1
    with pytest.raises(InputError, match="reach"):
        fit_harmonic(BEAM, SPHERE, reach=0.01, curves=curves)
    assert found["radial"].law.stiffness == pytest.approx(0.35608174, rel=5e-3)
