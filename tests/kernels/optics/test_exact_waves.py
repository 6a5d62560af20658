"""Waves of a focused beam seen from one point: Bessel functions times phases, and where they end."""

import numpy as np
import pytest
import warp as wp
from scipy.special import jv

from otwarp.kernels.core.exact_data import ExactData
from otwarp.kernels.optics.exact_waves import last_bessel_order, lower_waves, start_waves
from tests.kernels.samples import evaluate

ROOM = 8
EXACT = 1e-13
"""Of numbers of order 1 in float64 after some hundred recurrences."""


@wp.kernel(enable_backward=False)
def waves(
    data: ExactData,
    k_rho: wp.float64,
    k_z: wp.float64,
    top: int,
    begun: wp.array(dtype=wp.vec2d),
    wave: wp.array(dtype=wp.vec2d),
    out: wp.array2d(dtype=wp.vec2d),
):
    """G_j of all orders from `top` down to 0, (top + 1, nodes)."""
    start_waves(data, 0, ROOM, ROOM, k_rho, k_z, top, begun, wave)
    for step in range(top + 1):
        order = top - step
        for q in range(ROOM):
            out[order, q] = wave[(order % 3) * ROOM + q]
        if order > 0:
            lower_waves(ROOM, order, 0, ROOM, begun, wave)


@wp.kernel(enable_backward=False)
def orders(x: wp.array(dtype=wp.float64), out: wp.array(dtype=int)):
    out[wp.tid()] = last_bessel_order(x[wp.tid()])


@pytest.mark.parametrize(("k_rho", "k_z"), [(6.0, 1.5), (20.0, -4.0), (0.3, 0.0)])
def test_waves_are_bessel_functions_times_a_phase(k_rho, k_z, device):
    """G_j(q) = w_q exp(ikz cos t_q) J_j(kρ sin t_q), for all orders that the largest node needs."""
    t = np.linspace(0.05, 1.1, ROOM)
    weight = np.random.default_rng(0).normal(size=(ROOM, 2))
    data = ExactData()
    data.sine, data.cosine = (wp.array(v, dtype=wp.float64, device=device) for v in (np.sin(t), np.cos(t)))
    data.weight = wp.array(weight, dtype=wp.vec2d, device=device)
    top = 6
    out = wp.zeros((top + 1, ROOM), dtype=wp.vec2d, device=device)
    begun = wp.zeros(ROOM, dtype=wp.vec2d, device=device)
    wave = wp.zeros(3 * ROOM, dtype=wp.vec2d, device=device)
    given = [data, wp.float64(k_rho), wp.float64(k_z), top, begun, wave, out]
    wp.launch(waves, dim=1, inputs=given, device=device)
    got = out.numpy()[..., 0] + 1j * out.numpy()[..., 1]
    x = k_rho * np.sin(t)
    expected = (weight[:, 0] + 1j * weight[:, 1]) * np.exp(1j * k_z * np.cos(t)) * jv(np.arange(top + 1)[:, None], x)
    np.testing.assert_allclose(got, expected, atol=EXACT)


def test_beyond_the_last_order_there_is_nothing(device):
    x = np.linspace(0.01, 600.0, 400)
    (last,) = evaluate(orders, len(x), [wp.array(x, dtype=wp.float64, device=device)], [int], device)
    assert np.all(last % 2 == 0)
    assert np.abs(jv(last + 1, x)).max() < 1e-15
