"""Background flow of the device against its twin."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.bodies.flow import FLOW_TERMS, poiseuille_flow, shear_flow, uniform_flow
from otwarp.kernels.core.types import FlowData
from otwarp.scene import Flow, Scene
from otwarp.simulation.packing.arrays import Place
from otwarp.simulation.packing.traps import pack_flow
from tests.kernels.samples import evaluate, on_device
from tests.reference.flow import flow_at
from tests.reference.rotations import exponential

ROUNDING = 3e-6
"""float32, relative to the largest value of order 10: coordinates rotated forth, velocities back."""


RADIUS = wp.constant(0.7)

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
    a = uniform_flow(flow, world, point[i], RADIUS)
    b = shear_flow(flow, world, point[i], RADIUS)
    c = poiseuille_flow(flow, world, point[i], RADIUS)
    uniform[i] = wp.spatial_vector(a.linear, a.angular)
    shear[i] = wp.spatial_vector(b.linear, b.angular)
    poiseuille[i] = wp.spatial_vector(c.linear, c.angular)


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
        expected = np.array([np.concatenate(flow_at(flow, p, 0.7)) for p in points.astype(float)])
        assert np.abs(expected).max() > 1.0
        np.testing.assert_allclose(values, expected, atol=ROUNDING * np.abs(expected).max())
