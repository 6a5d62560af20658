"""What may be asked of the live loop, and who asks: commands, and `Sink`, which gets frames and gives commands.

Each command is checked where it is carried out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from otwarp.haptics.core.types import Vec3
from otwarp.teleop.core.frame import LiveFrame


@dataclass(frozen=True, slots=True)
class MoveTraps:
    """Put traps somewhere: index → focus [µm]. Traps that a hand holds at the time stay with the hand.

    Attributes:
        positions: Where to.
        gently: At no more than `trap_commands.GENTLE` µm per simulated second, or a trap's own speed limit where that
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
