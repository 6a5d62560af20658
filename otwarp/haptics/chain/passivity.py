"""Passivity observer and controller: the chain gives back no more energy than it was given, up to a small reserve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from otwarp.haptics.core.config import PassivityConfig
from otwarp.haptics.core.types import Vec3, as_tuples

STILL = 1e-24
"""Squared step of a hand that stands [m²]: 1 pm is far below any encoder, and its direction is rounding."""


class Passivity:
    """Energy at the port of the device, counted exactly and kept from falling below −reserve.

    A device holds a force F over a period, so the work it does while the hand moves by Δx is F·Δx whatever the path:
    with the force that was really sent (after ramp, slew limit and clamp) the observer E ← E − F·Δx knows the energy
    taken from the hand without an error of sampling. Before each period the controller foresees the work w = F·v̂T. If
    it exceeds what may be given, a share of E + reserve, it takes the surplus off along the motion; if E has fallen
    below −reserve, by a step that could not be foreseen, it also damps, with at most `damping_limit`, until that is won
    back. Whatever delays, drops or jumps the scene makes, they can only cost force, never add energy.

    Source: after Hannaford and Ryu 2002, IEEE Transactions on Robotics and Automation 18(1), 1–10,
    doi:10.1109/70.988969, whose controller dissipates after the fact; limiting the work of the coming period is ours.

    Args:
        config: Reserve, capacity, share, damping limit.
        period: Servo period [s].

    Attributes:
        energy: Taken from the hand, net [J]; never above the capacity.
    """

    __slots__ = ("_capacity", "_hand", "_limit", "_period", "_reserve", "_share", "energy")

    def __init__(self, config: PassivityConfig, period: float) -> None:
        self._reserve, self._capacity, self._share = config.reserve, config.capacity, config.share
        self._limit = config.damping_limit / period
        self._period = period
        self._hand: Vec3 | None = None
        self.energy = 0.0

    def observe(self, x: float, y: float, z: float, force: Vec3) -> float:
        """Count the work that `force` [N] has done since the last call, with the hand now at x, y, z [m]."""
        if self._hand is not None:
            u, v, w = self._hand
            fx, fy, fz = force
            energy = self.energy - (fx * (x - u) + fy * (y - v) + fz * (z - w))
            # the floor is never met in use; it keeps an absurd position from leaving infinity behind
            self.energy = max(-self._capacity, min(energy, self._capacity)) if energy == energy else -self._capacity
        self._hand = (x, y, z)
        return self.energy

    def control(self, force: Vec3, velocity: Vec3) -> Vec3:
        """The force [N] that may be sent for a period in which the hand is expected to go on at `velocity` [m/s]."""
        (fx, fy, fz), (vx, vy, vz), t = force, velocity, self._period
        dx, dy, dz = t * vx, t * vy, t * vz
        work = fx * dx + fy * dy + fz * dz
        left = self.energy + self._reserve
        given = self._share * left if left > 0.0 else 0.0
        surplus = work - given
        if surplus <= 0.0 and left >= 0.0:
            return force
        step2 = dx * dx + dy * dy + dz * dz
        if step2 < STILL:
            return force
        per_step = max(surplus, 0.0) / step2
        if left < 0.0:
            # what the force takes by itself counts towards winning back
            missing = (min(work, 0.0) - left) / step2
            per_step += min(max(missing, 0.0), self._limit)
        return fx - per_step * dx, fy - per_step * dy, fz - per_step * dz

    def state(self) -> list[Any]:
        """All that changes from step to step, for JSON."""
        return [self._hand, self.energy]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        self._hand, self.energy = as_tuples(state)
