"""The Smoluchowski equation in wells of one curve, against integrals and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, simpson

from otwarp.bench.radial_wells import SHAPES, RadialWell, Solution, solution
from otwarp.simulation.model import Model


@pytest.mark.parametrize("shape", SHAPES)
def test_energy_is_the_integral_of_the_force_and_ends_at_the_depth(shape):
    well = RadialWell(shape, 5.0)
    for low, high in ((0.0, well.bend), (well.bend, well.end)):
        r = np.linspace(low, high * (1.0 - 1e-12), 4001)
        inside = np.where(r < high, r, r)
        work = cumulative_simpson(well.force(inside), x=r, initial=0.0)[-1] if high > low else 0.0
        assert well.energy(np.array(high)) - well.energy(np.array(low)) == pytest.approx(work, abs=2e-3)
    assert float(well.energy(np.array(well.end))) == pytest.approx(5.0)
    r = np.linspace(1.001 * well.bend, 0.999 * well.end, 11) if well.bend < well.end else np.array([0.5])
    np.testing.assert_allclose((well.force(r + 1e-6) - well.force(r - 1e-6)) / 2e-6, well.slope(r), rtol=1e-5)


@pytest.mark.parametrize("shape", ["spring with an end", "the paper's radial law"])
def test_mean_escape_time_is_the_double_integral(shape):
    """∫ e^U r⁻² ∫ e^{−U} s² (Gardiner 2009, Stochastic Methods, section 5.5)."""
    well = RadialWell(shape, 5.0)
    r = np.linspace(0.0, well.end, 20001)
    u = well.energy(r)
    inner = cumulative_simpson(np.exp(-u) * r**2, x=r, initial=0.0)
    exact = simpson(np.exp(u) * np.divide(inner, r**2, out=np.zeros_like(r), where=r > 0.0), x=r)
    found = solution(shape, 5.0)
    assert found.escape == pytest.approx(exact, rel=1e-4)
    assert found.time_until(50.0 * exact) == pytest.approx(found.escape, rel=1e-6)
    assert found.escape == pytest.approx(Solution(RadialWell(shape, 5.0), cells=600).escape, rel=1e-5)


def test_a_deep_spring_is_an_ornstein_uhlenbeck_process():
    deep = solution("spring with an end", 16.0)
    assert deep.variance == pytest.approx(1.0, rel=2e-4)
    assert deep.correlation(0.7) == pytest.approx(math.exp(-0.7), rel=2e-4)
    assert deep.displacement(0.01) == pytest.approx(2.0 * (1.0 - math.exp(-0.01)), rel=2e-3)
    assert deep.forgetting == pytest.approx(1.0, rel=2e-3)


def test_scene_has_the_depth_and_the_rate():
    well = RadialWell("the paper's radial law", 5.0)
    model = Model.build(well.scene(), device="cpu")
    assert model.scales.trap_relaxation == pytest.approx(1.0 / well.rate)
    law = model.scene.traps[0].radial
    assert law is not None
    r = np.linspace(0.0, law.cutoff, 20001)
    pull = np.array([law.ratio(x * x) * x for x in r[:-1]]) * well.power / law.power
    assert simpson(pull, x=r[:-1]) / (1.380649e-5 * 298.15) == pytest.approx(5.0, rel=1e-3)
