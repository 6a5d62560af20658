"""The pair tensors and the factorisation of coupled bodies against float64, and what both must obey."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.hydrodynamics.rpy import grand_mobility, translation_translation
from otwarp.kernels.coupling import block_at, block_count, factorise_blocks, pair_mobility
from tests.kernels.samples import on_device
from tests.reference import coupling as reference

FLOAT32 = 3e-6
"""Relative error of a dozen float32 operations."""
QUADRATURE = 1e-9
"""Error of the surface average, whose integrand has square roots at its ends at worst."""
BODIES = 6


@wp.kernel(module="unique")
def pair_kernel(way: wp.array(dtype=wp.vec3), radii: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.mat33)):
    i = wp.tid()
    out[i] = pair_mobility(way[i], radii[i][0], radii[i][1])


@wp.kernel(module="unique")
def factor_kernel(out: wp.array(dtype=wp.mat33)):
    root = wp.zeros(shape=(wp.static(block_count(BODIES)),), dtype=wp.mat33)
    for i in range(wp.static(block_count(BODIES))):
        root[i] = out[i]  # pyright: ignore[reportIndexIssue]
    factorise_blocks(BODIES, root)
    for i in range(wp.static(block_count(BODIES))):
        out[i] = root[i]


def pairs(n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) and (n, 2): apart, overlapping, one inside the other; unequal and equal radii."""
    rng = np.random.default_rng(5)
    radii = rng.uniform(0.3, 2.0, (n, 2))
    radii[::3, 1] = radii[::3, 0]
    way = rng.normal(size=(n, 3))
    way *= (rng.uniform(0.02, 3.0, n) * radii.sum(1) / np.linalg.norm(way, axis=1))[:, None]
    return way.astype(np.float32).astype(float), radii.astype(np.float32).astype(float)


def test_pair_tensor(device):
    """The kernel against the surface average, in all ranges; and at one place."""
    way, radii = pairs()
    way[0] = 0.0
    inputs = on_device(device, (way, wp.vec3), (radii, wp.vec2))
    out = wp.zeros(len(way), dtype=wp.mat33, device=device)
    wp.launch(pair_kernel, dim=len(way), inputs=[*inputs, out], device=device)
    for found, w, (a, b) in zip(out.numpy().astype(float), way, radii, strict=True):
        expected = reference.pair_mobility(w, a, b)
        np.testing.assert_allclose(found, expected, atol=FLOAT32 * abs(expected).max())


def test_twin_agrees_with_the_hydrodynamics_room():
    """The average of the definition against the closed forms (Zuk et al. 2014), which share no line."""
    for way, (a, b) in zip(*pairs(100), strict=True):
        r = float(np.linalg.norm(way))
        p, q = (float(v) for v in translation_translation(np.array(r), np.array(a), np.array(b)))
        expected = p * np.eye(3) + q * np.outer(way, way) / r**2
        np.testing.assert_allclose(reference.pair_mobility(way, a, b), expected, atol=QUADRATURE)


def test_pair_tensor_has_no_divergence():
    """Apart, overlapping and inside: the noise needs no drift. Differences of differences leave 1e-6."""
    for way, (a, b) in zip(*pairs(21), strict=True):
        scale = np.abs(reference.pair_mobility(way, a, b)).max() / min(a, b)
        assert np.abs(reference.divergence(way, a, b)).max() < 1e-6 * scale


def lower_blocks(matrix: np.ndarray) -> np.ndarray:
    """Blocks of the lower triangle, row by row."""
    return np.array([matrix[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] for i in range(BODIES) for j in range(i + 1)])


@pytest.mark.parametrize("spread", [3.0, 0.7], ids=["apart and touching", "overlapping"])
def test_factor(spread, device):
    """L Lᵀ gives the matrix back; condition numbers up to 1e3 lose nothing that matters of float32."""
    rng = np.random.default_rng(3)
    whole = grand_mobility(spread * rng.normal(size=(BODIES, 3)), rng.uniform(0.5, 1.5, BODIES))
    matrix = whole.reshape(BODIES, 6, BODIES, 6)[:, :3, :, :3].reshape(3 * BODIES, 3 * BODIES)
    (blocks,) = on_device(device, (lower_blocks(matrix), wp.mat33))
    wp.launch(factor_kernel, dim=1, inputs=[blocks], device=device)
    root = np.zeros_like(matrix)
    found = iter(blocks.numpy().astype(float))
    for i in range(BODIES):
        for j in range(i + 1):
            root[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = next(found)
    assert np.all(np.triu(root, 1) == 0.0)
    np.testing.assert_allclose(root @ root.T, matrix, atol=FLOAT32 * np.abs(matrix).max())


def test_factor_of_spheres_at_one_place(device):
    """A singular matrix has a finite factor, and its spheres move as one to √PIVOT."""
    matrix = np.kron(np.ones((BODIES, BODIES)), np.eye(3))
    (blocks,) = on_device(device, (lower_blocks(matrix), wp.mat33))
    wp.launch(factor_kernel, dim=1, inputs=[blocks], device=device)
    found = blocks.numpy()
    assert np.all(np.isfinite(found))
    np.testing.assert_allclose(found[[block_index(i, 0) for i in range(BODIES)]], [np.eye(3)] * BODIES, atol=1e-6)


def block_index(i: int, j: int) -> int:
    """As `block_at`, on the host."""
    return int(block_at.func(i, j))
