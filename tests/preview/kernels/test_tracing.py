"""Solids where they stand, the nearest of them along a ray, what light passes, and what beams give."""

from __future__ import annotations

import math

import numpy as np
import pytest
import warp as wp

from otwarp.preview.kernels.tracing import WAIST
from tests.preview.kernels.probes import enter_placed, trace
from tests.preview.kernels.solids import SIZE, Placed, random_rays, turned, world_of
from tests.preview.kernels.test_intersect import SURE, vectors

RAYS = 200
ROUNDING = 1e-4
"""Of a ray parameter of some ten µm in float32 through a solid that is stretched, where a ray does not graze."""

SOLIDS = [
    Placed("sphere", *turned(1, (1.5, 0.8, 1.0), (0.5, 0.0, 0.3)), opacity=0.5),
    Placed("box", *turned(2, (0.6, 0.9, 0.4), (-0.5, 1.5, 0.0)), opacity=1.0),
    Placed("tube", *turned(3, (0.8, 0.8, 1.6), (0.0, -1.6, 0.5)), opacity=0.3),
    Placed("capsule", *turned(4, (0.5, 0.5, 0.5), (1.2, 1.0, -1.0)), opacity=0.9),
]
GROUND = Placed("plane", np.diag([9.0, 9.0, 1.0]), np.array([0.0, 0.0, -1.2]))


def rays(device: str, seed: int) -> tuple[np.ndarray, np.ndarray, list[wp.array]]:
    origin, direction = random_rays(RAYS, seed)
    return origin, direction, [vectors(origin, device), vectors(direction, device)]


@pytest.mark.parametrize("index", range(5))
def test_a_solid_is_entered_where_it_stands(index: int, device: str):
    world, kept = world_of([GROUND], SOLIDS, [], device)
    solid = [GROUND, *SOLIDS][index]
    origin, direction, inputs = rays(device, seed=20 + index)
    out, hits = wp.empty(RAYS, dtype=wp.vec4, device=device), 0
    wp.launch(enter_placed, dim=RAYS, inputs=[world, index, *inputs, 0.5], outputs=[out], device=device)
    for o, d, row in zip(origin, direction, out.numpy(), strict=True):
        found = solid.entry(o, d, 0.5)
        if found.margin < SURE:
            continue
        assert (row[3] < 1e29) == np.isfinite(found.t), (o, d)
        if np.isfinite(found.t):
            hits += 1
            assert row[3] == pytest.approx(found.t, abs=ROUNDING)
            np.testing.assert_allclose(row[:3] / np.linalg.norm(row[:3]), found.normal, atol=5e-3)
    assert kept is not None and hits > RAYS / 20


def test_the_nearest_surface_and_the_light_that_passes(device: str):
    """All solids of the world against the least, and the product, of their twins."""
    world, kept = world_of([GROUND], SOLIDS, [], device)
    origin, direction, inputs = rays(device, seed=31)
    hit, index, light, gathered = (
        wp.empty(RAYS, dtype=kind, device=device) for kind in (wp.vec4, wp.int32, wp.float32, wp.vec4)
    )
    high, strength = 9.0, 0.6
    inputs = [world, *inputs, 0.0, high, strength]
    wp.launch(trace, dim=RAYS, inputs=inputs, outputs=[hit, index, light, gathered], device=device)
    shadowed, chosen = 0, []
    for o, d, row, k, passed in zip(origin, direction, hit.numpy(), index.numpy(), light.numpy(), strict=True):
        found = [solid.entry(o, d, 0.0) for solid in (GROUND, *SOLIDS)]
        if min(f.margin for f in found) < SURE or any(abs(f.t - high) < 0.01 for f in found):
            continue
        first = int(np.argmin([f.t for f in found]))
        if found[first].t > high:
            assert k == -1 and row[3] == np.float32(high)
        else:
            assert k == first and row[3] == pytest.approx(found[first].t, abs=ROUNDING)
            np.testing.assert_allclose(row[:3], found[first].normal, atol=5e-3)
            chosen.append(first)
        # infinite planes cast no shadow; opaque solids stop all, others a share of their opacity
        opacity = [s.opacity * (1.0 if s.opacity >= 0.98 else strength) for s in SOLIDS]
        share = math.prod(1.0 - a for a, f in zip(opacity, found[1:], strict=True) if f.t < high)
        assert passed == pytest.approx(share if share >= 0.02 else 0.0, abs=1e-5)
        shadowed += share < 1.0
    assert kept is not None and shadowed > RAYS / 5 and set(chosen) == set(range(5))


def beam_light(beam: Placed, o: np.ndarray, d: np.ndarray, high: float) -> tuple[float, float, float]:
    """Amount of light of a beam along a ray, in float64: I = exp(−q ρ²/w²)/w² at the place closest to its axis."""
    back = np.linalg.inv(beam.matrix)
    o, d = back @ (o - beam.shift), back @ d
    if beam.kind == "tube":
        across = max(d[0] ** 2 + d[1] ** 2, 0.05 * d[2] ** 2)
        t = -(o[0] * d[0] + o[1] * d[1]) / across
        x = o + t * d
        cone = 0.5 * (1.0 + SIZE["tube"][0]) + 0.5 * (SIZE["tube"][0] - 1.0) * x[2]
        w, rho = math.hypot(cone, float(WAIST)), x[0] ** 2 + x[1] ** 2
        s = min(max((x[2] + 1.0) / 0.45, 0.0), 1.0)
        fade = s * s * (3.0 - 2.0 * s) * (x[2] < 1.0)
    else:
        across = d @ d
        t = -(o @ d) / across
        x = o + t * d
        w, rho, fade = 1.0, x @ x, 1.0
    left = 1.0 / (1.0 + math.exp(-3.0 * (high - t) * math.sqrt(across) / w))
    return 0.75 * beam.opacity * fade * left * math.exp(-3.5 * rho / w**2) / w, t, x[2]


@pytest.mark.parametrize("kind", ["tube", "sphere"])
def test_a_beam_gives_light_by_its_gaussian(kind: str, device: str):
    beam = Placed(kind, *turned(7, (0.9, 0.9, 2.0), (0.2, -0.3, 0.4)), opacity=0.8)
    world, kept = world_of([], [], [beam], device)
    origin, direction, inputs = rays(device, seed=41)
    out = [wp.empty(RAYS, dtype=kind, device=device) for kind in (wp.vec4, wp.int32, wp.float32, wp.vec4)]
    high, bright = 6.5, 0
    wp.launch(trace, dim=RAYS, inputs=[world, *inputs, 0.0, high, 0.6], outputs=out, device=device)
    assert (out[1].numpy() == -1).all() and (out[2].numpy() == 1.0).all()
    colour = np.array([0.5, 0.4, 0.3])
    for o, d, got in zip(origin, direction, out[3].numpy(), strict=True):
        amount, t, along = beam_light(beam, o, d, high)
        if not got[3]:  # beside the box around the beam, before the ray, beyond an end, or too faint to count
            continue
        assert t > 0.0 and amount > 0.9e-4 and (kind == "sphere" or abs(along) < 1.0 + 1e-3)
        cover, core = 1.0 - math.exp(-amount), min(0.8, 0.16 * amount)
        assert got[3] == pytest.approx(cover, rel=2e-3, abs=1e-6)
        np.testing.assert_allclose(got[:3], 1.45 * cover * ((1.0 - core) * colour + core), rtol=2e-3)
        bright += amount > 0.1
    assert kept is not None and bright > RAYS / 20
