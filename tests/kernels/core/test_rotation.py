"""The exponential map of the device against its twin."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.rotation import rotate_by
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference.rotations import exponential, multiply

QUATERNION = 3e-7
"""Some five operations on numbers below 1."""


@wp.kernel(enable_backward=False)
def probe_rotate(q: wp.array(dtype=wp.quat), angle: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.quat)):
    i = wp.tid()
    out[i] = rotate_by(q[i], angle[i])


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-5, 9.9e-4, 1.01e-3, 0.1, 1.0, 3.0, 3.2, 6.0])
def test_rotation_is_the_exponential_map(size, device):
    rng = np.random.default_rng(1)
    q = quaternions(rng, 200)
    way = rng.normal(size=(200, 3))
    angle = (size * way / np.linalg.norm(way, axis=1, keepdims=True)).astype(np.float32)
    (got,) = evaluate(probe_rotate, 200, on_device(device, (q, wp.quat), (angle, wp.vec3)), [wp.quat], device)
    expected = np.array(
        [multiply(exponential(a), p) for a, p in zip(angle.astype(float), q.astype(float), strict=True)]
    )
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    # √(1 − sin²) loses digits where the half turn is near 90°, and only there
    tolerance = QUATERNION if abs(size - np.pi) > 0.5 else 2e-5
    np.testing.assert_allclose(got, expected, atol=tolerance)
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1.0, atol=QUATERNION)
