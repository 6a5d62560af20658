"""Live sessions: a scene simulated in pace with the clock, moved by operators, felt, shown and recorded.

In comes a scene, with devices for its hands; out come frames, 120 a second, and recordings that replay bit for bit.
What all rooms of a session speak is here: a `LiveFrame` is what the live loop publishes of a moment, to page, recording
and ROS; a `SessionMonitor` says what to warn of in it; a command is checked where it is carried out; a `Sink` gets the
ones and gives the others. Open `session` first (what `otwarp teleop` runs), then `session.live` (one tick of it).

    perception  what the loop asks of a camera that says where the bodies are
    operators   which hand moves which traps, what it feels of the scene, and the servo between
    recording   the file of a session, its writer beside the loop, and the replay of its forces
    budget      the reduced scene: what this machine carries in time with the clock
    page        the session in a browser, in a process of its own
    session     the live loop that couples all of these to a simulation, and the session around it

`session` imports all of the others, and these only what is here (`budget` not even that).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from otwarp.haptics.core import ServoFrame, Vec3
from otwarp.haptics.servo.link import ServoStatus
from otwarp.scene import Scene
from otwarp.simulation.frame import Frame

if TYPE_CHECKING:  # it stands beside this, and pages that only draw need it no more than a simulation
    from otwarp.teleop.perception import PerceptionNow

HANDS = ("left", "right")
"""Order of `LiveFrame.hand_force`, as the simulation's readout has it."""
AT_THE_CLAMP = 0.98
"""Part of the clamp from which an operator is warned: less is felt than there is."""
AHEAD = 1.0
"""Micrometres by which a hand may be ahead of its traps: more than one goes in a tick at 100 µm/s."""
BEHIND = 0.95
"""Part of the wanted speed below which the operator is warned."""


def vec3(values: Iterable[float]) -> Vec3:
    """Three numbers of an array as floats of Python."""
    x, y, z = (float(v) for v in values)
    return x, y, z


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
        engine: What computes the force on hands: `compiled`, or `in Python` and why; "" for unknown.
        perceived: What a camera sees, where the scene is its twin; None without one.
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
    engine: str = ""
    perceived: PerceptionNow | None = None


class SessionMonitor:
    """Warnings of a session, one line each.

    Args:
        scene: What is simulated.
        reach: (T,) distance from each focus where its force on the sphere that it holds ends [µm].
    """

    def __init__(self, scene: Scene, reach: np.ndarray):
        self._scene = scene
        self._reach = np.asarray(reach, dtype=float)
        self._limit = np.array([body.warning_force for body in scene.bodies])

    def warnings(self, frame: Frame, hands: tuple[HandFrame, ...], pace: PaceNow) -> tuple[str, ...]:
        """One line for each warning that holds at present: of traps, contacts, hands, what lags, and the pace."""
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


@dataclass(frozen=True, slots=True)
class MoveTraps:
    """Put traps somewhere: index → focus [µm]. Traps that a hand holds at the time stay with the hand.

    Attributes:
        positions: Where to.
        gently: At no more than `operators.hands.GENTLE` µm per simulated second, or a trap's own speed limit where that
            is lower, instead of at once.
    """

    positions: Mapping[int, Vec3] = field(default_factory=dict)
    gently: bool = False


@dataclass(frozen=True, slots=True)
class ShiftTraps:
    """Move traps by the same displacement [µm]."""

    traps: tuple[int, ...]
    by: Vec3


@dataclass(frozen=True, slots=True)
class SetPower:
    """Power of traps [mW]; no traps named means all."""

    power: float
    traps: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class SetGains:
    """Gains of a hand; None leaves one as it is.

    Attributes:
        hand: `left` or `right`.
        motion_gain: [µm/m].
        force_gain: [N/pN].
    """

    hand: str
    motion_gain: float | None = None
    force_gain: float | None = None


@dataclass(frozen=True, slots=True)
class SetSpeed:
    """Simulated seconds per second: below 1 slow motion."""

    speed: float


@dataclass(frozen=True, slots=True)
class Pause:
    """Stand still, or go on. A pause disarms the hands; going on leaves them so."""

    on: bool


@dataclass(frozen=True, slots=True)
class Reset:
    """Begin anew with the scene as authored."""


@dataclass(frozen=True, slots=True)
class Record:
    """Start a recording in a file (None: one named by the time, in the session's folder), or end it."""

    on: bool
    file: str | None = None


@dataclass(frozen=True, slots=True)
class Arm:
    """Let the devices of a hand, or of both (None), push."""

    hand: str | None = None


@dataclass(frozen=True, slots=True)
class Disarm:
    """Let the forces of a hand, or of both (None), fall to zero."""

    hand: str | None = None


@dataclass(frozen=True, slots=True)
class Stop:
    """End the session."""


Command = MoveTraps | ShiftTraps | SetPower | SetGains | SetSpeed | Pause | Reset | Record | Arm | Disarm | Stop


class Sink(Protocol):
    """All calls come from the loop's thread and must not block: what cannot be sent now is dropped."""

    @property
    def interval(self) -> float:
        """Least time between two frames that it wants [s]; 0 for every frame."""
        ...

    def publish(self, live: LiveFrame) -> None:
        """Take a frame."""
        ...

    def commands(self) -> Sequence[Command]:
        """What was asked since the last call, in order."""
        ...

    def complain(self, line: str) -> None:
        """A command was refused, or something else went wrong that its user should read."""
        ...

    def close(self) -> None:
        """The session ends; may be called more than once."""
        ...
