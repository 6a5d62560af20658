"""Bodies that images put into each other are pushed apart: contact, which knows only small overlaps, would stop a twin.

Each errs by itself, and what is not seen stands where it was simulated while a robot goes where it is seen.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from otwarp.scene import Scene
from otwarp.scene.transforms import rotation_matrix

ALLOWED, MOST_LEFT = 0.15, 0.3
"""Overlap that stays, over the smaller of two radii, and the largest that a twin is given; it stops at 0.5."""

ROUNDS = 8
"""Times that a body is pushed out of its deepest overlap, at most."""

MOST = 64
"""Bodies of a scene up to which all are looked at; above, those that are followed."""


class Overlaps:
    """The spheres of bodies that collide.

    Args:
        scene: The scene.
        reference: (B, 3) centres of diffusion in the frames of the bodies' prims [µm].
        followed: Indices of the bodies that images place, those that stay where they are put first.
    """

    def __init__(self, scene: Scene, reference: np.ndarray, followed: Sequence[int]):
        others = [n for n in range(len(scene.bodies)) if n not in followed] if len(scene.bodies) <= MOST else []
        self._order = [*followed, *others]
        self._offset: dict[int, np.ndarray] = {}
        self._radius: dict[int, np.ndarray] = {}
        for n in self._order:
            solid = [s for s in scene.bodies[n].spheres if s.collides]
            self._offset[n] = np.array([s.offset for s in solid]).reshape(-1, 3) - reference[n]
            self._radius[n] = np.array([s.radius for s in solid])

    def part(self, position: np.ndarray, orientation: np.ndarray | None, seen: Collection[int]) -> tuple[int, float]:
        """Move bodies, in place, out of those before them in the order.

        Args:
            position: (B, 3) centres of diffusion [µm].
            orientation: (B, 4); None where nothing turns.
            seen: Bodies that are where images have them: they go before all others, whose places follow from more.

        Returns:
            How many were moved, and the largest overlap that is left, over the smaller radius: between two robots there
            may be no room for a cell.
        """
        there: list[tuple[np.ndarray, np.ndarray]] = []
        moved, left = 0, 0.0
        for n in sorted(self._order, key=lambda n: n not in seen):
            if not len(self._radius[n]):
                continue
            turn = np.eye(3) if orientation is None else rotation_matrix(orientation[n])
            own, radius = self._offset[n] @ turn.T, self._radius[n]
            if there:
                spheres, radii = (np.concatenate(column) for column in zip(*there, strict=True))
                out = _way_out(position[n] + own, radius, spheres, radii)
                position[n] += out
                moved += bool(np.any(out))
                left = max(left, _deepest(position[n] + own, radius, spheres, radii))
            there.append((position[n] + own, radius))
        return moved, left


def _deepest(own: np.ndarray, radius: np.ndarray, spheres: np.ndarray, radii: np.ndarray) -> float:
    """Largest overlap over the smaller radius."""
    gap = np.linalg.norm(own[:, None] - spheres[None, :], axis=-1)
    depth = radius[:, None] + radii[None, :] - gap
    return max(0.0, float((depth / np.minimum(radius[:, None], radii[None, :])).max()))


def _way_out(own: np.ndarray, radius: np.ndarray, spheres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(3) by which spheres are moved so that none is deeper in others than is allowed, or as far as `ROUNDS` lead."""
    way = np.zeros(3)
    allowed = ALLOWED * np.minimum(radius[:, None], radii[None, :])
    for _ in range(ROUNDS):
        between = own[:, None] + way - spheres[None, :]
        gap = np.linalg.norm(between, axis=-1)
        depth = radius[:, None] + radii[None, :] - gap - allowed
        a, b = np.unravel_index(int(np.argmax(depth)), depth.shape)
        if depth[a, b] <= 0.0:
            break
        away = between[a, b] / gap[a, b] if gap[a, b] > 1e-9 else np.array([0.0, 0.0, 1.0])
        way = way + (depth[a, b] + 1e-3) * away
    return way
