"""Colours of surface points against NumPy, and against what light obeys: Lambert's law, shadows, view factors."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.preview.kernels.shading import Light, Studio
from otwarp.preview.kernels.tracing import TracedSolid
from tests.preview.kernels.probes import numbers, shade
from tests.preview.kernels.solids import KINDS, Placed, world_of
from tests.preview.kernels.test_intersect import vectors

SPOTS = 64
SKY, GROUND = np.array([0.3, 0.35, 0.4]), np.array([0.1, 0.08, 0.06])
COLOUR, ROUGHNESS = np.array([0.5, 0.4, 0.3]), 0.4
RIGHT, ZENITH = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
FLOAT32 = 2e-4
"""Relative error of powers up to 60 in float32."""


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def smooth(a: float, b: float, x: np.ndarray) -> np.ndarray:
    s = np.clip((x - a) / (b - a), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


def environment(u: np.ndarray) -> np.ndarray:
    base = GROUND + smooth(-0.35, 0.6, u @ ZENITH)[..., None] * (SKY - GROUND)
    return base + 1.3 * smooth(0.55, 0.95, u @ unit(ZENITH - 0.5 * RIGHT))[..., None] * SKY


def studio_of(lights: list[tuple[np.ndarray, bool, bool, np.ndarray]], device: str, rays: int = 0):
    studio, rows = Studio(), np.zeros(len(lights), dtype=Light.numpy_dtype())
    for row, (vector, distant, shadows, irradiance) in zip(rows, lights, strict=True):
        row["vector"], row["distant"], row["shadows"], row["irradiance"] = vector, distant, shadows, irradiance
    studio.lights, studio.light_count = wp.array(rows, dtype=Light, device=device), len(lights)
    studio.right, studio.zenith = wp.vec3(*RIGHT), wp.vec3(*ZENITH)
    studio.sky, studio.ground = wp.vec3(*SKY), wp.vec3(*GROUND)
    studio.occlusion_rays, studio.occlusion_reach = rays, 50.0
    studio.centre, studio.fade = wp.vec3(0.0), 8.0
    return studio


def solid_of(kind: str, opacity: float, size: float = 1.0):
    solid = TracedSolid()
    solid.kind, solid.size, solid.opacity, solid.roughness = KINDS[kind], wp.vec2(size, size), opacity, ROUGHNESS
    solid.colour = wp.vec3(*COLOUR)
    return solid


def shaded(
    studio, solid, occluders: list[Placed], device: str, *, normal: np.ndarray | None = None, spots: int = SPOTS
):
    """Diffuse light, highlight, open share, colour and opacity of spots near the origin, and how they stand."""
    rng = np.random.default_rng(3)
    point = 0.3 * rng.normal(size=(spots, 3)) if normal is None else np.zeros((spots, 3))
    normal = unit(rng.normal(size=(spots, 3))) if normal is None else np.broadcast_to(normal, (spots, 3))
    direction = unit(-normal + 0.7 * unit(rng.normal(size=(spots, 3))))
    world, kept = world_of([], occluders, [], device)
    out = [wp.empty(spots, dtype=kind, device=device) for kind in (wp.vec3, wp.vec3, wp.float32, wp.vec4)]
    inputs = [
        *(vectors(v, device) for v in (point, normal, direction)),
        vectors(rng.random((spots, 2)), device, wp.vec2),
    ]
    wp.launch(shade, dim=spots, inputs=[world, studio, solid, *inputs], outputs=out, device=device)
    assert kept is not None
    return point, normal, direction, *(array.numpy() for array in out)


def test_arithmetic(device: str):
    n = 500
    rng = np.random.default_rng(1)
    u, x = unit(rng.normal(size=(n, 3))), rng.random((n, 4))
    u[:2] = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
    x[:, 2] = (np.arange(n) + 0.5) / n * 7.0 - 3.0  # places across seven lines
    out = [wp.empty(n, dtype=kind, device=device) for kind in (wp.vec3, wp.vec3, wp.vec3, wp.vec4)]
    inputs = [studio_of([], device), vectors(u, device), vectors(x, device, wp.vec4)]
    wp.launch(numbers, dim=n, inputs=inputs, outputs=out, device=device)
    side, mirror, near, other = (array.numpy().astype(float) for array in out)
    np.testing.assert_allclose(np.linalg.norm(side, axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.einsum("ni,ni->n", side, u), 0.0, atol=1e-6)
    np.testing.assert_allclose(mirror, environment(u), atol=1e-5)
    tangent = np.linalg.norm(np.cross(near, u), axis=1) / np.einsum("ni,ni->n", near, u)
    np.testing.assert_allclose(tangent, 0.3 * np.sqrt(x[:, 0]), atol=1e-5)
    np.testing.assert_allclose(other[:, 0], x[:, 2] - np.floor(x[:, 2]), atol=1e-6)
    away = np.abs(x[:, 2] - np.round(x[:, 2]))
    np.testing.assert_allclose(other[:, 1], np.clip((0.02 + 0.015 - away) / 0.03, 0.0, 1.0), atol=2e-5)
    # a pixel that is narrower than a line loses none of it: lines of 0.04 cover 4 %
    assert other[:, 1].mean() == pytest.approx(0.04, abs=2e-3)
    index = np.arange(n)
    for column, step in ((2, 0.7548777), (3, 0.5698403)):
        apart = other[:, column] - (step * index + x[:, column - 2])
        np.testing.assert_allclose(apart, np.round(apart), atol=5e-5)
    assert np.histogram2d(*((index * s) % 1.0 for s in (0.7548777, 0.5698403)), bins=5)[0].min() >= 15  # of 20


LIGHTS = [(unit(np.array([0.3, -0.2, 0.9])), True, False, np.array([2.0, 1.8, 1.5])),
          (np.array([2.0, 3.0, 1.0]), False, False, np.array([0.5, 0.6, 0.7]))]  # fmt: skip


@pytest.mark.parametrize(("kind", "opacity"), [("sphere", 1.0), ("sphere", 0.4), ("plane", 1.0), ("plane", 0.7)])
def test_light_and_colour_in_the_open(kind: str, opacity: float, device: str):
    """A distant light and one nearby, no shadows; a plane as large as an endless one fades."""
    endless = 1e30 if kind == "plane" else 1.0
    studio = studio_of(LIGHTS, device)
    point, normal, direction, diffuse, shine, open_share, colour = shaded(
        studio, solid_of(kind, opacity, endless), [], device
    )
    wrap = 0.45 if opacity < 0.98 else 0.0
    power = min(2.0 / ROUGHNESS**4, 900.0)
    wanted, peak = np.zeros((SPOTS, 3)), np.zeros((SPOTS, 3))
    for vector, distant, _, irradiance in LIGHTS:
        towards = unit(np.broadcast_to(vector, point.shape) if distant else vector - point)
        cosine = np.einsum("ni,ni->n", normal, towards)
        wanted += np.maximum(cosine + wrap, 0.0)[:, None] / (1.0 + wrap) * irradiance
        half = np.maximum(np.einsum("ni,ni->n", normal, unit(towards - direction)), 0.0)
        lit = (cosine > 0.0) & (kind != "plane")
        peak += (lit * half**power * (0.05 + 0.05 * np.sqrt(power)))[:, None] * irradiance
    np.testing.assert_allclose(diffuse, wanted, rtol=FLOAT32, atol=1e-5)
    np.testing.assert_allclose(shine, peak, rtol=10 * FLOAT32, atol=1e-5)
    assert (open_share == 1.0).all()
    arriving = wanted + GROUND + (0.5 + 0.5 * normal @ ZENITH)[:, None] * (SKY - GROUND)
    if kind == "plane":
        far = np.linalg.norm(point, axis=1) / 8.0
        np.testing.assert_allclose(colour[:, :3], COLOUR * arriving, rtol=FLOAT32, atol=1e-5)
        np.testing.assert_allclose(colour[:, 3], opacity * np.exp(-2.5 * far**2), rtol=FLOAT32)
        return
    facing = np.maximum(-np.einsum("ni,ni->n", normal, direction), 0.0)[:, None]
    fresnel = (0.04 + 0.6 * (1.0 - facing) ** 4) * (1.0 - 0.8 * ROUGHNESS)
    tint = 1.0 + (0.55 if wrap else 0.2) * (COLOUR - 1.0)
    total = COLOUR * arriving + peak + fresnel * tint * environment(direction + 2.0 * facing * normal)
    seen = np.full((SPOTS, 1), opacity)
    if wrap:
        rim = (1.0 - facing) ** 2.2
        seen += (1.0 - seen) * np.minimum(0.75 * rim + 0.8 * np.linalg.norm(peak, axis=1, keepdims=True), 0.95)
        total += 0.35 * rim * COLOUR * SKY
    np.testing.assert_allclose(colour, np.hstack([total, seen]), rtol=10 * FLOAT32, atol=1e-4)


@pytest.mark.parametrize(("opacity", "passed"), [(1.0, 0.0), (0.5, 0.7)])
def test_a_shadow_takes_what_a_solid_stops(opacity: float, passed: float, device: str):
    """A light overhead, a ball before it; and the same without shadows, or with the ball behind the light."""
    above = np.array([0.0, 0.0, 5.0])
    ball = Placed("sphere", np.eye(3), np.array([0.0, 0.0, 2.5]), opacity=opacity)
    behind = Placed("sphere", np.eye(3), np.array([0.0, 0.0, 8.0]), opacity=opacity)
    for occluder, shadows, share in ((ball, True, passed), (ball, False, 1.0), (behind, True, 1.0)):
        studio = studio_of([(above, False, shadows, np.ones(3))], device)
        diffuse = shaded(studio, solid_of("sphere", 1.0), [occluder], device, normal=ZENITH)[3]
        np.testing.assert_allclose(diffuse, share, atol=1e-4)


def test_a_ball_overhead_hides_its_view_factor(device: str):
    """Of a surface that faces a ball of radius R at distance h, the ball takes (R/h)² of the light from all sides."""
    h, rays, spots = 2.2, 256, 16
    ball = Placed("sphere", np.eye(3), np.array([0.0, 0.0, h]))
    found = shaded(studio_of([], device, rays), solid_of("sphere", 1.0), [ball], device, normal=ZENITH, spots=spots)[5]
    share = 1.0 - 1.0 / h**2
    # standard error of independent rays, which those of the sequence stay below
    error = np.sqrt(share * (1.0 - share) / (rays * spots))
    assert error < 0.01 and abs(found.mean() - share) < 5.0 * error
    assert found.min() > 0.0 and found.max() < 1.0
