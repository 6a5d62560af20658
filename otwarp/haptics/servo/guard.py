"""The guardian as a servo and its parent see it: what passes between the three, and the parent's handle on its process.

A device whose driver goes on without the servo renders the servo's last force for ever. So a third process, the
guardian (`guardian`), outlives both: it sends zero force when the servo stands still or was killed. The servo tells it
where each device is (`Address`), and it tells both for which of them it is ready (`GuardReport`); without it, nothing
that needs it is armed.
"""

from __future__ import annotations

import os
import pickle
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.core import ServoFrame
from otwarp.haptics.core.shared_memory import Mailbox, RecordLayout
from otwarp.haptics.devices import KINDS, DeviceSpec
from otwarp.haptics.servo.link import TEXT, ServoStatus, cut, text_of

ADDRESS = 2048
"""Bytes of what finds a device."""
SILENCE = 0.2
"""Seconds without word of the guardian after which the sides that need it disarm: it speaks every 5 ms. They disarm at
once when another speaks in its place."""
STANDS = 0.2
"""Seconds without a cycle after which a parent says that the servo stands still."""
SHARE = 0.5
"""Part of the time after which a gap disarms that a guardian lets pass: zero force is there before it is over."""
RESTART_AFTER = 1.0
"""Seconds from one start of a guardian to the next, where one is killed again and again."""
END_WITHIN = 2.0
"""Seconds that a guardian has to end once its servo has; it lingers for 0.5 s after one that was killed."""
ENDED = "the servo has ended, nothing is felt any more"
LENGTH = struct.Struct("!Q")
"""Goes before a pickled order in a pipe."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where an open device is.

    Attributes:
        number: Counts its openings, from 1.
        text: What `zero_force` of the device's module finds it by.
    """

    number: int
    text: str


class AddressLayout:
    """`Address` in a mailbox."""

    kind, capacities = b"address", (0, 0)

    def __init__(self) -> None:
        self._record = RecordLayout(self.kind, f"2Q{ADDRESS}s")
        self.size = self._record.size

    def pack(self, buffer: bytearray, value: Address) -> None:
        """See `shared_memory.Layout`."""
        data = value.text.encode()
        if len(data) > ADDRESS:
            raise InputError(f"address of a device: {len(data)} bytes; must be at most {ADDRESS}")
        self._record.pack(buffer, (value.number, len(data), data))

    def unpack(self, buffer: bytearray) -> Address:
        """See `shared_memory.Layout`."""
        number, size, data = self._record.unpack(buffer)
        return Address(number, data[:size].decode())


@dataclass(frozen=True, slots=True)
class SideReport:
    """What the guardian says of one side.

    Attributes:
        ready: Number of the address that it can send zero force to; 0 for none.
        sent: How often it has sent zero force since the servo last moved.
        message: Why it could not prepare or send, or "".
    """

    ready: int = 0
    sent: int = 0
    message: str = ""


@dataclass(frozen=True, slots=True)
class GuardReport:
    """What the guardian says, every few milliseconds.

    Attributes:
        number: Which one it is: counts the guardians of a session, from 1.
        beat: Counts reports.
        hands: One for each side.
    """

    number: int
    beat: int
    hands: tuple[SideReport, ...]


class GuardLayout:
    """`GuardReport` in a mailbox, for one or two sides."""

    kind = b"guard"

    def __init__(self, hands: int):
        self._record = RecordLayout(self.kind, "2Q" + f"2Q{TEXT}s" * hands)
        self.capacities, self.size = (hands, 0), self._record.size

    def pack(self, buffer: bytearray, value: GuardReport) -> None:
        """See `shared_memory.Layout`."""
        flat: list[Any] = [value.number, value.beat]
        for hand in value.hands:
            flat += (hand.ready, hand.sent, cut(hand.message, TEXT))
        self._record.pack(buffer, flat)

    def unpack(self, buffer: bytearray) -> GuardReport:
        """See `shared_memory.Layout`."""
        number, beat, *rest = self._record.unpack(buffer)
        rows = zip(rest[::3], rest[1::3], rest[2::3], strict=True)
        return GuardReport(number, beat, tuple(SideReport(ready, sent, text_of(text)) for ready, sent, text in rows))


@dataclass(frozen=True, slots=True)
class GuardOrder:
    """All that a guardian must know.

    Attributes:
        kinds: Of the devices.
        names: Of the mailboxes, as `process.ServoProcess.names`.
        traps: Most traps.
        after: Seconds without a cycle after which it sends zero force.
        servo: Number of the servo's process.
        realtime: Whether to ask the system for punctuality.
        number: Of the guardian, see `GuardReport`.
    """

    kinds: tuple[str, ...]
    names: dict[str, Any]
    traps: int
    after: float
    servo: int
    realtime: bool
    number: int = 0


