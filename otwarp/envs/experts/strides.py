"""From strides along a path to velocities of hands, and from columns to the five numbers that OT-Gym sees."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.envs.experts.delivery import SPEED_LIMIT, shipped_path
from otwarp.envs.experts.policies import Seen

RATE = 5.0
"""Actions a second [Hz]."""
STRIDE = 0.55
"""Way on the path per number of the action [µm]: the largest is 25 µm/s, which the dishes hardly hold."""
CHOICES = 10


class Strides:
    """N environments of that task, as OT-Gym has them: strides → velocities, columns → five numbers.

    Args:
        scale: (O) what 1 stands for in the columns of the task.
        count: N.
    """

    LOW = np.array([0.0, 0.0, 0.0, -np.pi, 0.0], dtype=np.float32)
    HIGH = np.array([1.0, 1.0, 10.0, np.pi, 10.0], dtype=np.float32)
    """Of what is seen: share of the path, share of the longest stride, µm, rad, µm."""

    def __init__(self, scale: np.ndarray, count: int):
        self.scale, self.path = scale, shipped_path()
        self.length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.path, axis=0), axis=1))])
        self.way, self.last = np.zeros(count), np.zeros(count)

    def restart(self, chosen: np.ndarray) -> None:
        """Put the chosen environments, (N) bool, back to the start of the path."""
        self.way, self.last = np.where(chosen, 0.0, self.way), np.where(chosen, 0.0, self.last)

    def velocities(self, strides: np.ndarray) -> np.ndarray:
        """(N, 4) numbers within ±1 of the task's action, for (N) whole numbers from 0 to 9."""
        before = self._points()
        self.last = np.asarray(strides, dtype=float)
        self.way = np.minimum(self.way + STRIDE * self.last, self.length[-1])
        velocity = (self._points() - before) * RATE / SPEED_LIMIT
        return np.concatenate([velocity, velocity], axis=1).astype(np.float32)

    def seen(self, columns: np.ndarray) -> np.ndarray:
        """(N, 5) what OT-Gym sees, of (N, O) scaled columns."""
        left, right, facing, backing, lag = np.split(np.asarray(columns) * self.scale, [2, 4, 6, 8], axis=1)
        off = np.linalg.norm(left + right, axis=1) / 2
        axes = facing + backing
        yaw = np.arctan2(axes[:, 1], axes[:, 0])
        numbers = [self.way / self.length[-1], self.last / (CHOICES - 1), off, yaw, lag[:, 0]]
        return np.clip(np.stack(numbers, axis=1), self.LOW, self.HIGH).astype(np.float32)

    def spaces(self) -> tuple[Any, Any]:
        """Of one environment: what is seen, and actions."""
        from gymnasium import spaces

        return spaces.Box(self.LOW, self.HIGH, dtype=np.float32), spaces.Discrete(CHOICES)

    def _points(self) -> np.ndarray:
        """(N, 2) where the path has come to."""
        return np.stack([np.interp(self.way, self.length, column) for column in self.path.T], axis=1)


class Strider:
    """For CellDeliveryOTGym: one stride again and again, or any.

    Args:
        stride: Whole number from 0 to 9; None for random ones.
        seed: Of random ones.
    """

    def __init__(self, stride: int | None = 6, seed: int = 0):
        self.stride, self.generator = stride, np.random.default_rng(seed)
        self._strides: Strides | None = None

    def __call__(self, seen: Seen, fresh: np.ndarray) -> np.ndarray:
        """(N, 4) numbers: the velocities that its strides come to."""
        strides = self._strides
        if strides is None or len(strides.way) != len(fresh):
            strides = self._strides = Strides(np.ones(9), len(fresh))
        strides.restart(fresh)
        drawn = self.generator.integers(0, CHOICES, len(fresh))
        return strides.velocities(drawn if self.stride is None else np.full(len(fresh), self.stride))
