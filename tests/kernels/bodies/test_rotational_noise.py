"""Thermal rotation in one step: against the twin, and against the closed forms of rotational diffusion."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from scipy.linalg import expm

from otwarp.kernels.bodies.rotational_noise import turned_along, turning_root, turning_variance
from otwarp.kernels.core.types import vec6
from tests.kernels.samples import evaluate, on_device
from tests.reference.body import thermal_move, turning_variances
from tests.reference.rotations import exponential, matrix

ROUNDING = 2e-6
"""float32: a dozen products of numbers below 1."""

GENERATORS = np.array([[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]],
                       [[0, -1, 0], [1, 0, 0], [0, 0, 0]]], dtype=float)  # fmt: skip


@wp.kernel(enable_backward=False)
def probe(
    factor: wp.array(dtype=wp.mat33),
    below: wp.array(dtype=wp.mat33),
    linear: wp.array(dtype=wp.vec3),
    variance: wp.array(dtype=wp.mat33),
    root: wp.array(dtype=vec6),
    turned: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    c = factor[i]
    variance[i] = turning_variance(c * wp.transpose(c))
    root[i] = turning_root(below[i], vec6(c[0, 0], c[1, 1], c[2, 2], c[1, 0], c[2, 0], c[2, 1]))
    turned[i] = turned_along(linear[i], linear[i] * 0.3 + wp.vec3(0.2, -0.1, 0.4))


def test_kernels_are_those_of_the_twin(device):
    rng, n = np.random.default_rng(0), 50
    factor = np.tril(rng.normal(size=(n, 3, 3)) * 0.15 + 0.6 * np.eye(3)).astype(np.float32)
    below = (0.1 * rng.normal(size=(n, 3, 3))).astype(np.float32)
    linear = rng.normal(size=(n, 3)).astype(np.float32)
    given = on_device(device, (factor, wp.mat33), (below, wp.mat33), (linear, wp.vec3))
    variance, root, turned = evaluate(probe, n, given, [wp.mat33, vec6, wp.vec3], device)
    for k in range(n):
        c, b = factor[k].astype(float), below[k].astype(float)
        s, axes = np.linalg.eigh(c @ c.T)
        np.testing.assert_allclose(variance[k], (axes * turning_variances(s)) @ axes.T, atol=ROUNDING)
        full = np.block([[np.eye(3), np.zeros((3, 3))], [b, c]])
        columns = np.array([thermal_move(full, e)[3:] for e in np.eye(6)[3:]]).T
        np.testing.assert_allclose(root[k], columns[[0, 1, 2, 1, 2, 2], [0, 1, 2, 0, 0, 1]], atol=3 * ROUNDING)
        w = 0.3 * linear[k].astype(float) + [0.2, -0.1, 0.4]
        angle = np.linalg.norm(w)
        expected = matrix(exponential(2.0 * np.arctan(angle / np.sqrt(8.0)) / angle * w)) @ linear[k]
        np.testing.assert_allclose(turned[k], expected, atol=3 * ROUNDING)


def test_a_step_that_is_much_too_long_keeps_the_factor_that_it_has(device):
    """Σ' of 2 D_r dt = 100 is negative; nothing becomes NaN."""
    factor = np.array([10.0 * np.eye(3)], dtype=np.float32)
    given = on_device(device, (factor, wp.mat33), (0.0 * factor, wp.mat33), (np.zeros((1, 3)), wp.vec3))
    _, root, _ = evaluate(probe, 1, given, [wp.mat33, vec6, wp.vec3], device)
    np.testing.assert_array_equal(root[0], [10, 10, 10, 0, 0, 0])


def gaussian_rotations(variances: np.ndarray, part: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Weights (n,) and matrices (n, 3, 3) of Gaussian rotation vectors, by quadrature."""
    x, w = np.polynomial.hermite_e.hermegauss(16)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel() / w.sum() ** 3
    vectors = part * grid * np.sqrt(variances)
    return weight, np.array([matrix(exponential(v)) for v in vectors])


@pytest.mark.parametrize("shape", [(1.0, 1.0, 1.0), (0.5, 0.5, 1.0), (0.3, 0.6, 1.0)])
def test_orientations_decorrelate_as_rotational_diffusion_says(shape):
    """⟨n(0)·n(t)⟩ = e^{−(D_i + D_j) t} of axis k after a step, to third order; without Σ' only to first."""
    left = []
    for scale in (0.2, 0.1):
        s = scale * np.array(shape)
        exact = np.exp(-0.5 * (s.sum() - s))
        for variances in (turning_variances(s), s):
            weight, turns = gaussian_rotations(variances)
            left.append(np.abs(np.log(np.einsum("n,nkk->k", weight, turns)) / np.log(exact) - 1.0).max())
    assert left[0] < 0.003 < 0.01 < left[1]
    assert left[2] < 0.3 * left[0]  # second order: a quarter
    assert left[3] > 0.4 * left[1]  # first: half


def test_displacements_of_a_step_are_those_of_axes_that_turn_meanwhile():
    """⟨Δx Δxᵀ⟩ = 2 ∫ ⟨R D Rᵀ⟩ dt with D along the axis 1.8 times that across; the frozen axes are 8 % off."""
    s, diffusion = np.array([0.2, 0.2, 0.8]), np.diag([1.0, 1.0, 1.8])
    one = np.eye(3)
    turning = sum(
        0.5 * v * np.linalg.matrix_power(np.kron(x, one) - np.kron(one, x.T), 2)
        for v, x in zip(s, GENERATORS, strict=True)
    )
    exact = np.mean([expm(turning * t) @ diffusion.ravel() for t in (np.arange(50) + 0.5) / 50], axis=0)
    weight, turns = gaussian_rotations(turning_variances(s), np.sqrt(0.5))
    found = np.einsum("n,nij,jk,nlk->il", weight, turns, diffusion, turns).ravel()
    np.testing.assert_allclose(np.diag(found.reshape(3, 3)), np.diag(exact.reshape(3, 3)), rtol=0.006)
    assert 1.8 / exact[8] > 1.07
