"""Roots of the device against float64, over all sizes that a scene's squared distances can have."""

import numpy as np
import warp as wp

from otwarp.kernels.core.roots import cube_root, reciprocal, reciprocal_root, square_root

SQUARE_ROOT = RECIPROCAL = 2.0**-23
CUBE_ROOT = 2.0**-21
RECIPROCAL_ROOT = 2.0**-22.4
"""Largest relative errors of PTX `sqrt.approx`, `rcp.approx` and `rsqrt.approx` (PTX ISA); a CPU stays below them."""


@wp.kernel(enable_backward=False)
def probe(
    x: wp.array(dtype=float), root: wp.array(dtype=float), over_root: wp.array(dtype=float),
    over: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    root[i] = square_root(x[i])
    over_root[i] = reciprocal_root(x[i])
    over[i] = reciprocal(x[i])


def test_roots_are_within_their_bounds(device):
    rng = np.random.default_rng(0)
    x = np.concatenate([10.0 ** rng.uniform(-30, 30, 20_000), rng.uniform(1.0, 4.0, 20_000)]).astype(np.float32)
    out = [wp.empty(len(x), dtype=float, device=device) for _ in range(3)]
    wp.launch(probe, dim=len(x), inputs=[wp.array(x, dtype=float, device=device), *out], device=device)
    root, over_root, over = (o.numpy() for o in out)
    exact = np.sqrt(x.astype(float))
    np.testing.assert_allclose(root, exact, rtol=SQUARE_ROOT)
    np.testing.assert_allclose(over_root, 1.0 / exact, rtol=RECIPROCAL_ROOT)
    np.testing.assert_allclose(over, 1.0 / x.astype(float), rtol=RECIPROCAL)


@wp.kernel(enable_backward=False)
def probe_cube(x: wp.array(dtype=float), root: wp.array(dtype=float)):
    i = wp.tid()
    root[i] = cube_root(x[i])


def test_cube_roots_are_within_their_bound(device):
    x = (10.0 ** np.random.default_rng(0).uniform(-36, 36, 40_000)).astype(np.float32)
    root = wp.empty(len(x), dtype=float, device=device)
    wp.launch(probe_cube, dim=len(x), inputs=[wp.array(x, dtype=float, device=device), root], device=device)
    np.testing.assert_allclose(root.numpy(), np.cbrt(x.astype(float)), rtol=CUBE_ROOT)


def test_root_of_zero_is_zero(device):
    out = [wp.empty(1, dtype=float, device=device) for _ in range(3)]
    wp.launch(probe, dim=1, inputs=[wp.zeros(1, dtype=float, device=device), *out], device=device)
    assert [float(o.numpy()[0]) for o in out] == [0.0, np.inf, np.inf]
