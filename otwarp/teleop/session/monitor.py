"""What a session tells its operator: warnings while it runs, figures at its end."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from otwarp.record.summary import statistics, strict, task
from otwarp.scene import Scene
from otwarp.simulation.frame import Frame
from otwarp.simulation.model import Model
from otwarp.teleop.core.frame import HandFrame, PaceNow

if TYPE_CHECKING:
    from otwarp.teleop.session.live import LiveLoop

AT_THE_CLAMP = 0.98
"""Part of the clamp from which an operator is warned that he feels less than there is."""
AHEAD = 1.0
"""Micrometres by which a hand may be ahead of its traps: more than one goes in a tick at 100 µm/s."""
BEHIND = 0.95
"""Part of the wanted speed below which the operator is warned."""


class SessionMonitor:
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


def summarize(loop: LiveLoop) -> dict[str, Any]:
    """Figures of a session that has run; `text` says them to a reader.

    Keys: `wall` and `simulated` [s], `slipped` [s], `real_time_factor` over the whole session, `paused` [s], `frames`,
    `late_frames`, `servo` (cycles, dropped, worst lateness of its last second [s]), `hands`, `failure`, `text`; of the
    time since the last reset, as `otwarp run` has them, `task` and `statistics`.
    """
    pace, status = loop.pace, loop.hands.status
    running = loop.wall - pace.stood
    report: dict[str, Any] = {
        "wall": loop.wall,
        "simulated": pace.simulated,
        "slipped": pace.slipped,
        "paused": pace.stood,
        "real_time_factor": pace.simulated / running if running > 0.0 else 0.0,
        "frames": loop.frames,
        "late_frames": loop.late,
        "servo": None,
        "hands": [],
        "failure": loop.failure or None,
        "task": strict(task(loop.monitor, 1)),
        "statistics": strict(statistics(loop.monitor)),
    }
    lines = [
        f"session   {loop.wall:.1f} s, {pace.simulated:.2f} s simulated "
        f"({report['real_time_factor']:.2f} of real time{_slip(pace.slipped)}), "
        f"{loop.frames} frames, {loop.late} of them late"
    ]
    if status is not None:
        report["servo"] = {"cycles": status.tick, "dropped": status.late, "lateness": status.lateness}
        lines.append(
            f"servo     {status.tick} cycles, {status.late} dropped, in its last second at most "
            f"{1e3 * status.lateness:.2f} ms late"
        )
    for n, hand in enumerate(loop.hands.frames):
        losses = status.hands[n].losses if status else 0
        report["hands"].append({"name": hand.name, "device": hand.device, "losses": losses, "message": hand.message})
        lines.append(f"{hand.name:<9} {hand.device}: lost {losses} times{'; ' + hand.message if hand.message else ''}")
    lines += _task_lines(loop)
    if loop.failure:
        lines.append(f"stopped   {loop.failure}")
    report["text"] = "\n".join(lines)
    return report


def _task_lines(loop: LiveLoop) -> list[str]:
    """How the task ended, and the figures that the paper gives of a trial."""
    monitor = loop.monitor
    ended, numbers = monitor.outcome(0), statistics(monitor)
    lines = [] if monitor.goal is None else [f"task      {ended.outcome}: {ended.reason}"]
    for name, key in (("distance", "trap_distance"), ("contact", "contact_force")):
        part = numbers.get(key)
        if part and part.get("mean") is not None:
            lines.append(f"{name:<9} {part['mean']:.3g} ± {part['std']:.2g} {part['unit']}")
    return lines


def _slip(seconds: float) -> str:
    return f", {seconds:.2f} s given up" if seconds > 0.0 else ""
