"""A hand without a device: a gizmo of the page writes where the hand is into the mailbox of the servo's `mouse`.

The hand is told relative to where it is when the gizmo is taken, so that gizmo and traps agree whatever happened in
between: a gain changed, a clutch, a pause, a speed limit.
"""

from __future__ import annotations

from collections.abc import Callable

from otwarp.haptics.core.fields import Matrix
from otwarp.haptics.core.types import ZERO, Vec3

INTERVAL = 0.1
"""Seconds between two words to the mailbox; the device takes `mouse.SILENCE` = 0.5 s of silence for a release."""
DEAD_MAN = 1
"""Button 0, held while the page lives."""


class Pointer:
    """Where one hand is told to be.

    Args:
        write: Puts (x, y, z, buttons) [m] into the mailbox.
        axis_map: A, orthogonal, scene = A·device.
    """

    def __init__(self, write: Callable[[tuple[float, float, float, int]], None], axis_map: Matrix):
        self._write, self._axes = write, axis_map
        self._target: Vec3 = ZERO
        self._base: Vec3 = ZERO
        self._written = float("-inf")

    @property
    def target(self) -> Vec3:
        """In the device's frame [m]."""
        return self._target

    def take(self, hand: Vec3 | None) -> None:
        """The gizmo is taken while the hand is there [m]; None if nobody knows, for where it was told to be."""
        self._base = self._target if hand is None else hand

    def move(self, shift: Vec3, gain: float) -> None:
        """The gizmo is at this distance from where it was taken.

        target = base + Aᵀ·shift / gain

        Args:
            shift: In the scene's frame [µm].
            gain: Motion gain [µm/m].
        """
        a, (x, y, z) = self._axes, self._base
        dx, dy, dz = (sum(a[row][column] * shift[row] for row in range(3)) / gain for column in range(3))
        self._target = (x + dx, y + dy, z + dz)
        self._written = float("-inf")

    def tick(self, now: float, watched: bool) -> None:
        """Write if it is time to, and only while somebody watches: silence lets go of the dead-man switch."""
        if watched and now - self._written >= INTERVAL:
            self._written = now
            self._write((*self._target, DEAD_MAN))
