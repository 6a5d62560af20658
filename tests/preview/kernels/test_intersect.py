"""Where rays enter canonical solids, against twins that only know what is inside."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from tests.preview.kernels.probes import enter_canonical, enter_triangles
from tests.preview.kernels.solids import KINDS, SIZE, entry, random_rays

RAYS = 400
ROUNDING = 2e-5
"""Of a ray parameter of some µm in float32, where a ray does not graze."""
SURE = 5e-3
"""Margin from which on samples of a ray say without doubt whether it enters."""


def vectors(rows: np.ndarray, device: str, dtype=wp.vec3) -> wp.array:
    return wp.array(rows.astype(np.float32), dtype=dtype, device=device)


@pytest.mark.parametrize("low", [0.0, 6.0])
@pytest.mark.parametrize("kind", SIZE)
def test_rays_enter_where_the_twin_does(kind: str, low: float, device: str):
    origin, direction = random_rays(RAYS, seed=KINDS[kind])
    out = wp.empty(RAYS, dtype=wp.vec4, device=device)
    inputs = [KINDS[kind], wp.vec2(*SIZE[kind]), vectors(origin, device), vectors(direction, device), low]
    wp.launch(enter_canonical, dim=RAYS, inputs=inputs, outputs=[out], device=device)
    hits = hit_and_missed = 0
    for o, d, row in zip(origin, direction, out.numpy(), strict=True):
        found = entry(kind, o, d, low)
        if found.margin < SURE:
            continue
        assert (row[3] < 1e29) == np.isfinite(found.t), (o, d)
        if np.isfinite(found.t):
            hits += 1
            assert row[3] == pytest.approx(found.t, abs=ROUNDING)
            normal = row[:3] / np.linalg.norm(row[:3])
            np.testing.assert_allclose(normal, found.normal, atol=2e-3)
            assert normal @ d < 0.0
        else:
            hit_and_missed += 1
    # from within a solid there is no way to enter a convex one
    assert hit_and_missed > RAYS / 10 and (hits > RAYS / 10 or low > 0.0)


def moller_trumbore(o: np.ndarray, d: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parameter t, and weights of the second and third corner, of a ray and (n, 3, 3) triangles.

    T. Möller and B. Trumbore 1997, doi:10.1080/10867651.1997.10487468.
    """
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p, s = np.cross(d, b), o - corners[:, 0]
    det = np.einsum("ni,ni->n", a, p)
    q = np.cross(s, a)
    u, v = np.einsum("ni,ni->n", s, p) / det, q @ d / det
    inside = (u > 0.0) & (v > 0.0) & (u + v < 1.0)
    return np.where(inside, np.einsum("ni,ni->n", b, q) / det, np.nan), u, v


def test_a_mesh_is_seen_from_both_sides_with_the_normal_between_its_corners(device: str):
    rng = np.random.default_rng(5)
    corners = rng.uniform(-2.0, 2.0, (12, 3, 3))
    normals = rng.normal(size=(12, 3, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    first = 6  # the corners of another mesh come before
    mesh = wp.Mesh(
        points=vectors(corners.reshape(-1, 3), device), indices=wp.array(np.arange(36, dtype=np.int32), device=device)
    )
    corner = vectors(np.concatenate([np.zeros((first, 3)), normals.reshape(-1, 3)]), device)
    origin, direction = random_rays(RAYS, seed=9)
    out, low = wp.empty(RAYS, dtype=wp.vec4, device=device), 5.0
    inputs = [mesh.id, corner, first, vectors(origin, device), vectors(direction, device), low]
    wp.launch(enter_triangles, dim=RAYS, inputs=inputs, outputs=[out], device=device)
    met, from_behind = 0, 0
    for o, d, row in zip(origin, direction, out.numpy(), strict=True):
        t, u, v = moller_trumbore(o, d, corners)
        t = np.where(t > low, t, np.nan)
        if np.isnan(t).all():
            assert row[3] > 1e29
            continue
        k = int(np.nanargmin(t))
        assert row[3] == pytest.approx(t[k], abs=ROUNDING)
        n = (1.0 - u[k] - v[k]) * normals[k, 0] + u[k] * normals[k, 1] + v[k] * normals[k, 2]
        from_behind += bool(n @ d > 0.0)
        met += 1
        np.testing.assert_allclose(row[:3], -np.sign(n @ d) * n, atol=1e-3)
    assert met > RAYS / 5 and 0 < from_behind < met
