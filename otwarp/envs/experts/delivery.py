"""A script for CellDelivery: both hands along one path, as far apart as they began."""

from __future__ import annotations

import numpy as np

from otwarp.envs.experts.policies import Seen, planar, unit

SPEED_LIMIT = 30.0
"""What 1 stands for in an action [µm/s]."""


def shipped_path() -> np.ndarray:
    """(n, 2) the path of the shipped scene, as its traps take it, from where the cell starts [µm]."""
    from otwarp.envs.scenes import load

    scene = load("cell_delivery")
    cell = next(b for b in scene.bodies if scene.goal is not None and b.prim == scene.goal.cell)
    way = np.asarray(scene.traps[0].position.values)[:, :2]
    points = way - way[0] + np.array(cell.position[:2])
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6
    return points[np.concatenate([[True], moved])]


class Carrier:
    """Follows a path at `speed`, after a rest and with a soft start and stop.

    Args:
        speed: Of both hands [µm/s]; the dishes hold the cell up to some 25.
        path: (n, 2) places of the cell [µm]; None for that of the shipped scene.

    Attributes:
        done: (N) how far along the path the cell of each environment has come [µm].
    """

    REST, RAMP = 0.5, 1.0
    """Times at rest, and until it has its speed [s]."""
    BRAKE = 8.0
    """Way before the end at which it begins to slow down [µm]."""
    AHEAD = 1.5
    """Where on the path it aims at, from the nearest point on [µm]."""

    def __init__(self, speed: float = 19.0, path: np.ndarray | None = None):
        self.speed = speed
        self.path = shipped_path() if path is None else np.asarray(path, dtype=float)
        self.length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.path, axis=0), axis=1))])
        self._begun: np.ndarray = np.zeros(0)
        self.done: np.ndarray = np.zeros(0)

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 4) actions: the same velocity for both hands."""
        place, left = planar(seen, "body_position"), seen["time_left"]
        if self._begun.shape != left.shape:
            self._begun, self.done = left.copy(), np.zeros_like(left)
        self._begun[fresh], self.done[fresh] = left[fresh], 0.0
        self.done = np.maximum(self.done, self._nearest(place))
        aim = self.done + self.AHEAD
        target = np.stack([np.interp(aim, self.length, column) for column in self.path.T], axis=1)
        gathered = np.clip((self._begun - left - self.REST) / self.RAMP, 0.0, 1.0)
        remaining = np.clip((self.length[-1] - self.done) / self.BRAKE, 0.15, 1.0)
        speed = self.speed * np.sin(0.5 * np.pi * gathered) ** 2 * remaining
        velocity = speed[:, None] * unit(target - place) / SPEED_LIMIT
        return np.concatenate([velocity, velocity], axis=1)

    def _nearest(self, place: np.ndarray) -> np.ndarray:
        """(N) lengths along the path of its points nearest to places, within 10 µm ahead of what is done."""
        distance = np.linalg.norm(self.path[None] - place[:, None], axis=2)
        ahead = self.length[None] - self.done[:, None]
        return self.length[np.argmin(np.where((ahead >= -1.0) & (ahead < 10.0), distance, np.inf), axis=1)]
