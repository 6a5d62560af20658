"""A script for Push: round the cell to the side that looks away from the goal, and then against it."""

from __future__ import annotations

import numpy as np

from otwarp.envs.experts.policies import Seen, planar, unit

SPEED_LIMIT = 25.0
"""What 1 stands for in an action [µm/s]."""


class Pusher:
    """Walks round the cell at `ROUND`, then pushes; aside of the line it pushes back towards it.

    Args:
        speed: Of the trap [µm/s].
        gain: Sideways over forward speed, when the robot is a contact distance beside the line to the goal.
    """

    TOUCH, ROUND = 5.5, 7.0
    """Distances of the middles of robot and cell: in touch, and on the way round [µm]."""
    BEHIND = 0.35
    """How far from behind the cell the robot may be while it pushes [rad]."""

    def __init__(self, speed: float = 14.0, gain: float = 3.0):
        self.speed, self.gain = speed, gain

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 2) actions."""
        away, wanted = -planar(seen, "body_offset"), unit(planar(seen, "goal_offset"))
        aside = np.stack([-wanted[:, 1], wanted[:, 0]], axis=1)
        side, behind = np.sum(away * aside, axis=1), -np.sum(away * wanted, axis=1)
        push = unit(wanted - self.gain * (side / self.TOUCH)[:, None] * aside)
        ahead = np.abs(np.arctan2(side, behind)) < self.BEHIND
        return self.speed / SPEED_LIMIT * np.where(ahead[:, None], push, self._round(away, wanted))

    def _round(self, away: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """(N, 2) directions on a circle about the cell, the shorter way to behind it."""
        radius = np.linalg.norm(away, axis=1, keepdims=True)
        along = np.stack([-away[:, 1], away[:, 0]], axis=1) / radius
        backwards = np.sign(-np.sum(along * wanted, axis=1, keepdims=True) + 1e-9)
        return unit(backwards * along + 0.5 * (self.ROUND - radius) * away / radius)