@dataclass(frozen=True, slots=True)
class Residue:
    """What is known of a side's force at its device while no servo drives it.

    Attributes:
        zero: Whether it is known to be zero.
        message: One line.
    """

    zero: bool
    message: str


class Guard:
    """The guardian's process, as the parent of the servo holds it; started anew if it ends before the servo does.

    Args:
        specs: Devices of the sides.
    """

    def __init__(self, specs: Sequence[DeviceSpec]):
        self.kinds = tuple(spec.kind for spec in specs)
        self.box = Mailbox.create(GuardLayout(len(specs)))
        self._process: subprocess.Popen[bytes] | None = None
        self._order: GuardOrder | None = None
        self._started = 0.0
        self.report = GuardReport(0, 0, (SideReport(),) * len(specs))

    @property
    def pid(self) -> int | None:
        """Number of its process."""
        return self._process.pid if self._process else None

    def start(self, order: GuardOrder) -> None:
        """Start one, the next in number."""
        self._order = order = replace(order, number=order.number + 1)
        self._started = time.monotonic()
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        command = [sys.executable, "-c", "from otwarp.haptics.servo.guardian import guardian; guardian()"]
        quiet = subprocess.DEVNULL  # it must not keep the parent's pipes open
        # a session of its own: what ends the parent's terminal or group does not reach it
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet, env=environment, start_new_session=True
        )
        message = pickle.dumps(order)
        with suppress(OSError):  # one that ended at once is started anew
            assert self._process.stdin is not None
            self._process.stdin.write(LENGTH.pack(len(message)) + message)
            self._process.stdin.close()

    def look(self, over: bool) -> GuardReport:
        """Its newest report; one that was killed is started anew, unless the servo is over in good order."""
        self.report = self.box.read() or self.report
        # one that has seen its servo end has done its work
        killed = self._process is not None and self._process.poll() not in (None, 0)
        if killed and not over and self._order is not None and time.monotonic() - self._started > RESTART_AFTER:
            self.start(self._order)
        return self.report

    def stop(self) -> None:
        """Let it end by itself, as it does after the servo, and close its mailbox; may be called more than once."""
        process, self._process = self._process, None
        if process is not None:
            try:
                process.wait(END_WITHIN)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            self.report = self.box.read() or self.report
        self.box.close()


def kinds_that_keep(keeps: str) -> list[str]:
    """Kinds of devices whose last force stays with the `driver`, with a `library`, or with `nothing`."""
    return [kind for kind, row in KINDS.items() if row.keeps == keeps]


def needs_guardian(specs: Sequence[DeviceSpec]) -> bool:
    """Whether a driver of one of these devices goes on rendering when the servo is gone."""
    return any(KINDS[spec.kind].keeps == "driver" for spec in specs)


def how_it_ended(code: int | None) -> str:
    """What became of a servo's process by its exit code, or that it runs."""
    if code is None:
        return "the servo stands still"
    if code < 0:
        with suppress(ValueError):
            return f"the servo was killed ({signal.Signals(-code).name})"
    return f"the servo ended with {code}"


def residue(
    spec: DeviceSpec, code: int | None, status: ServoStatus | None, last: ServoFrame | None, report: SideReport | None
) -> Residue | None:
    """What is known of a force while the servo does not run; None while it does.

    Args:
        spec: The device.
        code: Exit code of the servo, None while it lives.
        status, last: What it last said.
        report: What the guardian says of this side, None without one.
    """
    if code is None and (last is None or time.perf_counter() - last.time < STANDS):
        return None
    anew = "" if code is None else "; start the session anew"
    if status is not None and status.state in ("stopped", "failed"):
        return Residue(True, f"{ENDED}{anew}")
    how, keeps = how_it_ended(code), KINDS[spec.kind].keeps
    if keeps == "nothing":
        return Residue(True, f"{how}, nothing is felt{anew}")
    if keeps == "library":
        driver = "its driver, a part of the servo, and whether its motors are off is for the device to say"
        return Residue(False, f"{how}, and with it {driver}: hold it, and switch it off if it pushes{anew}")
    if report is not None and report.sent and not report.message:
        return Residue(True, f"{how}, the guardian has sent zero force{anew}")
    why = f" ({report.message})" if report is not None and report.message else ""
    return Residue(False, f"{how}, and zero force is not sent{why}: it may push still, switch it off{anew}")
