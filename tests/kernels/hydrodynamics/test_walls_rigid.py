"""Rigid bodies near hydrodynamic walls against their float64 twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import warp as wp

from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import Pose, WallData, mat66, vec6
from otwarp.kernels.hydrodynamics.walls_rigid import (
    body_noise_term,
    body_root_term,
)
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.hydrodynamics.test_walls import CORNER, FLOOR, PLACE, ROUNDING, SPHERES, TURN, launch, walls_on
from tests.reference import walls as reference


@pytest.fixture(scope="module")
def body() -> tuple[np.ndarray, np.ndarray]:
    """Spheres about the centre of diffusion, and R_free."""
    free = body_mobility(SPHERES[:, :3], SPHERES[:, 3])
    return SPHERES - np.append(free.reference, 0.0), free.resistance


@pytest.fixture(scope="module")
def body_kernel() -> Any:
    f = Features(walls=1, rigid=True, spheres=False)
    root_of, noise_of = body_root_term(f), body_noise_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate_body(
        free: wp.array(dtype=mat66),
        data: WallData,
        position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat),
        kick: wp.array(dtype=vec6),
        seventh: wp.array(dtype=float),
        mobility: wp.array(dtype=mat66),
        move: wp.array(dtype=vec6),
    ):
        i = wp.tid()
        pose = Pose(position[i], rotation[i])
        root = root_of(free[0], data, 0, pose)
        mobility[i] = wp.transpose(root) * root
        move[i] = noise_of(data, 0, pose, root, 0.1, kick[i], seventh[i])

    return evaluate_body


@pytest.mark.parametrize("walls", [FLOOR, CORNER], ids=["one", "three"])
def test_rigid_body(walls, body, body_kernel, device):
    """Mobility; the noise's covariance and the mean drift, the divergence of the mobility on the group of motions.

    Twelve points ±√6 e_k have the moments of normal deviates that linear and quadratic terms need.
    """
    spheres, free = body
    kicks = np.sqrt(6.0) * np.concatenate([np.eye(6), -np.eye(6)])
    rows = [(np.tile(PLACE, (12, 1)), wp.vec3), (np.tile(TURN, (12, 1)), wp.quat), (kicks, vec6)]
    inputs = [device_array(v, t, device) for v, t in [*rows, (np.ones(12), wp.float32)]]
    data = walls_on(device, walls, spheres)
    mobility, move = launch(
        body_kernel, 12, [device_array(free[None], mat66, device), data, *inputs], [mat66, vec6], device
    )
    expected = reference.body_mobility(free, spheres, PLACE, TURN, walls)
    largest = np.abs(expected).max()
    np.testing.assert_allclose(mobility[0], expected, atol=ROUNDING * largest)
    noise = 0.5 * (move[:6] - move[6:])
    np.testing.assert_allclose(noise.T @ noise / 6.0, 0.01 * expected, atol=0.01 * ROUNDING * largest)
    divergence = reference.body_divergence(free, spheres, PLACE, TURN, walls)
    assert np.abs(divergence).min() > 50.0 * ROUNDING * np.abs(divergence).max()
    np.testing.assert_allclose(
        move.mean(axis=0), 0.005 * divergence, atol=0.005 * 10.0 * ROUNDING * np.abs(divergence).max()
    )


def test_a_body_of_one_sphere_is_a_sphere(body_kernel, device):
    """Its 6×6 step, over all turns, moves like the lone sphere's 3×3 one: mobility and drift agree with the fits."""
    radius, gap = 0.8, 0.05
    free = body_mobility(np.zeros((1, 3)), np.array([radius])).resistance
    place = np.array([[0.0, 0.0, -1.5 + radius * (1.0 + gap)]])
    rows = [(place, wp.vec3), (TURN[None], wp.quat), (np.zeros((1, 6)), vec6), (np.array([np.sqrt(2.0)]), wp.float32)]
    inputs = [device_array(v, t, device) for v, t in rows]
    data = walls_on(device, FLOOR, np.array([[0.0, 0.0, 0.0, radius]]))
    _, move = launch(body_kernel, 1, [device_array(free[None], mat66, device), data, *inputs], [mat66, vec6], device)
    divergence = reference.sphere_divergence(place[0], radius, FLOOR) / (6.0 * np.pi * radius)
    # in the body's axes; ξ = 0 and ζ² = 2 have the mean factor
    normal = reference.matrix(TURN).T @ np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(move[0, :3], 0.005 * divergence[2] * normal, atol=0.005 * ROUNDING)
    np.testing.assert_allclose(move[0, 3:], 0.0, atol=0.005 * ROUNDING)
