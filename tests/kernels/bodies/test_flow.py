"""Background flow of the device against its twin, closed forms and fields that are known."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.core.types import FlowData
from otwarp.scene import Flow, Scene, Settings
from otwarp.scene.flow_grid import FlowGrid
from otwarp.scene.flow_profile import drive, flow_velocity
from otwarp.simulation.packing.arrays import Place
from otwarp.simulation.packing.flow import pack_flow
from tests.kernels.samples import evaluate, on_device
from tests.reference.flow import flow_at
from tests.reference.rotations import exponential

ROUNDING = 3e-6
"""float32, relative to the largest value of order 10: coordinates rotated forth, velocities back."""

CUT = 2e-5
"""What the terms that the series leaves out make at a side wall, relative to the largest velocity."""

TURN = tuple(exponential(np.array([0.3, 0.8, -0.5])))
BASE: dict[str, Any] = {"prim": "/World/F", "origin": (1.0, -2.0, 0.5), "orientation": TURN, "half_height": 4.0}


@functools.cache
def probe(kind: str) -> wp.Kernel:
    """Kernel that evaluates one profile at points, for spheres of `radius`."""
    term = FLOW_TERMS[kind]

    @wp.kernel(module="unique", enable_backward=False)
    def probe_flow(
        flow: FlowData,
        world: int,
        radius: float,
        point: wp.array(dtype=wp.vec3),
        out: wp.array(dtype=wp.spatial_vector),
    ):
        i = wp.tid()
        move = term(flow, world, point[i], radius)
        out[i] = wp.spatial_vector(move.linear, move.angular)

    return probe_flow


def values(scene: Scene, points: np.ndarray, device: str, *, radius: float = 0.7, speed=(), rate=(), world: int = 0):
    """(n, 6) velocity and angular velocity of the device."""
    assert scene.flow is not None
    data = pack_flow(scene, np.array(speed or [scene.flow.speed]), np.array(rate or [0.0]), Place(device))
    inputs = [data, world, radius, *on_device(device, (points.astype(np.float32), wp.vec3))]
    return evaluate(probe(scene.flow.kind), len(points), inputs, [wp.spatial_vector], device)[0].astype(float)


@pytest.mark.parametrize("world", [0, 1])
@pytest.mark.parametrize("kind", ["uniform", "shear", "poiseuille", "rectangular"])
def test_flows_are_those_of_the_twins(kind, world, device):
    """Each world reads its own speed and shear rate; the twin of the rectangular channel sums another series."""
    speed, rate = [5.0, -7.0], [0.9, 2.0]
    count = 60 if kind == "rectangular" else 1000
    points = (np.random.default_rng(0).normal(size=(count, 3)) * 4.0).astype(np.float32)
    got = values(
        Scene(flow=Flow(kind=kind, half_width=6.0, **BASE)), points, device, speed=speed, rate=rate, world=world
    )
    flow = Flow(kind=kind, speed=speed[world], shear_rate=rate[world], half_width=6.0, **BASE)
    expected = np.array([np.concatenate(flow_at(flow, p, 0.7)) for p in points.astype(float)])
    assert np.abs(expected).max() > 1.0
    # the double series of the twin converges as 1/terms in its derivatives
    atol = 2e-3 if kind == "rectangular" else ROUNDING * np.abs(expected).max()
    np.testing.assert_allclose(got, expected, atol=atol)


@pytest.mark.parametrize(("half_width", "half_height"), [(6.0, 6.0), (12.0, 6.0), (6.0, 12.0), (60.0, 6.0)])
def test_flow_rate_and_mean_velocity(half_width, half_height, device):
    """Q = 4/3·Gh³b·(1 − 192/π⁵·h/b·Σ tanh(nπb/2h)/n⁵) (White 2006, eq. 3-49), by Gauss's quadrature of the device."""
    flow = Flow(prim="/World/F", kind="rectangular", speed=30.0, half_width=half_width, half_height=half_height)
    x, w = np.polynomial.legendre.leggauss(48)
    y, z = np.meshgrid(half_width * x, half_height * x, indexing="ij")
    points = np.stack([np.zeros_like(y), y, z], -1).reshape(-1, 3)
    u = values(Scene(flow=flow), points, device, radius=0.0)[:, 0].reshape(48, 48)
    rate = half_width * half_height * float(w @ u @ w)
    h, b = min(half_width, half_height), max(half_width, half_height)
    n = np.arange(1, 200, 2)
    lost = 192.0 / np.pi**5 * h / b * float((np.tanh(0.5 * n * np.pi * b / h) / n**5).sum())
    gradient = 30.0 * drive(flow)
    assert rate == pytest.approx(4.0 / 3.0 * gradient * h**3 * b * (1.0 - lost), rel=3e-5)
    assert u.max() < 30.0
    if b == h:
        # of the square duct, tabulated: the largest velocity is 2.0962 times the mean
        assert 30.0 / (rate / (4.0 * h * b)) == pytest.approx(2.0962, abs=2e-4)


