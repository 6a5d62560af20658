"""Many cells without overlap, the same on every platform."""

from __future__ import annotations

import numpy as np

from otwarp.scene import Body, Material, Sphere


def cell(
    prim: str, radius: float, *, modulus: float = 1000.0, position: tuple[float, float, float] = (0, 0, 0)
) -> Body:
    """A soft cell without adhesion, of `radius` [µm] and Young's modulus `modulus` [Pa]."""
    x, y, z = (float(v) for v in position)
    return Body(
        prim=prim,
        kind="cell",
        position=(x, y, z),
        spheres=(Sphere(prim=prim, radius=radius, refractive_index=1.38, trapped=False),),
        density=1060e-12,
        material=Material(youngs_modulus=modulus, poisson_ratio=0.45, adhesion=0.0),
        warning_force=10.0,
    )


def jittered_lattice(counts: tuple[int, int, int], spacing: float, jitter: float, *, seed: int) -> np.ndarray:
    """Points of a cubic lattice, each moved at random: centres at least `spacing − 2·jitter` apart.

    Args:
        counts: Points along x, y, z.
        spacing: Lattice spacing [µm].
        jitter: Largest move of a point [µm], in any direction.
        seed: Of the generator.

    Returns:
        (n, 3) points about the origin [µm], on a grid of 0.001 µm.
    """
    axes = [(np.arange(n) - (n - 1) / 2) * spacing for n in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    generator = np.random.default_rng(seed)
    direction = generator.normal(size=points.shape)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    reach = jitter * generator.random((len(points), 1)) ** (1 / 3)
    return np.round(points + reach * direction, 3) + 0.0


def scatter(
    count: int, low: np.ndarray, high: np.ndarray, *, gap: float, seed: int, keep_off: np.ndarray
) -> np.ndarray:
    """Points at random in a box, no two nearer than `gap` (random sequential addition).

    Args:
        count: Number of points.
        low, high: (3,) corners [µm].
        gap: Least distance between two points [µm].
        seed: Of the generator.
        keep_off: (m, 4) balls or upright pillars to stay out of: x, y, z, distance [µm]; z = nan for a pillar.

    Returns:
        (count, 3) points [µm], on a grid of 0.001 µm.

    Raises:
        ValueError: The points do not fit.
    """
    generator = np.random.default_rng(seed)
    points = np.zeros((0, 3))
    for _ in range(200 * count):
        if len(points) == count:
            return points
        trial = np.round(low + (high - low) * generator.random(3), 3)
        away = np.nan_to_num(trial - keep_off[:, :3], nan=0.0)
        if np.all(np.linalg.norm(away, axis=1) >= keep_off[:, 3]) and np.all(
            np.linalg.norm(points - trial, axis=1) >= gap
        ):
            points = np.vstack([points, trial])
    raise ValueError(f"count = {count}: only {len(points)} points fit {gap} µm apart between {low} and {high}")
