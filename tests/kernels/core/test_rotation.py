"""Background flow and the exponential map of the device against their twins."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.bodies.flow import FLOW_TERMS, poiseuille_flow, shear_flow, uniform_flow
from otwarp.kernels.core.rotation import rotate_by
from otwarp.kernels.core.types import FlowData
from otwarp.scene import Flow, Scene
from otwarp.simulation.arrays import Place
from otwarp.simulation.pack_traps import pack_flow
from tests.kernels.samples import evaluate, on_device, quaternions
from tests.reference.flow import flow_at
from tests.reference.rotations import exponential, multiply

ROUNDING = 3e-6
"""float32, relative to the largest value of order 10: coordinates rotated forth, velocities back."""

QUATERNION = 3e-7
"""Some five operations on numbers below 1."""

TURN = tuple(exponential(np.array([0.3, 0.8, -0.5])))


@wp.kernel(enable_backward=False)
def probe_flow(
    flow: FlowData,
    world: int,
    point: wp.array(dtype=wp.vec3),
    uniform: wp.array(dtype=wp.spatial_vector),
    shear: wp.array(dtype=wp.spatial_vector),
    poiseuille: wp.array(dtype=wp.spatial_vector),
):
    i = wp.tid()
    a = uniform_flow(flow, world, point[i])
    b = shear_flow(flow, world, point[i])
    c = poiseuille_flow(flow, world, point[i])
    uniform[i] = wp.spatial_vector(a.linear, a.angular)
    shear[i] = wp.spatial_vector(b.linear, b.angular)
    poiseuille[i] = wp.spatial_vector(c.linear, c.angular)


@wp.kernel(enable_backward=False)
def probe_rotate(q: wp.array(dtype=wp.quat), angle: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.quat)):
    i = wp.tid()
    out[i] = rotate_by(q[i], angle[i])


@pytest.mark.parametrize("world", [0, 1])
def test_flows_are_those_of_the_twins(world, device):
    """Each world reads its own speed and shear rate."""
    speed, rate = np.array([5.0, -7.0]), np.array([0.9, 2.0])
    base = {"prim": "/World/F", "origin": (1.0, -2.0, 0.5), "orientation": TURN, "half_height": 4.0}
    data = pack_flow(Scene(flow=Flow(kind="uniform", **base)), speed, rate, Place(device))
    points = (np.random.default_rng(0).normal(size=(1000, 3)) * 4.0).astype(np.float32)
    got = evaluate(probe_flow, len(points), [data, world, *on_device(device, (points, wp.vec3))],
                   [wp.spatial_vector] * 3, device)  # fmt: skip
    assert list(FLOW_TERMS) == ["uniform", "shear", "poiseuille"]
    for kind, values in zip(FLOW_TERMS, got, strict=True):
        flow = Flow(kind=kind, speed=speed[world], shear_rate=rate[world], **base)
        expected = np.array([np.concatenate(flow_at(flow, p)) for p in points.astype(float)])
        assert np.abs(expected).max() > 1.0
        np.testing.assert_allclose(values, expected, atol=ROUNDING * np.abs(expected).max())


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