def test_no_slip_at_all_four_walls_and_faxen(device):
    """Just inside the walls nothing flows; a sphere lags behind by a²G/6; a wide channel is that of two plates."""
    flow = Flow(prim="/World/F", kind="rectangular", speed=30.0, half_width=9.0, half_height=6.0)
    along = np.linspace(-0.999, 0.999, 41)
    walls = [np.stack([0 * along, 9.0 * along, 0 * along + s * 5.99999], -1) for s in (-1, 1)]
    walls += [np.stack([0 * along, 0 * along + s * 8.99999, 6.0 * along], -1) for s in (-1, 1)]
    u = values(Scene(flow=flow), np.concatenate(walls), device, radius=0.0)[:, 0]
    assert np.abs(u).max() < 30.0 * 2.0 * CUT
    inside = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 3)) * [10.0, 7.0, 4.0]
    lag = values(Scene(flow=flow), inside, device, radius=0.0) - values(Scene(flow=flow), inside, device, radius=1.5)
    np.testing.assert_allclose(lag[:, 0], 1.5**2 / 6.0 * 30.0 * drive(flow), rtol=1e-4)
    wide = Flow(prim="/World/F", kind="rectangular", speed=30.0, half_width=600.0, half_height=6.0)
    plates = Flow(prim="/World/F", kind="poiseuille", speed=30.0, half_height=6.0)
    two = [values(Scene(flow=f), inside, device) for f in (wide, plates)]
    np.testing.assert_allclose(two[0], two[1], atol=30.0 * ROUNDING)


def field_of(velocity, low=(-3.0, -2.0, -1.0), high=(5.0, 4.0, 3.0), nodes=(9, 7, 11)) -> FlowGrid:
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, nodes, strict=True)]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    spacing = tuple(float(a[1] - a[0]) for a in axes)
    return FlowGrid(low=low, spacing=spacing, velocity=velocity(place))


def test_a_linear_field_is_exact_and_ends_at_its_last_nodes(device):
    """u = u₀ + A·x: the device's velocity and half curl, in a turned frame; 0 outside."""
    a = np.array([[0.5, 2.0, -1.0], [0.3, -0.2, 0.7], [1.1, -0.4, -0.3]])
    field = field_of(lambda p: np.array([3.0, -1.0, 2.0]) + p @ a.T)
    flow = Flow(kind="grid", field=field, **BASE)
    points = np.random.default_rng(2).uniform(-8.0, 8.0, (2000, 3))
    got = values(Scene(flow=flow), points, device)
    expected = flow_velocity(flow, points)
    near = np.linalg.norm(got[:, :3] - expected, axis=1) > 1e-4
    assert near.mean() < 0.002  # points within rounding of the last nodes
    inside = np.linalg.norm(expected, axis=1) > 0.0
    assert 0.02 < inside.mean() < 0.5
    curl = np.array([a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]])
    np.testing.assert_allclose(np.linalg.norm(got[inside & ~near, 3:], axis=1), 0.5 * np.linalg.norm(curl), rtol=1e-4)
    assert not got[~inside & ~near].any()
    assert field.divergence[1] == pytest.approx(abs(np.trace(a)), rel=1e-9)


def test_a_field_of_the_channel_is_the_channel(device):
    """Poiseuille flow sampled on 41 nodes: velocity to h²/8·u'', half curl and Faxén's a²/6·∇²u exactly."""
    plates = Flow(prim="/World/F", kind="poiseuille", speed=30.0, half_height=6.0)
    sampled = field_of(
        lambda p: flow_velocity(plates, p.reshape(-1, 3)).reshape(p.shape),
        (-4.0, -4.0, -6.0),
        (4.0, 4.0, 6.0),
        (3, 3, 41),
    )
    assert max(sampled.divergence) < 1e-12
    points = np.random.default_rng(3).uniform(-3.9, 3.9, (500, 3))
    want, got = (
        values(Scene(flow=f), points, device, radius=1.5)
        for f in (plates, Flow(prim="/World/F", kind="grid", field=sampled))
    )
    np.testing.assert_allclose(got[:, 3:], want[:, 3:], atol=1e-4)
    assert np.abs(got[:, :3] - want[:, :3]).max() <= 0.3**2 / 8.0 * 60.0 / 36.0 + 1e-4


def test_a_field_repeats_with_the_period(device):
    """Eight periods on: the same."""
    field = field_of(lambda p: np.stack([np.sin(np.pi / 4.0 * (p[..., 0] + 3.0)), p[..., 1], 0 * p[..., 2]], -1))
    flow = Flow(prim="/World/F", kind="grid", field=field)
    scene = Scene(flow=flow, settings=Settings(period=(8.0, 0.0, 0.0)))
    scene.check()
    points = np.random.default_rng(4).uniform([-3.0, -2.0, -1.0], [5.0, 4.0, 3.0], (200, 3)) * 0.99
    inside = values(scene, points, device)
    np.testing.assert_allclose(values(scene, points + np.array([64.0, 0.0, 0.0]), device), inside, atol=2e-5)
    assert np.abs(inside[:, 0]).max() > 0.9
