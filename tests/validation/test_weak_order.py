"""How fast averages converge in the time step, scheme by scheme and observable by observable, without sampling noise.

The chain that a scheme makes of a one-dimensional well is solved as an operator (`benchmarks.transitions`), so that
errors of 1e-6 are seen and orders follow from halving the step. That the kernels take these very steps is tested path
by path in `test_strong_order.py`. The well is a sine, U = (depth/2)(1 − cos x/w): its force falls off and vanishes, as
that of an optical trap does. Lengths are in √(k_B T/k) and times in γ/k; h = k·dt/γ.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.transitions import Chain, SineWell, deviates
from otwarp.kernels.integrate.integrators import INTEGRATORS
from tests.validation import scheme

HELD = SineWell(20.0)
LEFT = SineWell(8.0, share=0.6)
"""Ends where U = 5.2 k_B T and the force is the largest but for 5 %."""

DIVISIONS = (16, 32, 64)
"""1/h."""

ORDER = 0.01
"""Of an order: slopes p + b·h between halvings, extrapolated to h = 0, leave b₂·h² with h² = 1/1000."""

ORDERS = {
    "eulerMaruyama": (1, 1, 1),
    "leimkuhlerMatthews": (2, 1, None),
    "heun": (2, 2, 2),
    "exponential": (2, 2, 2),
}
"""Of variance, correlation and escape time."""


def errors(name: str, noise: str, what: str) -> np.ndarray:
    """Relative errors at the steps 1/DIVISIONS."""
    if what == "escape":
        exact = LEFT.escape_time()
        return np.array([Chain(name, noise, LEFT, 1.0 / n).escape_time() for n in DIVISIONS]) / exact - 1.0
    chains = [Chain(name, noise, HELD, 1.0 / n) for n in DIVISIONS]
    if what == "variance":
        return np.array([c.variance() for c in chains]) / HELD.variance() - 1.0
    found = [c.correlation(n) for c, n in zip(chains, DIVISIONS, strict=True)]
    return np.array(found) / HELD.correlation(1.0) - 1.0


def order(error: np.ndarray) -> float:
    """Slope at h → 0 from two halvings."""
    first, second = np.log2(np.abs(error[:-1] / error[1:]))
    return 2.0 * second - first


@pytest.mark.parametrize("what", ["variance", "correlation", "escape"])
@pytest.mark.parametrize("name", INTEGRATORS)
def test_weak_order(expect_law, name, what):
    """Errors of ⟨x²⟩, of ⟨x(0)x(t)⟩/⟨x²⟩ at t = γ/k and of the mean escape time fall with the power of the step.

    Averaged noise is of order 2 in the distribution alone. Escapes are corrected for crossings between steps.
    Source: Talay & Tubaro 1990, doi:10.1080/07362999008809220; Leimkuhler, Matthews & Tretyakov 2014,
    doi:10.1098/rspa.2014.0120; Gobet 2000, doi:10.1016/S0304-4149(99)00109-X.
    """
    expected = ORDERS[name][("variance", "correlation", "escape").index(what)]
    if expected is None:
        pytest.skip("escapes are looked for where a run shows the bead, which is not this scheme's chain")
    assert expected >= INTEGRATORS[name].weak_order
    expect_law(f"{name}, {what}: order", order(errors(name, "gaussian", what)), expected, ORDER)


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize(("noise", "expected"), [("threePoint", 2), ("uniform", 1)])
def test_order_of_what_cheap_noise_costs(expect_law, name, noise, expected):
    """Averages with three-point noise differ from those with gaussian noise by order 2, with uniform noise by order 1.

    Source: moments equal up to the fifth and the third; Kloeden & Platen 1992, doi:10.1007/978-3-662-12616-5, ch. 14.
    """
    for what in ("variance", "correlation"):
        cost = errors(name, noise, what) - errors(name, "gaussian", what)
        expect_law(f"{name}, {noise}, {what}: order of the difference", order(cost), expected, ORDER)


COST = 1e-3
"""What three-point noise adds to the error of stationary averages at h up to 0.2."""


@pytest.mark.parametrize("name", ["heun", "exponential"])
def test_cost_of_three_point_noise(expect_law, name):
    """At h = 0.2 it changes variance and correlation by less than 0.1 %, and escape times by some per cent.

    Source: equal moments up to the fifth; a path of such steps reaches no farther than √3 standard deviations at once.
    """
    exact, cheap = (Chain(name, noise, HELD, 0.2) for noise in ("gaussian", "threePoint"))
    expect_law(f"{name}: variance, three-point over gaussian", cheap.variance() / exact.variance(), 1.0, COST / 5.0)
    expect_law(
        f"{name}: correlation, three-point over gaussian", cheap.correlation(5) / exact.correlation(5), 1.0, COST / 5.0
    )
    exact, cheap = (Chain(name, noise, SineWell(5.0), 0.2) for noise in ("gaussian", "threePoint"))
    late = cheap.escape_time() / exact.escape_time() - 1.0
    assert 0.005 < late < 0.05


def test_chain_of_a_spring(expect_law):
    """Where the well is a spring the operator's averages are those of the closed forms.

    Source: first-order autoregression; Kloeden & Platen 1992, doi:10.1007/978-3-662-12616-5, §9.
    """
    for name in INTEGRATORS:
        # a sine of 2·10⁵ k_B T would need too many nodes: what it differs from a spring by falls as 1/depth
        found = []
        for depth in (100.0, 200.0):
            chain = Chain(name, "gaussian", SineWell(depth), 0.25)
            found.append([chain.variance() / chain.well.variance(), chain.correlation(4) / chain.well.correlation(1.0)])
        limit = 2.0 * np.array(found[1]) - np.array(found[0])
        variance = scheme.variance(name, 0.25)
        exact = [variance, float(scheme.covariance(name, 0.25, 4)) / variance / math.exp(-1.0)]
        expect_law(f"{name}, h = 0.25: variance and correlation over those of a spring", limit, exact, 1e-4)


@pytest.mark.parametrize("noise", ["gaussian", "threePoint", "uniform"])
def test_expectations(noise):
    """The quadratures have the moments of their noise: 1, 0, 1, 0 and 3 or 9/5."""
    value, weight = deviates(noise)
    moments = [float(weight @ value**n) for n in range(5)]
    assert moments == pytest.approx([1.0, 0.0, 1.0, 0.0, 1.8 if noise == "uniform" else 3.0], abs=1e-10)


def test_more_nodes_change_nothing():
    """401 nodes or 601: variance, correlation and escape time to 1e-6."""
    for well, what in ((HELD, "variance"), (LEFT, "escape_time")):
        coarse, fine = (getattr(Chain("heun", "gaussian", well, 1.0 / 64, nodes=n), what)() for n in (401, 601))
        assert coarse == pytest.approx(fine, rel=1e-6)
