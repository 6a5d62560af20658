"""Terms of hydrodynamic walls against their float64 twins: fits, noise, thermal drift and flow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import WallData
from otwarp.kernels.hydrodynamics.walls import (
    entrained_excess,
    normal_excess,
    sliding_excess,
    sphere_flow_term,
    sphere_mobility_term,
    sphere_noise_term,
)
from otwarp.kernels.hydrodynamics.walls_rigid import (
    coupling_excess,
    parallel_excess,
    roll_excess,
    shear_force_excess,
    shear_torque_lack,
    spin_excess,
)
from otwarp.laws.wall_fits import (
    CONTACT_GAP,
    COUPLING,
    ENTRAINED,
    GAP_FAR,
    NORMAL,
    PARALLEL,
    ROLL,
    SHEAR_FORCE,
    SHEAR_TORQUE,
    SLIDING,
    SPIN,
)
from otwarp.simulation.packing.arrays import device_array
from tests.reference import walls as reference

ROUNDING = 2e-5
"""Of float32: a few roundings of 6e-8, amplified by 100 for gaps of 1e-2 radii that are differences of coordinates."""

KINDS = {
    "normal": (NORMAL, normal_excess), "sliding": (SLIDING, sliding_excess), "parallel": (PARALLEL, parallel_excess),
    "roll": (ROLL, roll_excess), "spin": (SPIN, spin_excess), "coupling": (COUPLING, coupling_excess),
    "shear force": (SHEAR_FORCE, shear_force_excess), "shear torque": (SHEAR_TORQUE, shear_torque_lack),
    "entrained": (ENTRAINED, entrained_excess),
}  # fmt: skip

FLOOR = (np.array([[0.0, 0.0, 1.0]]), np.array([-1.5]))
CORNER = (np.array([[0.0, 0.0, 1.0], [0.6, 0.0, -0.8], [0.0, -0.6, 0.8]]), np.array([-1.5, -6.0, -2.5]))
"""Three walls that meet at an angle."""

SPHERES = np.array([[0.0, 0.0, 0.0, 1.0], [1.9, 0.0, 0.3, 0.8], [-1.7, 0.4, 0.2, 0.7]])
"""Offsets from the prim and radii of a body of unequal, overlapping spheres [µm]."""
PLACE = np.array([0.3, 0.2, 0.35])
TURN = np.array([0.2, -0.3, 0.1, 0.9]) / np.linalg.norm([0.2, -0.3, 0.1, 0.9])


def walls_on(device: str, walls: reference.Walls, spheres: np.ndarray) -> WallData:
    """One body near `walls`."""
    data = WallData()
    data.normal = device_array(walls[0], wp.vec3, device)
    data.offset = device_array(walls[1], wp.float32, device)
    data.start = device_array([0, len(spheres)], wp.int32, device)
    data.sphere = device_array(spheres, wp.vec4, device)
    data.turned_back = device_array([0] * len(spheres), wp.int32, device)
    return data


def launch(kernel: wp.Kernel, n: int, inputs: list, outputs: list, device: str) -> list[np.ndarray]:
    """Run n threads; float64 results."""
    out = [wp.empty(n, dtype=dtype, device=device) for dtype in outputs]
    wp.launch(kernel, dim=n, inputs=[*inputs, *out], device=device)
    return [o.numpy().astype(float) for o in out]


@wp.kernel(enable_backward=False)
def all_fits(gap: wp.array(dtype=float), out: wp.array2d(dtype=wp.vec2)):
    i = wp.tid()
    g = gap[i]
    out[0, i] = normal_excess(g)
    out[1, i] = sliding_excess(g)
    out[2, i] = parallel_excess(g)
    out[3, i] = roll_excess(g)
    out[4, i] = spin_excess(g)
    out[5, i] = coupling_excess(g)
    out[6, i] = shear_force_excess(g)
    out[7, i] = shear_torque_lack(g)
    out[8, i] = entrained_excess(g)


def test_fits(device):
    """The kernel's values and slopes are those of float64, from inside a wall to a place far from it."""
    gap = np.concatenate([[-3.0, 0.0, 5e-5], np.geomspace(1.01 * CONTACT_GAP, 1e3, 60), [2.0 * GAP_FAR, 1e20]])
    gap = gap.astype(np.float32).astype(float)
    out = wp.empty((len(KINDS), len(gap)), dtype=wp.vec2, device=device)
    wp.launch(all_fits, dim=len(gap), inputs=[device_array(gap, wp.float32, device), out], device=device)
    for row, (fit, _) in zip(out.numpy(), KINDS.values(), strict=True):
        value, slope = fit(gap)
        np.testing.assert_allclose(row[:, 0], value, rtol=3e-6)
        np.testing.assert_allclose(row[:, 1], slope, rtol=2e-4, atol=1e-30)


