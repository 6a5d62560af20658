"""Roots of the device against float64, over all sizes that a scene's squared distances can have."""

import numpy as np
import warp as wp

from otwarp.kernels.core.roots import reciprocal_root, square_root

SQUARE_ROOT = 2.0**-23
RECIPROCAL_ROOT = 2.0**-22.4
"""Largest relative errors of PTX `sqrt.approx` and `rsqrt.approx` (PTX ISA); a CPU stays below them."""


@wp.kernel(enable_backward=False)
def probe(x: wp.array(dtype=float), root: wp.array(dtype=float), reciprocal: wp.array(dtype=float)):
    i = wp.tid()
    root[i] = square_root(x[i])
    reciprocal[i] = reciprocal_root(x[i])


def test_roots_are_within_their_bounds(device):
    rng = np.random.default_rng(0)
    x = np.concatenate([10.0 ** rng.uniform(-30, 30, 20_000), rng.uniform(1.0, 4.0, 20_000)]).astype(np.float32)
    root, reciprocal = (wp.empty(len(x), dtype=float, device=device) for _ in range(2))
    wp.launch(probe, dim=len(x), inputs=[wp.array(x, dtype=float, device=device), root, reciprocal], device=device)
    exact = np.sqrt(x.astype(float))
    np.testing.assert_allclose(root.numpy(), exact, rtol=SQUARE_ROOT)
    np.testing.assert_allclose(reciprocal.numpy(), 1.0 / exact, rtol=RECIPROCAL_ROOT)


def test_root_of_zero_is_zero(device):
    out, reciprocal = (wp.empty(1, dtype=float, device=device) for _ in range(2))
    wp.launch(probe, dim=1, inputs=[wp.zeros(1, dtype=float, device=device), out, reciprocal], device=device)
    assert out.numpy()[0] == 0.0
    assert reciprocal.numpy()[0] == np.inf
