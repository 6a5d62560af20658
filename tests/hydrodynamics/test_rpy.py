"""The pair tensors against an independent implementation, their limits, continuity and positive definiteness."""

from __future__ import annotations

import numpy as np
import pytest
from pygrpy import grpy_tensors

from otwarp.hydrodynamics.rpy import (
    grand_mobility,
    rotation_rotation,
    rotation_translation,
    translation_translation,
)

ROUNDING = 1e-13  # float64 rounding of polynomials of degree six, relative to the largest element


def random_spheres(seed: int, n: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Spheres at random, some overlapping, none inside another (the reference implementation refuses those)."""
    rng = np.random.default_rng(seed)
    while True:
        centres, radii = rng.normal(size=(n, 3)) * spread, rng.uniform(0.5, 1.0, n)
        distance = np.linalg.norm(centres[:, None] - centres[None], axis=-1)
        inside = distance < np.abs(radii[:, None] - radii[None, :])
        if not inside.any():
            return centres, radii


def sphere_by_sphere(matrix: np.ndarray) -> np.ndarray:
    """Reorder (all velocities, all angular velocities), as pygrpy has them, to (v_1, ω_1, v_2, …)."""
    n = len(matrix) // 6
    index = np.arange(6 * n).reshape(2, n, 3).transpose(1, 0, 2).ravel()
    return matrix[np.ix_(index, index)]


@pytest.mark.parametrize(("seed", "n", "spread"), [(0, 6, 0.7), (1, 6, 1.6), (2, 12, 4.0), (3, 2, 0.6)])
def test_agrees_with_pygrpy(seed, n, spread):
    centres, radii = random_spheres(seed, n, spread)
    ours, theirs = grand_mobility(centres, radii), sphere_by_sphere(grpy_tensors.mu(centres, radii))
    np.testing.assert_allclose(ours, theirs, atol=ROUNDING * np.abs(theirs).max(), rtol=0)


def test_immersed_translation_agrees_with_pygrpy():
    """pygrpy's translational tensors cover one sphere inside another."""
    centres, radii = np.array([[0.0, 0, 0], [0.3, 0.1, 0], [0.1, 2.0, 1.0]]), np.array([2.0, 0.5, 1.0])
    ours = grand_mobility(centres, radii).reshape(3, 6, 3, 6)[:, :3, :, :3].swapaxes(1, 2)
    np.testing.assert_allclose(ours, grpy_tensors.muTT(centres, radii), atol=1e-15)


@pytest.mark.parametrize("seed", range(6))
def test_symmetric_and_positive_definite(seed):
    rng = np.random.default_rng(seed)
    centres, radii = rng.normal(size=(15, 3)) * [0.4, 1.0, 3.0][seed % 3], rng.uniform(0.1, 2.0, 15)
    mu = grand_mobility(centres, radii)
    np.testing.assert_allclose(mu, mu.T, rtol=0, atol=ROUNDING * mu.max())
    scale = 1.0 / np.sqrt(np.diag(mu))
    assert np.linalg.eigvalsh(mu * scale[:, None] * scale[None, :])[0] > 1e-6


@pytest.mark.parametrize(
    ("ai", "aj", "r"),
    [(1.0, 1.0, 2.0), (1.0, 0.3, 1.3), (0.3, 1.0, 1.3), (1.0, 0.3, 0.7), (0.3, 1.0, 0.7), (2.0, 1.9, 0.1)],
    ids=["touch-equal", "touch-small", "touch-large", "small-inside", "large-around", "nearly-equal"],
)
def test_continuous_between_ranges(ai, aj, r):
    step = 1e-7
    below, above = np.array([r * (1 - step)]), np.array([r * (1 + step)])
    a, b = np.array([ai]), np.array([aj])
    for tensor in (translation_translation, rotation_translation, rotation_rotation):
        scale = np.abs(np.asarray(tensor(np.array([1.1]), a, b))).max()  # where all of them are far from zero
        jump = np.abs(np.asarray(tensor(below, a, b)) - np.asarray(tensor(above, a, b))).max()
        # The tensors vary by O(step) across it; a wrong branch would jump by O(1).
        assert jump < 100 * step * scale, tensor.__name__


def test_equal_spheres_become_one_as_they_merge():
    mu = grand_mobility(np.array([[0.0, 0, 0], [1e-7, 0, 0]]), np.array([1.5, 1.5])).reshape(2, 6, 2, 6)
    np.testing.assert_allclose(mu[0, :, 1, :], mu[0, :, 0, :], atol=1e-8)


def test_single_sphere():
    a = 0.7
    expected = np.diag([1 / (6 * np.pi * a)] * 3 + [1 / (8 * np.pi * a**3)] * 3)
    np.testing.assert_allclose(grand_mobility(np.zeros((1, 3)), np.array([a])), expected, rtol=1e-15)


def test_far_field_is_the_stokeslet_and_its_vorticity():
    r, force = np.array([30.0, -40.0, 120.0]), np.array([0.3, 1.0, -0.4])
    distance = np.linalg.norm(r)
    mu = grand_mobility(np.array([r, [0, 0, 0]]), np.array([0.01, 0.02])).reshape(2, 6, 2, 6)
    stokeslet = (np.eye(3) + np.outer(r, r) / distance**2) / (8 * np.pi * distance)
    rotlet = np.cross(force, r) / (8 * np.pi * distance**3)  # ½ curl of the Stokeslet
    np.testing.assert_allclose(mu[0, :3, 1, :3] @ force, stokeslet @ force, rtol=1e-7)
    np.testing.assert_allclose(mu[0, 3:, 1, :3] @ force, rotlet, rtol=1e-12)
    # A torque moves the other sphere with the rotlet T × r/8πr³.
    np.testing.assert_allclose(mu[0, :3, 1, 3:] @ force, np.cross(force, r) / (8 * np.pi * distance**3), rtol=1e-12)


def test_sphere_inside_another_is_carried_rigidly():
    """Force and torque on the large sphere move the immersed one as if it were part of it."""
    centre, rng = np.array([0.2, -0.3, 0.1]), np.random.default_rng(5)
    mu = grand_mobility(np.array([[0.0, 0, 0], centre]), np.array([1.0, 0.4])).reshape(2, 6, 2, 6)
    wrench = rng.normal(size=6)
    large, small = mu[0, :, 0, :] @ wrench, mu[1, :, 0, :] @ wrench
    np.testing.assert_allclose(small[3:], large[3:], rtol=1e-13)
    np.testing.assert_allclose(small[:3], large[:3] + np.cross(large[3:], centre), rtol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_equivariant_under_rotation_and_scale(seed):
    centres, radii = random_spheres(seed, 5, 1.0)
    rng = np.random.default_rng(seed + 50)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    big = np.kron(np.eye(10), rotation)
    mu = grand_mobility(centres, radii)
    np.testing.assert_allclose(grand_mobility(centres @ rotation.T, radii), big @ mu @ big.T, atol=1e-14)
    length = 3.0
    units = np.tile([1, 1, 1, length, length, length], 5)  # lengths in an angular velocity or torque
    np.testing.assert_allclose(grand_mobility(centres * length, radii * length) * length * np.outer(units, units), mu)
