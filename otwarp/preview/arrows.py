"""Solid arrows: a shaft and a head, as ordinary shapes of a draw list."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError
from otwarp.scene.drawing.draw_list import TUBE, Drawables

HEAD_LENGTH = 0.3
HEAD_RADIUS = 2.4
"""Length of the head as a share of the arrow, and its radius as a multiple of the shaft's."""


@dataclass(frozen=True)
class Arrows:
    """Arrows from `origins` (n, 3) to `origins + vectors` [µm].

    Attributes:
        origins: (n, 3) µm.
        vectors: (n, 3) µm; those shorter than a thousandth of the view are left out.
        colour: Linear RGB, (3,) or (n, 3).
        radius: Radius of the shafts [µm]; None scales it to the view.
    """

    origins: np.ndarray
    vectors: np.ndarray
    colour: tuple[float, float, float] | np.ndarray = (1.0, 0.55, 0.08)
    radius: float | None = None


def frames(directions: np.ndarray) -> np.ndarray:
    """(n, 3, 3) right-handed bases whose third column is the unit vector along each of the (n, 3) `directions`."""
    z = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    helper = np.where(np.abs(z[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def arrow_shapes(arrows: Arrows, drawables: Drawables) -> Drawables:
    """The arrows as shapes, in the camera and light of `drawables`.

    Raises:
        InputError: Shapes of the arrays do not match, or a value is not finite.
    """
    origins, vectors = (np.asarray(a, dtype=float).reshape(-1, 3) for a in (arrows.origins, arrows.vectors))
    if origins.shape != vectors.shape or not (np.isfinite(origins).all() and np.isfinite(vectors).all()):
        raise InputError(f"arrows: origins {origins.shape}, vectors {vectors.shape}; finite arrays of one shape wanted")
    view = drawables.view
    across = view.width * (1.0 if view.orthographic else view.focus)
    long = np.linalg.norm(vectors, axis=1)
    shown = long > 1e-3 * across
    colour = np.broadcast_to(np.asarray(arrows.colour, dtype=float), origins.shape)[shown]
    origins, vectors, long = origins[shown], vectors[shown], long[shown]
    radius = np.full(len(long), 0.0028 * across if arrows.radius is None else arrows.radius)
    radius = np.minimum(radius, 0.12 * long)
    basis = frames(vectors) if len(vectors) else np.zeros((0, 3, 3))
    head = np.minimum(HEAD_LENGTH * long, 3.2 * HEAD_RADIUS * radius)
    parts = (
        (0.5 * (long - head), radius, 0.5 * (long - head), 1.0),
        (long - 0.5 * head, HEAD_RADIUS * radius, 0.5 * head, 0.0),
    )
    transform = np.zeros((2 * len(long), 4, 4))
    transform[:, 3, 3] = 1.0
    for k, (middle, wide, half, _) in enumerate(parts):
        block = transform[k * len(long) : (k + 1) * len(long)]
        block[:, :3, :3] = basis * np.stack([wide, wide, half], axis=1)[:, None, :]
        block[:, :3, 3] = origins + basis[:, :, 2] * middle[:, None]
    count = len(transform)
    return Drawables(
        kind=np.full(count, TUBE, dtype=np.int32),
        transform=transform,
        size=np.stack([np.repeat([1.0, 0.0], len(long)), np.zeros(count)], axis=1),
        colour=np.concatenate([colour, colour]),
        opacity=np.ones(count),
        roughness=np.full(count, 0.4),
        beam=np.zeros(count, dtype=bool),
        mesh=np.full(count, -1, dtype=np.int32),
        view=view,
    )
