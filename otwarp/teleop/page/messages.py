"""What the session and its page's process tell each other, and how it passes through a pipe.

Session → page: an `Order` once, then `PageFrame` or a line of complaint. Page → session: `Ready` or `Failed` once, then
`Shown` for each frame (the credit for the next one), `Asked` for what the user did, `Visitors`.
Both ends are ours and the pipe is nobody else's, so pickles may pass.
"""

from __future__ import annotations

import pickle
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from otwarp.haptics.core.fields import Matrix
from otwarp.haptics.core.types import Vec3
from otwarp.haptics.servo.link import ServoStatus
from otwarp.teleop.core.commands import Command
from otwarp.teleop.core.frame import HandFrame, LiveFrame, PaceNow
from otwarp.teleop.page.drawing import Drawing

_LENGTH = struct.Struct("!Q")


@dataclass(frozen=True, eq=False, kw_only=True)
class Order:
    """All that the page's process must know; `port` None for the first free one from the usual one on."""

    drawing: Drawing
    host: str
    port: int | None
    token: str | None
    pointers: Mapping[str, str]
    axis_maps: Mapping[str, Matrix]


@dataclass(frozen=True, eq=False, kw_only=True)
class PageFrame:
    """What of a `LiveFrame` the page shows, for B bodies and T traps in float32.

    Attributes:
        stamp: `time.monotonic()` of its publication [s]; one clock for all processes of a machine.
        position, orientation: (B, 3) and (B, 4) of the bodies' prims.
        trap_position, trap_power, trap_force, trap_distance: (T, 3), (T,), (T, 3), (T,).
        contact_force, contact_load: (B, 3), (B,).
        beat, time, hand_force, hands, servo, pace, warnings, task, recording, trap_goals: See `LiveFrame` and `Frame`.
    """

    stamp: float
    beat: int
    time: float
    position: np.ndarray
    orientation: np.ndarray
    trap_position: np.ndarray
    trap_power: np.ndarray
    trap_force: np.ndarray
    trap_distance: np.ndarray
    contact_force: np.ndarray
    contact_load: np.ndarray
    hand_force: np.ndarray
    hands: tuple[HandFrame, ...]
    servo: ServoStatus | None
    pace: PaceNow
    warnings: tuple[str, ...]
    task: str
    recording: str | None
    trap_goals: Mapping[int, Vec3] = field(default_factory=dict)

    @classmethod
    def of(cls, live: LiveFrame, stamp: float) -> PageFrame:
        """Copies, so that the session may overwrite its arrays."""
        arrays = ("position", "orientation", "trap_position", "trap_power", "trap_force", "trap_distance")
        names = (*arrays, "contact_force", "contact_load")
        return cls(
            stamp=stamp,
            beat=live.beat,
            time=live.frame.time,
            **{name: np.array(getattr(live.frame, name)[0], dtype=np.float32) for name in names},
            hand_force=np.array(live.hand_force, dtype=np.float32),
            hands=live.hands,
            servo=live.servo,
            pace=live.pace,
            warnings=live.warnings,
            task=live.task,
            recording=live.recording,
            trap_goals=dict(live.trap_goals),
        )


@dataclass(frozen=True, slots=True)
class Complaint:
    """A line that the page's users should read."""

    line: str


@dataclass(frozen=True, slots=True)
class Ready:
    """The page listens on this port; who comes needs this token, None for none."""

    port: int
    token: str | None


@dataclass(frozen=True, slots=True)
class Failed:
    """The page cannot be; why."""

    line: str


@dataclass(frozen=True, slots=True)
class Shown:
    """A frame was applied: the next one may come.

    Attributes:
        beat: Of the frame.
        delay: The latest `latency.Latency.delay` [s], None without one.
    """

    beat: int
    delay: float | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """A user wants something."""

    command: Command


@dataclass(frozen=True, slots=True)
class Visitors:
    """How many browser windows look."""

    count: int


def send(pipe: BinaryIO, message: object) -> None:
    """Write a message and flush; OSError or ValueError when the other side has gone."""
    body = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    pipe.write(_LENGTH.pack(len(body)))
    pipe.write(body)
    pipe.flush()


def receive(pipe: BinaryIO) -> Any:
    """The next message.

    Raises:
        EOFError: The other side has gone, in mid-message or between two.
    """
    head = pipe.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError("the pipe has ended")
    size = _LENGTH.unpack(head)[0]
    body = pipe.read(size)
    if len(body) < size:
        raise EOFError("the pipe has ended in mid-message")
    return pickle.loads(body)
