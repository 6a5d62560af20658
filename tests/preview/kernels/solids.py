"""Twins of the solids in float64, made of nothing but whether a point is inside, and worlds of a few of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from otwarp.preview.kernels import tracing
from otwarp.preview.kernels.tracing import TracedSolid, World

SIZE = {"sphere": (0.0, 0.0), "box": (0.0, 0.0), "tube": (0.4, 0.0), "capsule": (1.6, 0.0), "plane": (2.0, 1.5)}
"""Parameters of a canonical solid of each kind."""

KINDS = {name: int(getattr(tracing, f"KIND_{name.upper()}")) for name in SIZE}


def _tube(p: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    radius = 0.5 * (1.0 + size[0]) + 0.5 * (size[0] - 1.0) * p[..., 2]
    return np.maximum(np.abs(p[..., 2]) - 1.0, np.hypot(p[..., 0], p[..., 1]) - radius)


def _capsule(p: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    away = p[..., 2] - np.clip(p[..., 2], -size[0], size[0])
    return np.sqrt(p[..., 0] ** 2 + p[..., 1] ** 2 + away**2) - 1.0


LEVEL: dict[str, Callable[[np.ndarray, tuple[float, float]], np.ndarray]] = {
    "sphere": lambda p, size: np.linalg.norm(p, axis=-1) - 1.0,
    "box": lambda p, size: np.abs(p).max(axis=-1) - 1.0,
    "tube": _tube,
    "capsule": _capsule,
}
"""A function of a place (..., 3), negative inside and positive outside, continuous across the surface."""


@dataclass(frozen=True)
class Entry:
    """Where a ray enters: its parameter (inf: nowhere), the outward unit normal, and how sure that is.

    `margin` is the least level away from the entry: of a ray that grazes, or that enters over an edge, it is small.
    """

    t: float
    normal: np.ndarray
    margin: float


def entry(kind: str, o: np.ndarray, d: np.ndarray, low: float, far: float = 12.0) -> Entry:
    """First place beyond `low` where the ray o + t d comes from outside to inside, by samples and bisection."""
    if kind == "plane":
        return through_rectangle(o, d, low)
    level, size = LEVEL[kind], SIZE[kind]
    t = np.linspace(low, far, 6001)
    values = level(o + t[:, None] * d, size)
    crossing = np.flatnonzero((values[:-1] > 0.0) & (values[1:] <= 0.0))
    if not len(crossing):
        return Entry(math.inf, np.zeros(3), float(np.abs(values).min()))
    a, b = t[crossing[0]], t[crossing[0] + 1]
    for _ in range(60):
        middle = 0.5 * (a + b)
        a, b = (middle, b) if level(o + middle * d, size) > 0.0 else (a, middle)
    place, h = o + b * d, 1e-6
    slope = np.array([(level(place + h * e, size) - level(place - h * e, size)) / (2.0 * h) for e in np.eye(3)])
    deepest = -values[crossing[0] + 1 : crossing[0] + 60].min()
    before = values[: crossing[0] + 1]
    bend = abs(np.linalg.norm(slope) - 1.0) if kind != "tube" else 0.0
    return Entry(b, slope / np.linalg.norm(slope), min(deepest, before.max()) * (bend < 1e-3))


def through_rectangle(o: np.ndarray, d: np.ndarray, low: float) -> Entry:
    """Where a ray comes from above through |x|, |y| ≤ SIZE of z = 0."""
    t = -o[2] / d[2]
    inside = float(np.min(SIZE["plane"] - np.abs(o + t * d)[:2]))
    enters = d[2] < 0.0 and t > low and inside > 0.0
    return Entry(t if enters else math.inf, np.array([0.0, 0.0, 1.0]), min(abs(inside), abs(d[2]), abs(t - low)))


def random_rays(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) origins around the solids, at 6 µm, and unit directions towards places in and about them."""
    rng = np.random.default_rng(seed)
    origin = rng.normal(size=(n, 3))
    origin *= 6.0 / np.linalg.norm(origin, axis=1, keepdims=True)
    way = rng.uniform(-2.2, 2.2, (n, 3)) - origin
    return origin, way / np.linalg.norm(way, axis=1, keepdims=True)


@dataclass(frozen=True)
class Placed:
    """A canonical solid under world = matrix · local + shift, with its look."""

    kind: str
    matrix: np.ndarray
    shift: np.ndarray
    opacity: float = 1.0

    def entry(self, o: np.ndarray, d: np.ndarray, low: float) -> Entry:
        """As `entry`, in the world."""
        back = np.linalg.inv(self.matrix)
        found = entry(self.kind, back @ (o - self.shift), back @ d, low, far=40.0)
        normal = back.T @ found.normal
        return Entry(found.t, normal / max(float(np.linalg.norm(normal)), 1e-300), found.margin)

    def corners(self) -> np.ndarray:
        """(8, 3) corners of a box around it."""
        half = {"capsule": (1.0, 1.0, 2.6), "plane": (*SIZE["plane"], 0.0)}.get(self.kind, (1.0, 1.0, 1.0))
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        return (signs * half) @ self.matrix.T + self.shift


def records(solids: list[Placed]) -> np.ndarray:
    """Rows of `TracedSolid`."""
    rows = np.zeros(len(solids), dtype=TracedSolid.numpy_dtype())
    for row, solid in zip(rows, solids, strict=True):
        back = np.linalg.inv(solid.matrix)
        row["linear"], row["shift"] = back, -back @ solid.shift
        row["kind"], row["size"], row["opacity"] = KINDS[solid.kind], SIZE[solid.kind], solid.opacity
        row["colour"], row["roughness"] = (0.5, 0.4, 0.3), 0.5
    return rows


def hierarchy(solids: list[Placed], device: str) -> wp.Bvh | None:
    """Boxes around solids, for rays to look through."""
    if not solids:
        return None
    lower, upper = (np.array([f(s.corners(), axis=0) for s in solids]) for f in (np.min, np.max))
    return wp.Bvh(*(wp.array(x.astype(np.float32), dtype=wp.vec3, device=device) for x in (lower - 1e-3, upper + 1e-3)))


def world_of(endless: list[Placed], solids: list[Placed], beams: list[Placed], device: str):
    """A `World`, and what it refers to by address."""
    world, boxes, lit = World(), hierarchy(solids, device), hierarchy(beams, device)
    world.solids = wp.array(records([*endless, *solids]), dtype=TracedSolid, device=device)
    world.endless, world.count = len(endless), len(solids)
    world.bvh = boxes.id if boxes else wp.uint64(0)
    world.beams = wp.array(records(beams), dtype=TracedSolid, device=device)
    world.beam_count, world.beam_bvh = len(beams), lit.id if lit else wp.uint64(0)
    world.corner = wp.zeros(1, dtype=wp.vec3, device=device)
    return world, (boxes, lit)


def turned(seed: int, stretch: tuple[float, float, float], shift: tuple[float, float, float]):
    """A rotation of its own after a stretch along the axes, and a shift."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q @ np.diag(stretch), np.array(shift)
