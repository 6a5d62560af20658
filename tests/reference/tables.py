"""Force tables of made-up fields, and places to evaluate them at."""

from __future__ import annotations

import numpy as np

from otwarp.laws.table import Interpolation
from otwarp.optics import Beam, ForceTable, Particle
from otwarp.optics.table import TableLevel, layer_count

BEAMS = (
    Beam(polarization="circular", power=1.0),
    Beam(polarization=(1.0, 0.5j), power=1.0),
    Beam(polarization="x", charge=1, power=1.0),
)
"""Of one, two and three layers."""


def made_up_table(beam: Beam, interpolation: Interpolation, seed: int) -> ForceTable:
    """Random nodes: any field will do, and layers must not mix."""
    rng = np.random.default_rng(seed)
    levels = []
    for n, intervals in enumerate((24, 10, 7)):
        radius = 2.0 * 2**n
        node = rng.normal(size=(2 * intervals + 3, intervals + 3, layer_count(beam), 3)).astype(np.float32)
        # what every field has: parity about the axis, on which all but the constant part of F_z vanish
        node[:, 0] = np.array([-1.0, -1.0, 1.0], dtype=np.float32) * node[:, 2]
        node[:, 1, :, :2] = 0.0
        node[:, 1, 1:, 2] = 0.0 if interpolation == "bilinear" else -0.5 * node[:, 2, 1:, 2]
        levels.append(TableLevel(radius, radius / intervals, node))
    return ForceTable(
        beam=beam,
        sphere=Particle(radius=1.0),
        tolerance=1e-3,
        interpolation=interpolation,
        peak=1.0,
        error=0.0,
        properties=None,
        steepest=1.0,
        levels=tuple(levels),
    )


def probe_points(rng: np.random.Generator, n: int, cutoff: float) -> np.ndarray:
    """(n, 3) float32: random, on the axis, at the focus, on both sides of every blend, and beyond the cutoff."""
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    way[:40, :2] = 0.0
    way[:40, 2] = np.sign(way[:40, 2])
    distance = rng.uniform(0.0, 1.2 * cutoff, n)
    edges = np.concatenate([cutoff / 2.0 ** np.arange(3), 0.8 * cutoff / 2.0 ** np.arange(3)])
    distance[40:340] = rng.choice(edges, 300) * (1.0 + rng.choice([-1e-5, 1e-5], 300))
    points = way * distance[:, None]
    points[:5] = 0.0
    return points.astype(np.float32)
