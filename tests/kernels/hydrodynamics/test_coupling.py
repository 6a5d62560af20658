"""The pair tensors and the factorisation of coupled bodies against float64, and what both must obey."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.hydrodynamics.rpy import grand_mobility, translation_translation
from otwarp.kernels.hydrodynamics.coupling import block_count, factorise_blocks, pair_mobility
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


def factor(blocks: wp.array, bodies: int) -> np.ndarray:
    """(3·bodies, 3·bodies) factor of a matrix whose lower blocks are given; they are overwritten."""

    @wp.kernel(module="unique")
    def factor_kernel(out: wp.array(dtype=wp.mat33)):
        root = wp.zeros(shape=(wp.static(block_count(bodies)),), dtype=wp.mat33)
        for i in range(wp.static(block_count(bodies))):
            root[i] = out[i]  # pyright: ignore[reportIndexIssue]
        factorise_blocks(wp.static(bodies), root)
        for i in range(wp.static(block_count(bodies))):
            out[i] = root[i]

    wp.launch(factor_kernel, dim=1, inputs=[blocks], device=blocks.device)
    found = iter(blocks.numpy().astype(float))
    root = np.zeros((3 * bodies, 3 * bodies))
    for i in range(bodies):
        for j in range(i + 1):
            root[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = next(found)
    return root


def translations(places: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(3n, 3n) translational mobility of spheres at `places`."""
    n = len(radii)
    return grand_mobility(places, radii).reshape(n, 6, n, 6)[:, :3, :, :3].reshape(3 * n, 3 * n)


def pairs(n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) and (n, 2): apart, overlapping, one inside the other; unequal and equal radii."""
    rng = np.random.default_rng(5)
    radii = rng.uniform(0.3, 2.0, (n, 2))
    radii[::3, 1] = radii[::3, 0]
    way = rng.normal(size=(n, 3))
    way *= (rng.uniform(0.02, 3.0, n) * radii.sum(1) / np.linalg.norm(way, axis=1))[:, None]
    return way.astype(np.float32).astype(float), radii.astype(np.float32).astype(float)


@pytest.mark.thorough
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
    count = len(matrix) // 3
    return np.array([matrix[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] for i in range(count) for j in range(i + 1)])


@pytest.mark.parametrize("spread", [3.0, 0.7], ids=["apart and touching", "overlapping"])
def test_factor(spread, device):
    """L Lᵀ gives the matrix back; condition numbers up to 1e3 lose nothing that matters of float32."""
    rng = np.random.default_rng(3)
    matrix = translations(spread * rng.normal(size=(BODIES, 3)), rng.uniform(0.5, 1.5, BODIES))
    (blocks,) = on_device(device, (lower_blocks(matrix), wp.mat33))
    root = factor(blocks, BODIES)
    assert np.all(np.triu(root, 1) == 0.0)
    np.testing.assert_allclose(root @ root.T, matrix, atol=FLOAT32 * np.abs(matrix).max())


@pytest.mark.parametrize("bodies", [BODIES, 24])
@pytest.mark.parametrize("spread", [0.0, 1e-7, 1e-6, 1e-5, 1e-3])
def test_factor_of_spheres_at_nearly_one_place(bodies, spread, device):
    """Rounding may be all that is left of most pivots; the product is the matrix none the less."""
    rng = np.random.default_rng(3)
    for scale in rng.uniform(1e-3, 1.0, 3):
        matrix = scale * translations(spread * rng.normal(size=(bodies, 3)), np.ones(bodies))
        (blocks,) = on_device(device, (lower_blocks(matrix), wp.mat33))
        root = factor(blocks, bodies)
        np.testing.assert_allclose(root @ root.T, matrix, atol=FLOAT32 * np.abs(matrix).max())
