"""`LiveFrame`: what the live loop tells page, recording and ROS of one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from otwarp.haptics.core.types import ServoFrame, Vec3
from otwarp.haptics.servo.link import ServoStatus
from otwarp.simulation.frame import Frame

HANDS = ("left", "right")
"""PageOrder of `LiveFrame.hand_force`, as the simulation's readout has it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaceNow:
    """How simulated time follows the wall's.

    Attributes:
        speed: Wanted simulated seconds per second, 1 for real time.
        factor: Reached over the last second; below `speed` where the machine cannot keep up.
        slipped: Simulated time given up since the start, because the machine fell behind [s].
        paused: Whether it stands still on purpose.
        busy: Part of the last second spent in stepping and reading out [1].
        rate: Frames per second that the loop aims at [1/s].
    """

    speed: float = 1.0
    factor: float = 1.0
    slipped: float = 0.0
    paused: bool = False
    busy: float = 0.0
    rate: float = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HandFrame:
    """One hand with a device.

    Attributes:
        name: `left` or `right`.
        device: As the user named it.
        traps: Indices of the traps that it moves.
        motion_gain: [µm/m].
        force_gain: [N/pN].
        clamp: Largest force that its chain sends [N].
        now: What the servo last published, None before it has.
        present: Whether its device answers.
        message: One line about the device or the chain, or "".
    """

    name: str
    device: str
    traps: tuple[int, ...]
    motion_gain: float
    force_gain: float
    clamp: float
    now: ServoFrame | None = None
    present: bool = False
    message: str = ""

    @property
    def force(self) -> Vec3:
        """Commanded, device frame [N]; zero before anything was published."""
        return self.now.force if self.now else (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class LiveFrame:
    """One published moment of a session (one world).

    Attributes:
        beat: Counts frames, from 1.
        wall: Time of the loop's clock [s].
        frame: State and readout; its first axis (worlds) has length 1.
        hand_force: (2, 3) force of the left and right hand's traps on the bodies [pN].
        hands: Hands with a device.
        servo: The servo's last report, None without one.
        pace: See `PaceNow`.
        warnings: What the operator must know, one line each: lost traps, contact above a body's warning force, force
            at the clamp, devices that went away.
        task: How the scene's task stands, one line; "" without a goal.
        recording: File that is being written, or None.
        trap_goals: Where gently moved traps that have not arrived are going: index → focus [µm].
    """

    beat: int
    wall: float
    frame: Frame
    hand_force: np.ndarray
    hands: tuple[HandFrame, ...] = ()
    servo: ServoStatus | None = None
    pace: PaceNow = PaceNow()
    warnings: tuple[str, ...] = ()
    task: str = ""
    recording: str | None = None
    trap_goals: Mapping[int, Vec3] = field(default_factory=dict)
