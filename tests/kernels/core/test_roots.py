"""Roots of the device against float64, over all sizes that a scene's squared distances can have."""

import numpy as np
import warp as wp

from otwarp.kernels.core.roots import (
    cube_root,
    direction_of,
    length_of,
    reciprocal,
    reciprocal_root,
    square_root,
)

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


@wp.kernel(enable_backward=False)
def probe_vectors(v: wp.array(dtype=wp.vec3), length: wp.array(dtype=float), direction: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    length[i] = length_of(v[i])
    direction[i] = direction_of(v[i])


def test_lengths_and_directions_are_within_a_few_roundings(device):
    rng = np.random.default_rng(5)
    v = (rng.normal(size=(20_000, 3)) * 10.0 ** rng.uniform(-12, 12, (20_000, 1))).astype(np.float32)
    v[0] = 0.0
    given = wp.array(v, dtype=wp.vec3, device=device)
    length, direction = wp.empty(len(v), dtype=float, device=device), wp.empty_like(given)
    wp.launch(probe_vectors, dim=len(v), inputs=[given], outputs=[length, direction], device=device)
    exact = np.linalg.norm(v.astype(float), axis=1)
    np.testing.assert_allclose(length.numpy(), exact, rtol=4 * SQUARE_ROOT)
    wanted = v / np.where(exact > 0.0, exact, 1.0)[:, None]
    np.testing.assert_allclose(direction.numpy(), wanted, rtol=4 * RECIPROCAL_ROOT, atol=0.0)
