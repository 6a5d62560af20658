"""What the table of integrators says of a spring: laws that its formulas obey. `test_schemes` holds the steps to it."""

import math

import pytest

from otwarp.kernels.integrate.integrators import INTEGRATORS, LONGEST

SMALL = 1e-2
"""k·dt at which the leading order of an error is all of it."""


@pytest.mark.parametrize("name", INTEGRATORS)
def test_errors_vanish_with_the_order(name):
    """Halving the step divides the worse of both errors of a spring by at least 2^order."""
    scheme = INTEGRATORS[name]

    def error(z: float) -> float:
        return max(abs(scheme.variance_error(z)), abs(scheme.rate_error(z)))

    assert error(SMALL) / error(0.5 * SMALL) > 2.0**scheme.weak_order * 0.97
    assert error(SMALL) < SMALL


@pytest.mark.parametrize("name", INTEGRATORS)
def test_stationary_variance_is_that_of_balance(name):
    """What a step loses, (1 − decay²)·variance, its noise restores: 2z to first order, whatever the scheme."""
    scheme = INTEGRATORS[name]
    assert (1.0 - scheme.decay(SMALL) ** 2) * scheme.variance(SMALL) == pytest.approx(2.0 * SMALL, rel=SMALL)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_beyond_stability_there_is_no_error_to_tell(name):
    scheme = INTEGRATORS[name]
    assert math.isinf(scheme.variance_error(scheme.stable)) and math.isinf(scheme.rate_error(scheme.stable))
    assert scheme.variance_error(0.0) == scheme.rate_error(0.0) == 0.0


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_largest_product_keeps_the_wanted_accuracy(name):
    scheme = INTEGRATORS[name]
    for accuracy in (1e-3, 1e-2, 0.1):
        z = scheme.largest_product(accuracy)
        assert 0.0 < z <= LONGEST
        assert max(abs(scheme.variance_error(z)), abs(scheme.rate_error(z))) <= accuracy
    assert scheme.evaluations == (1 if scheme.correct is None else 2)
