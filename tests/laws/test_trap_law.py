import math

import numpy as np
import pytest

from otwarp.laws import TrapLaw
from otwarp.optics.fit import pull
from tests.reference.traps import curve

LAW = TrapLaw(stiffness=20.0, threshold=0.5, inverse_square=3.0, offset=-1.0, cutoff=1.5, power=8.0, radius=1.2)
SPRING = TrapLaw(stiffness=3.0, cutoff=2.0)

DISTANCES = (0.0, 1e-9, 0.3, 0.5, np.nextafter(0.5, 0.0), 1.0, np.nextafter(1.5, 0.0), 1.5, 7.0)
"""Both branches, what lies beyond, and the edges between them."""


@pytest.mark.parametrize("law", [LAW, SPRING], ids=["piecewise", "spring"])
def test_ratio_and_pull_are_the_equation(law):
    for d in DISTANCES:
        expected = curve(law, d)
        assert pull(law, np.array(d)) == pytest.approx(expected, rel=1e-12)
        # squares put the edges a rounding elsewhere
        if d not in DISTANCES[4::2]:
            assert d * law.ratio(d * d) == pytest.approx(expected, rel=1e-12)


def test_a_law_without_a_linear_branch_has_no_direction_at_its_centre():
    bare = TrapLaw(stiffness=1.0, threshold=0.0, inverse_square=1.0)
    assert bare.ratio(0.0) == 0.0 and bare.ratio(4.0) == pytest.approx(0.125)
    assert math.isnan(bare.ratio(math.nan))


def test_per_mw_scales_forces_and_leaves_distances():
    one = LAW.per_mw()
    assert one.power == 1.0 and (one.threshold, one.cutoff, one.radius) == (LAW.threshold, LAW.cutoff, LAW.radius)
    d = np.linspace(0.01, 2.0, 60)
    np.testing.assert_allclose(LAW.power * pull(one, d), pull(LAW, d), rtol=1e-14)


def test_another_radius_feels_the_force_of_similar_distances():
    """F(d·fitted/radius), ray optics' similarity; a law that names no radius stays."""
    larger, d = LAW.for_radius(2.4), np.linspace(0.013, 4.0, 60)
    np.testing.assert_allclose(pull(larger, d), pull(LAW, d * LAW.radius / 2.4), rtol=1e-13)
    assert larger.radius == 0.0 and SPRING.for_radius(2.4) is SPRING
