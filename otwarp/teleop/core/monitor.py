"""`Watch`: what an operator must be told of a frame."""

from __future__ import annotations

import math

import numpy as np

from otwarp.record.frame import Frame
from otwarp.scene.description import Scene
from otwarp.simulation.model import Model
from otwarp.teleop.core.frame import HandFrame, PaceNow

AT_THE_CLAMP = 0.98
"""Part of the clamp from which a hand is told that it feels less than there is."""
AHEAD = 1.0
"""Micrometres by which a hand may be ahead of its traps: more than one goes in a tick at 100 µm/s."""
BEHIND = 0.95
"""Part of the wanted speed below which the operator is told."""


class Watch:
    """Warnings of a session, one line each.

    Args:
        model: What is simulated.
    """

    def __init__(self, model: Model):
        self._scene: Scene = model.scene
        self._reach = np.asarray(model.held_range[0], dtype=float)
        self._limit = np.array([body.warning_force for body in model.scene.bodies])

    def warnings(self, frame: Frame, hands: tuple[HandFrame, ...], pace: PaceNow) -> tuple[str, ...]:
        """All that hold at present."""
        lags = self._lags(frame, hands)
        return (*self._traps(frame), *self._contacts(frame), *self._hands(hands), *lags, *self._pace(pace))

    def _traps(self, frame: Frame) -> list[str]:
        gap = frame.trap_distance[0]
        lost = np.flatnonzero(gap > self._reach)  # nan for a trap that holds nothing is not greater
        return [
            f"{_short(self._scene, self._scene.traps[t].prim)} has lost its sphere: {gap[t]:.2g} µm away, "
            f"reach {self._reach[t]:.2g} µm"
            for t in lost
        ]

    def _contacts(self, frame: Frame) -> list[str]:
        load = frame.contact_load[0]
        return [
            f"{_short(self._scene, self._scene.bodies[b].name)} is pressed with {load[b]:.3g} pN, "
            f"warning at {self._limit[b]:.3g} pN"
            for b in np.flatnonzero(load > self._limit)
        ]

    def _hands(self, hands: tuple[HandFrame, ...]) -> list[str]:
        out = []
        for hand in hands:
            size = math.hypot(*hand.force)
            if hand.clamp > 0.0 and size >= AT_THE_CLAMP * hand.clamp:
                out.append(f"{hand.name} hand: force held to {hand.clamp:.3g} N")
            if hand.message:
                out.append(f"{hand.name} hand: {hand.message}")
        return out

    def _lags(self, frame: Frame, hands: tuple[HandFrame, ...]) -> list[str]:
        """Hands that are ahead of their traps: a trap's speed limit counts simulated seconds, a hand's the clock's."""
        out = []
        for hand in hands:
            ahead = [math.dist(place, frame.trap_position[0, t]) for t, place in (hand.now.traps if hand.now else ())]
            if max(ahead, default=0.0) > AHEAD:
                out.append(
                    f"{hand.name} hand: {max(ahead):.2g} µm ahead of its traps, which are at their speed limit; it "
                    "feels more than there is until they catch up"
                )
        return out

    def _pace(self, pace: PaceNow) -> list[str]:
        if pace.paused or pace.slipped == 0.0 or pace.factor >= BEHIND * pace.speed:
            return []
        return [
            f"simulated time runs at {pace.factor:.2f} of real time, {pace.speed:g} was asked for; "
            f"{pace.slipped:.1f} s given up"
        ]


def _short(scene: Scene, prim: str) -> str:
    """A prim's path below the scene's root."""
    return prim.removeprefix(f"{scene.root}/")
