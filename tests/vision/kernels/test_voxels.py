"""Shares of cells that solids fill, against points counted in each cell, and against the volume of the solids."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from otwarp.vision.kernels.voxels import fill_cells

SIZE = np.array([0.1, 0.12, 0.15])
"""Sides of a cell [µm]."""
CELLS = (18, 24, 30)
"""Cells along z, y, x."""
CORNER = -0.5 * SIZE * CELLS[::-1]
POINTS = 6
"""Along each side of a cell, where points are counted."""

SOLIDS = {
    "sphere": ([[0.0, 0.02, -0.03]], [[0.0, 0.02, -0.03]], [0.8]),
    "capsule": ([[-0.6, -0.3, 0.1]], [[0.5, 0.4, -0.2]], [0.6]),
    "both": ([[-0.7, 0.0, 0.0], [0.5, -0.3, 0.2]], [[-0.7, 0.0, 0.0], [0.5, 0.6, 0.2]], [0.5, 0.45]),
}
"""Starts, ends and radii [µm]."""


def filled(name: str, device: str) -> np.ndarray:
    start, end, radius = (np.array(v, dtype=np.float32) for v in SOLIDS[name])
    out = wp.empty(CELLS, dtype=float, device=device)
    solids = [*(wp.array(v, dtype=wp.vec3, device=device) for v in (start, end)), wp.array(radius, device=device)]
    wp.launch(fill_cells, dim=CELLS, inputs=[*solids, wp.vec3(*CORNER), wp.vec3(*SIZE), out], device=device)
    return out.numpy()


def outside(p: np.ndarray, start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Distance of points (..., 3) from a capsule [µm]."""
    along = end - start
    t = np.clip((p - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    return np.linalg.norm(p - start - t[..., None] * along, axis=-1) - radius


def counted(name: str) -> np.ndarray:
    """Share of points of each cell that are in a solid."""
    offsets = (np.arange(POINTS) + 0.5) / POINTS
    k, j, i = (n[..., None, None, None] for n in np.indices(CELLS))
    c, b, a = np.meshgrid(offsets, offsets, offsets, indexing="ij")
    p = CORNER + np.stack([(i + a), (j + b), (k + c)], axis=-1) * SIZE
    within = [outside(p, *(np.array(v, dtype=float) for v in solid)) < 0.0 for solid in zip(*SOLIDS[name], strict=True)]
    return np.any(within, axis=0).mean(axis=(3, 4, 5))


@pytest.mark.parametrize("name", SOLIDS)
def test_cells_are_filled_as_points_say(name: str, device: str):
    """All or nothing away from surfaces; on them by a ramp of first order, whose errors average out."""
    share, points = filled(name, device), counted(name)
    clear = (points == 0.0) | (points == 1.0)
    # a corner of a cell may be cut where its centre is too far for the ramp to notice, and the other way round
    assert np.abs(share - points)[clear].max() < 0.1 and np.abs(share - points).max() < 0.25
    edge = (points > 0.0) & (points < 1.0)
    assert edge.sum() > 300
    assert np.sqrt(np.mean((share - points)[edge] ** 2)) < 0.08
    assert share.sum() == pytest.approx(points.sum(), rel=0.02)


def test_a_sphere_has_its_volume(device: str):
    """4π r³/3, and what a ramp of width w across a curved surface adds: a share w²/4r², with ⟨w²⟩ = Σ size²/3."""
    radius = SOLIDS["sphere"][2][0]
    volume = filled("sphere", device).sum() * SIZE.prod()
    ramp = (SIZE @ SIZE / 3.0) / (4.0 * radius**2)
    assert ramp > 5e-3
    assert volume == pytest.approx(4.0 / 3.0 * np.pi * radius**3 * (1.0 + ramp), rel=1.5e-3)
