"""What passes between the servo and its parent besides scenes and hands: orders one way, status the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

from otwarp.haptics.mailbox import RecordLayout

TEXT = 160
"""Bytes of a line about one hand."""
GRANTS = 480
"""Bytes of what the operating system gave."""
RUNS = ("starting", "running", "ending", "stopped", "failed")
"""What `ServoStatus.state` may be, in the order of their codes."""


@dataclass(frozen=True, slots=True)
class Orders:
    """What the parent wants; the latest counts, so arming is told by counters: a missed message loses none.

    Attributes:
        beat: Counts orders; the servo disarms when it stands still.
        arm, disarm: How often each hand was armed and disarmed.
        stop: Whether to end.
    """

    beat: int
    arm: tuple[int, ...]
    disarm: tuple[int, ...]
    stop: bool = False

    def next(self, *, arm: int | None = None, disarm: int | None = None, stop: bool = False) -> Orders:
        """The next orders: one more beat, and a hand armed or disarmed."""
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
    """`Orders` in a mailbox, for a number of hands."""

    kind = b"orders"

    def __init__(self, hands: int):
        self._record = RecordLayout(self.kind, f"2Q{2 * hands}Q")
        self.capacities, self.size = (hands, 0), self._record.size

    def pack(self, buffer: bytearray, value: Orders) -> None:
        """See `mailbox.Layout`."""
        self._record.pack(buffer, (value.beat, value.stop, *value.arm, *value.disarm))

    def unpack(self, buffer: bytearray) -> Orders:
        """See `mailbox.Layout`."""
        beat, stop, *counts = self._record.unpack(buffer)
        half = len(counts) // 2
        return Orders(beat, tuple(counts[:half]), tuple(counts[half:]), bool(stop))


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
