"""The guardian: a process that sends zero force to devices whose servo stands still or was killed, and outlives both it
and its parent.

It watches the cycles of the servo in shared memory, every 5 ms: the servo's death and its standing still (stopped,
swapped out) look alike there, and of the first the system also tells, at once. Where the guardian itself is kept
waiting, the whole time between two looks counts: a servo that went on meanwhile has left a newer cycle.
Each device has a thread, which prepares while the servo lives, so that nothing is left to import, to register or to
find when zero force must go out, and so that a device that hangs does not keep the other waiting. It is sent again and
again while the servo stands still: a last force that was under way by another connection may come after the first.

It ends when the servo has ended in order, or half a second after one that was killed. No signal of a terminal ends it.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module

from otwarp.errors import InputError
from otwarp.haptics.core import ServoFrame, ZeroForce
from otwarp.haptics.core.realtime import lock_memory, process_ended, schedule_threads, timer
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices import KINDS
from otwarp.haptics.servo.guard import LENGTH, Address, AddressLayout, GuardLayout, GuardOrder, GuardReport, SideReport
from otwarp.haptics.servo.link import HandLayout, StatusLayout

POLL = 0.005
"""Seconds between two looks at the servo."""
REPEAT = 0.02
"""Seconds between two messages of zero force while the servo stands still."""
RETRY = 1.0
"""Seconds after which a device that could not be prepared for is tried again."""
LINGER = 0.5
"""Seconds after the first of them to a servo that was killed until the guardian ends."""
GIVE_UP = 10.0
"""Seconds after which it ends in any case when the servo has died: a device that cannot be reached by then is away."""
FORGOTTEN = 60.0
"""Seconds without a cycle after which a servo counts as dead where the system does not tell."""
PRIORITY = 70
"""Of SCHED_FIFO: below the servo's."""
SWITCH = 2e-4
"""Seconds after which Python takes the interpreter from a thread that prepares, as in the servo."""
ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGBREAK", "SIGPIPE")
"""Signals that it ignores: it ends with its servo."""


class Sender:
    """The thread that prepares and sends zero force to one device.

    Args:
        make: What sends it to an address.
    """

    def __init__(self, make: Callable[[str], ZeroForce]):
        self._make = make
        self._address = Address(0, "")
        self._zero: ZeroForce | None = None
        self._wanted = False
        self._wake = threading.Event()
        self.report = SideReport()
        threading.Thread(target=self._run, name="zero-force", daemon=True).start()

    def prepare(self, address: Address) -> None:
        """Be ready to send zero force there."""
        self._address = address
        self._wake.set()

    def send(self) -> None:
        """Send zero force; never waits."""
        self._wanted = True
        self._wake.set()

    def forget(self) -> None:
        """The servo moves: what was sent is past."""
        if self.report.sent:
            self.report = SideReport(self.report.ready)

    @property
    def due(self) -> bool:
        """Whether there is a device, and no zero force has gone out yet."""
        return bool(self._address.text) and not self.report.sent

    def _run(self) -> None:
        made = Address(0, "")
        while True:
            self._wake.wait(RETRY if self.report.message else None)
            self._wake.clear()
            address = self._address
            wanted, self._wanted = self._wanted, False
            try:
                if address.text and (self._zero is None or address.text != made.text):
                    if self._zero is not None:
                        self._zero.close()
                        self._zero = None
                    self._zero = self._make(address.text)
                made = address
                if not wanted or self._zero is None:
                    self.report = SideReport(made.number, self.report.sent)
                else:
                    self._zero.send()
                    self.report = SideReport(made.number, self.report.sent + 1)
            except Exception as error:  # whatever a driver raises, it is tried again, and reported
                self.report = SideReport(0, self.report.sent, str(error) or type(error).__name__)


class GuardedSide:
    """One side as the guardian watches it.

    Args:
        frames: What the servo publishes each cycle.
        addresses: Where its device is.
        sender: Of zero force; None for a device that needs none.
    """

    def __init__(self, frames: Mailbox[ServoFrame], addresses: Mailbox[Address], sender: Sender | None):
        self._frames, self._addresses, self.sender = frames, addresses, sender
        self._moved = time.monotonic()
        self._next = -math.inf

    def look(self, now: float) -> float:
        """Seconds up to `now` for which the servo has stood still; the clock must have been asked before."""
        if self.sender is not None and (address := self._addresses.read()) is not None:
            self.sender.prepare(address)
        if self._frames.read() is not None:
            self._moved, self._next = now, -math.inf
            if self.sender is not None:
                self.sender.forget()
        return now - self._moved

    def send(self, now: float) -> None:
        """Send zero force, if it is time."""
        if self.sender is not None and now >= self._next:
            self._next = now + REPEAT
            self.sender.send()


def guardian() -> None:
    """What the process does: take its order from stdin, watch, end with the servo."""
    for name in ENDINGS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    pipe = sys.stdin.buffer
    size = pipe.read(LENGTH.size)
    if len(size) == LENGTH.size:
        order: GuardOrder = pickle.loads(pipe.read(LENGTH.unpack(size)[0]))
        try:
            watch(order)
        except InputError:  # its parent, who owns the mailboxes, has gone, and the servo goes with it
            os._exit(2)
    os._exit(0)  # a thread may hang in a driver


def watch(order: GuardOrder) -> None:
    """SideReport the servo until it has ended.

    Raises:
        InputError: A mailbox is not there.
    """
    n, names = len(order.kinds), order.names
    ended = process_ended(order.servo)
    status_box = Mailbox.attach(StatusLayout(n), names["status"])
    reports = Mailbox.attach(GuardLayout(n), names["guard"])
    sides = [
        GuardedSide(
            Mailbox.attach(HandLayout(order.traps), names["hands"][i]),
            Mailbox.attach(AddressLayout(), names["addresses"][i]),
            _sender(kind, order.realtime),
        )
        for i, kind in enumerate(order.kinds)
    ]
    if order.realtime:
        timer()
        lock_memory()
    sys.setswitchinterval(SWITCH)
    beat, state, died = 0, "", math.inf
    while True:
        now = time.monotonic()
        status = status_box.read()
        state = status.state if status is not None else state
        if state in ("stopped", "failed"):
            return
        still = [side.look(now) for side in sides]
        gone = ended(0.0) if ended is not None else min(still) > FORGOTTEN
        for side, seconds in zip(sides, still, strict=True):
            if gone or (seconds >= order.after and state in ("running", "ending")):
                side.send(now)
        if gone:
            died = min(died, now)
            due = any(side.sender is not None and side.sender.due for side in sides)
            if now - died > (GIVE_UP if due else LINGER):
                return
        beat += 1
        side_reports = tuple(side.sender.report if side.sender else SideReport() for side in sides)
        reports.write(GuardReport(order.number, beat, side_reports))
        if ended is None or gone:
            time.sleep(POLL)
        else:
            ended(POLL)  # the system tells at once


def _sender(kind: str, realtime: bool) -> Sender | None:
    """What sends zero force to a device of a kind; None where nothing goes on without the servo.

    The threads of a client send, so once it is made all threads are scheduled before those of ordinary processes: not
    before, for what it imports takes a second of a core.
    """
    row = KINDS[kind]
    if row.keeps != "driver":
        return None
    module = row.home.split(":")[0]

    def make(address: str) -> ZeroForce:
        """The device's own way to zero, its threads first in line."""
        zero = import_module(module).zero_force(address)
        if realtime:
            schedule_threads(PRIORITY)
        return zero

    return Sender(make)
