"""The response of the first-order filter to a sine, against its transfer function."""

from __future__ import annotations

import cmath
import math

import pytest

from otwarp.errors import InputError
from otwarp.haptics.chain.motion import VectorFilter
from otwarp.haptics.core.config import LowPass


@pytest.mark.parametrize("frequency", [2.0, 10.0, 60.0])
def test_sine_comes_out_as_the_transfer_function_says(frequency):
    """H(z) = α/(1 − (1 − α)/z)."""
    alpha, rate, n = 0.05, 1000.0, 4000
    z = cmath.exp(2j * math.pi * frequency / rate)
    gain = alpha / (1.0 - (1.0 - alpha) / z)
    low_pass = VectorFilter(alpha)
    for i in range(n):
        x, _, _ = low_pass.step(math.sin(2.0 * math.pi * frequency * i / rate), 0.0, 0.0)
    # by now the start is forgotten: 0.95^4000
    expected = (gain * cmath.exp(2j * math.pi * frequency * (n - 1) / rate)).imag
    assert x == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("alpha", [0.0, -0.1, 1.1, math.nan])
def test_refuses_an_alpha_that_is_no_share(alpha):
    with pytest.raises(InputError, match=r"filter.alpha"):
        LowPass(alpha=alpha, rate=100.0)


def test_refuses_a_negative_time_constant():
    with pytest.raises(InputError, match="time constant is -1"):
        LowPass.of_time_constant(-1.0, 100.0)
