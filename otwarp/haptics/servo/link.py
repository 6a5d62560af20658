"""What passes between the servo and its parent besides scenes and hands: orders one way, status the other."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from otwarp.errors import InputError
from otwarp.haptics.core.config import Gains
from otwarp.haptics.core.mailbox import RecordLayout
from otwarp.haptics.core.types import SceneFrame

TEXT = 160
"""Bytes of a line about one hand."""
GRANTS = 480
"""Bytes of what the operating system gave."""
START, START_SPHERE, START_TRAP = 16384, 384, 512
"""Bytes for what a chain remembers, and for each sphere and trap of its scene: a number takes up to 24 of them."""
RUNS = ("starting", "running", "ending", "stopped", "failed")
"""What `ServoStatus.state` may be, in the order of their codes."""


@dataclass(frozen=True, slots=True)
class Orders:
    """What the parent wants; the latest counts, so arming is told by counters: a missed message loses none.

    Attributes:
        beat: Counts orders; the servo disarms when it stands still.
        arm, disarm: How often each hand was armed and disarmed.
        stop: Whether to end.
        gains: Motion gain [µm/m] and force gain [N/pN] of each hand, None for as configured; empty for all so.
        take: Number of the recording that runs, 0 for none.
    """

    beat: int
    arm: tuple[int, ...]
    disarm: tuple[int, ...]
    stop: bool = False
    gains: tuple[Gains, ...] = ()
    take: int = 0

    def next(self, *, arm: int | None = None, disarm: int | None = None, stop: bool = False) -> Orders:
        """The next orders: one more beat, and a hand armed or disarmed; all else as it was."""
        return replace(
            self,
            beat=self.beat + 1,
            arm=tuple(n + (i == arm) for i, n in enumerate(self.arm)),
            disarm=tuple(n + (i == disarm) for i, n in enumerate(self.disarm)),
            stop=self.stop or stop,
        )


@dataclass(frozen=True, slots=True)
class HandStatus:
    """How a hand's device is.

    Attributes:
        present: Whether it answers.
        losses: How often it stopped answering.
        message: One line about the last thing that went wrong or right, empty if nothing did.
    """

    present: bool = False
    losses: int = 0
    message: str = ""


@dataclass(frozen=True, slots=True)
class ServoStatus:
    """How the servo is.

    Attributes:
        tick: Counts cycles; one that stands still means a servo that stands still.
        time: On its clock [s].
        state: `starting`, `running`, `ending`, `stopped` or `failed`.
        late: Deadlines that were dropped because a cycle took too long or woke too late.
        lateness: Worst wake after a deadline within the last second [s].
        refused: States of the simulation that were not finite.
        torn: Reads given up because the writer was in the way.
        hands: Each hand's device.
        grants: What the operating system gave, or why the servo failed.
    """

    tick: int
    time: float
    state: str
    late: int
    lateness: float
    refused: int
    torn: int
    hands: tuple[HandStatus, ...]
    grants: str = ""


class OrdersLayout:
    """`Orders` in a mailbox, for a number of hands; a gain that is as configured is NaN."""

    kind = b"orders"

    def __init__(self, hands: int):
        self._record = RecordLayout(self.kind, f"3Q{2 * hands}Q{2 * hands}d")
        self._hands = hands
        self.capacities, self.size = (hands, 0), self._record.size

    def pack(self, buffer: bytearray, value: Orders) -> None:
        """See `mailbox.Layout`."""
        gains = value.gains or ((None, None),) * self._hands
        flat = [math.nan if gain is None else gain for pair in gains for gain in pair]
        self._record.pack(buffer, (value.beat, value.stop, value.take, *value.arm, *value.disarm, *flat))

    def unpack(self, buffer: bytearray) -> Orders:
        """See `mailbox.Layout`."""
        n = self._hands
        beat, stop, take, *rest = self._record.unpack(buffer)
        flat = [None if gain != gain else gain for gain in rest[2 * n :]]
        gains = tuple(zip(flat[::2], flat[1::2], strict=True)) if any(gain is not None for gain in flat) else ()
        return Orders(beat, tuple(rest[:n]), tuple(rest[n : 2 * n]), bool(stop), gains, take)


@dataclass(frozen=True, slots=True)
class Start:
    """What a hand's chain remembered when a recording began.

    Attributes:
        take: Number of the recording.
        tick: Its first cycle.
        text: `Rendering.snapshot` as JSON; "" if it was too long for its mailbox.
    """

    take: int
    tick: int
    text: str


@dataclass(frozen=True, slots=True)
class Cycles:
    """What came out of a hand's ring, see `process.ServoProcess.drain`.

    Attributes:
        records: `ring.CYCLE`, one after another; `ring.cycles_of` reads them.
        lost: How many of this recording are missing so far, because they were not fetched in time.
        start: What the chain remembered before the first record of this recording; None until it is known.
        scenes: States published since any hand's were fetched, beginning with the one before the recording.
    """

    records: bytes = b""
    lost: int = 0
    start: Start | None = None
    scenes: tuple[SceneFrame, ...] = ()


class StartLayout:
    """`Start` in a mailbox.

    Args:
        spheres, traps: Most that a scene may hold; they are part of what is remembered.
    """

    kind = b"start"

    def __init__(self, spheres: int, traps: int):
        self._room = START + START_SPHERE * spheres + START_TRAP * traps
        self._record = RecordLayout(self.kind, f"3Q{self._room}s")
        self.capacities, self.size = (spheres, traps), self._record.size

    def pack(self, buffer: bytearray, value: Start) -> None:
        """See `mailbox.Layout`."""
        data = value.text.encode()
        if len(data) > self._room:
            raise InputError(f"start of a recording: {len(data)} bytes; must be at most {self._room}")
        self._record.pack(buffer, (value.take, value.tick, len(data), data))

    def unpack(self, buffer: bytearray) -> Start:
        """See `mailbox.Layout`."""
        take, tick, size, data = self._record.unpack(buffer)
        return Start(take, tick, data[:size].decode())


class StatusLayout:
    """`ServoStatus` in a mailbox, for a number of hands."""

    kind = b"status"

    def __init__(self, hands: int):
        self._record = RecordLayout(self.kind, f"QdQQdQQ{GRANTS}s" + f"QQ{TEXT}s" * hands)
        self.capacities, self.size = (hands, 0), self._record.size

    def pack(self, buffer: bytearray, value: ServoStatus) -> None:
        """See `mailbox.Layout`."""
        head = (value.tick, value.time, RUNS.index(value.state), value.late, value.lateness, value.refused, value.torn)
        flat: list[float | bytes] = [*head, _cut(value.grants, GRANTS)]
        for hand in value.hands:
            flat += (hand.present, hand.losses, _cut(hand.message, TEXT))
        self._record.pack(buffer, flat)

    def unpack(self, buffer: bytearray) -> ServoStatus:
        """See `mailbox.Layout`."""
        tick, time, state, late, lateness, refused, torn, grants, *rest = self._record.unpack(buffer)
        rows = zip(rest[::3], rest[1::3], rest[2::3], strict=True)
        hands = tuple(HandStatus(bool(present), losses, _text(message)) for present, losses, message in rows)
        return ServoStatus(tick, time, RUNS[state], late, lateness, refused, torn, hands, _text(grants))


def _cut(text: str, size: int) -> bytes:
    """A line as UTF-8 of at most `size` bytes."""
    return " ".join(text.split()).encode()[:size]


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode(errors="ignore")