def sphere_kernel(walls: int) -> Any:
    """Mobility, noise with drift, and flow of lone spheres near one wall or several."""
    f = Features(walls=walls)
    mobility_of, noise_of, carried = sphere_mobility_term(f), sphere_noise_term(f), sphere_flow_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate_sphere(
        data: WallData,
        position: wp.array(dtype=wp.vec3),
        kick: wp.array(dtype=wp.vec3),
        fourth: wp.array(dtype=float),
        mobility: wp.array(dtype=wp.mat33),
        move: wp.array(dtype=wp.vec3),
        flow: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        radius = data.sphere[0][3]
        mobility[i] = mobility_of(data, position[i], radius)
        move[i] = noise_of(data, position[i], radius, 0.1, kick[i], fourth[i])
        flow[i] = carried(data, position[i], radius, mobility[i], wp.vec3(3.0, 1.0, 0.0), wp.vec3(2.5, 1.0, 0.0))

    return evaluate_sphere


def evaluate_spheres(walls: reference.Walls, place, kick, fourth, device: str) -> list[np.ndarray]:
    data = walls_on(device, walls, np.array([[0.0, 0.0, 0.0, 0.8]]))
    arrays = [device_array(v, t, device) for v, t in ((place, wp.vec3), (kick, wp.vec3), (fourth, wp.float32))]
    kernel = sphere_kernel(min(len(walls[0]), 2))
    return launch(kernel, len(place), [data, *arrays], [wp.mat33, wp.vec3, wp.vec3], device)


@pytest.mark.parametrize("walls", [FLOOR, CORNER], ids=["one", "three"])
def test_lone_sphere(walls, device):
    """Mobility and flow; the noise's covariance and the mean drift, both exact for deviates of unit covariance.

    The drift is even in the deviates and quadratic, the noise odd and linear: six points ±√3 e_k have the moments of
    the normal distribution that they need.
    """
    places = np.array([[0.3, 0.2, -0.65], [0.0, 0.5, 0.4], [1.0, 1.0, 2.0]])
    kicks = np.sqrt(3.0) * np.concatenate([np.eye(3), -np.eye(3)])
    place = np.repeat(places, 6, axis=0)
    mobility, move, flow = evaluate_spheres(walls, place, np.tile(kicks, (3, 1)), np.ones(18), device)
    move = move.reshape(3, 6, 3)
    for i, p in enumerate(places):
        expected = reference.sphere_mobility(p, 0.8, walls)
        np.testing.assert_allclose(mobility[6 * i], expected, atol=ROUNDING)
        noise = 0.5 * (move[i, :3] - move[i, 3:])
        np.testing.assert_allclose(noise.T @ noise / 3.0, 0.01 * expected, atol=0.01 * ROUNDING)
        drift = move[i].mean(axis=0)
        divergence = reference.sphere_divergence(p, 0.8, walls)
        np.testing.assert_allclose(drift, 0.005 * divergence, atol=0.005 * 20.0 * ROUNDING)
        pull = reference.sphere_carried(p, 0.8, walls, np.array([3.0, 1.0, 0.0]), np.array([2.5, 1.0, 0.0]))
        np.testing.assert_allclose(flow[6 * i], pull, atol=3.0 * ROUNDING)


def test_every_deviate_of_a_lone_sphere(device):
    """Near one wall the step is the twin's for any deviates, not only in the mean."""
    rng = np.random.default_rng(3)
    place = np.array([0.0, 0.0, -0.7]) + np.abs(rng.normal(size=(20, 3)))
    kick, fourth = rng.normal(size=(20, 3)), rng.normal(size=20)
    _, move, _ = evaluate_spheres(FLOOR, place, kick, fourth, device)
    expected = [reference.sphere_move(p, 0.8, FLOOR, 0.1, k, z) for p, k, z in zip(place, kick, fourth, strict=True)]
    np.testing.assert_allclose(move, expected, atol=0.1 * ROUNDING)


@pytest.mark.parametrize("fourth", [0.0, 1.0])
def test_one_step_cannot_cross_a_wall(fourth, device):
    """In the range of lubrication the worst deviate takes the gap to no less than nothing: (√g + sξ)² + s²ζ²."""
    gap = np.repeat(np.geomspace(2e-3, 0.02, 20), 200)
    place = np.zeros((len(gap), 3))
    place[:, 2] = -1.5 + 0.8 * (1.0 + gap)
    kick = np.zeros_like(place)
    kick[:, 2] = np.tile(np.linspace(-6.0, 6.0, 200), 20)
    _, move, _ = evaluate_spheres(FLOOR, place, kick, np.full(len(gap), fourth), device)
    after = gap + move[:, 2] / 0.8
    # mobility bends down from g by 0.2 g² ln g: what the straight line misses
    assert after.min() > -3.0 * (gap**2 * -np.log(gap)).max()
    assert (after < 0.3 * gap).any()
