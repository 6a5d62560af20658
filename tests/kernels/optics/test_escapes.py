"""Escapes between steps: how often a path that ends inside has been out."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.optics.escapes import NEAR, crossed
from tests.kernels.samples import evaluate

SPREAD, REACH = 0.1, 1.5


@wp.kernel(enable_backward=False)
def probe(before: float, after: float, out: wp.array(dtype=float)):
    i = wp.tid()
    s2 = wp.float32(SPREAD * SPREAD)
    lost = crossed(wp.uint32(9), i % 7, 2, wp.int64(i), wp.float32(REACH), before * before, after * after, s2)
    out[i] = wp.where(lost, 1.0, 0.0)


@pytest.mark.parametrize(("first", "second"), [(0.0, 1.0), (0.3, 0.3), (0.5, 1.0), (1.0, 1.5), (NEAR, NEAR)])
def test_crossings_are_as_likely_as_the_bridge_has_them(first, second, device):
    """exp(−2 d₀ d₁/s²) of the distances from the boundary; standard error below 0.0025 in 40 000 draws, 5σ."""
    n = 40_000
    (lost,) = evaluate(probe, n, [REACH - first * SPREAD, REACH - second * SPREAD], [float], device)
    share = np.exp(-2.0 * first * second)
    assert abs(lost.mean() - share) <= 5.0 * np.sqrt(share * (1.0 - share) / n) + 1e-4
