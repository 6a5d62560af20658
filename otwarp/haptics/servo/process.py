"""The servo in a process of its own: `ServoProcess`, as its parent holds it.

The child (`child`) is a fresh interpreter, not a `multiprocessing` one: that would import the parent's main module
again, and whatever that imports. It loads neither Warp nor NumPy unless a device or a chain does. Beside it runs a
guardian (`guardian`), if the driver of a device goes on without the servo.
"""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, BinaryIO, TypeVar

from otwarp.errors import InputError
from otwarp.haptics.core import SceneFrame, ServoFrame
from otwarp.haptics.core.config import checked_gains
from otwarp.haptics.core.shared_memory import SECONDS, Mailbox, Ring
from otwarp.haptics.devices import create_device, parse_devices
from otwarp.haptics.servo.child import ServoOrder
from otwarp.haptics.servo.cycles import CycleReader
from otwarp.haptics.servo.guard import (
    LENGTH,
    SHARE,
    Address,
    AddressLayout,
    Guard,
    GuardOrder,
    Residue,
    needs_guardian,
    residue,
)
from otwarp.haptics.servo.link import (
    Cycles,
    HandLayout,
    HandSetup,
    Orders,
    OrdersLayout,
    SceneLayout,
    ServoStatus,
    StartLayout,
    StatusLayout,
)
from otwarp.haptics.servo.servo import DISARM_AFTER

RATES = (10.0, 5000.0)
START_WITHIN = 60.0
"""Seconds in which the child must say that it runs; a cold disk and a busy machine take some."""
STOP_WITHIN = 5.0
"""Seconds in which it must have ended; then it is killed, and the guardian or the device itself has to do the rest."""
POLL = 0.005

T = TypeVar("T", bound=Mailbox[Any] | Ring)


class ServoProcess:
    """A servo that runs from `start` to `stop`, or as a context manager; used by one thread.

    Args:
        hands: One or two.
        spheres: Most trapped spheres of the scene.
        traps: Most traps.
        rate: Cycles per second [Hz].
        spin: See `clock.RealClock` [s].
        realtime: Whether to ask the system for punctuality.
        cpu: Core to stay on, or None.
        disarm_after: Seconds between two cycles from which on all sides disarm [s].

    Raises:
        InputError: A device or a number that cannot be, or no room for the mailboxes.
    """

    def __init__(
        self,
        hands: Sequence[HandSetup],
        *,
        spheres: int,
        traps: int,
        rate: float = 1000.0,
        spin: float = 0.0,
        realtime: bool = True,
        cpu: int | None = None,
        disarm_after: float = DISARM_AFTER,
    ):
        for name, value, (low, high) in (("rate", rate, RATES), ("spin", spin, (0.0, 1.0 / RATES[0]))):
            if not low <= value <= high:
                raise InputError(f"{name} = {value!r}: must be from {low:g} to {high:g}")
        for hand in hands:
            if b"__main__" in pickle.dumps(hand.chain):
                raise InputError(
                    f"chain = {hand.chain!r}: must be of a module that the servo can import, not of a script"
                )
        pointers, hand_names = [hand.pointer for hand in hands], [hand.name for hand in hands]
        specs = parse_devices([hand.device for hand in hands], pointers, hand_names)
        for spec in specs:
            create_device(spec)  # a bad argument is an error here, not in a process that ends
        n = len(specs)
        with ExitStack() as made:  # one that finds no room takes the others with it

            def keep(box: T) -> T:
                made.callback(box.close)
                return box

            self._scenes = keep(Mailbox.create(SceneLayout(spheres, traps)))
            self._boxes = [keep(Mailbox.create(HandLayout(traps))) for _ in specs]
            self._orders_box = keep(Mailbox.create(OrdersLayout(n)))
            self._status_box = keep(Mailbox.create(StatusLayout(n)))
            rings = [keep(Ring.create(math.ceil(SECONDS * rate))) for _ in specs]
            starts = [keep(Mailbox.create(StartLayout(spheres, traps))) for _ in specs]
            self._addresses = [keep(Mailbox.create(AddressLayout())) for _ in specs]
            self._guard = Guard(specs) if needs_guardian(specs) else None
            self._close_boxes = made.pop_all().close
        self._orders = Orders(0, (0,) * n, (0,) * n, gains=((None, None),) * n)
        self._cycles = CycleReader(rings, starts)
        self._rest: list[Cycles] = [Cycles()] * n
        self._status: ServoStatus | None = None
        self._hands: list[ServoFrame | None] = [None] * n
        names = {"scenes": self._scenes.name, "orders": self._orders_box.name, "status": self._status_box.name}
        boxes = {"hands": self._boxes, "rings": rings, "starts": starts, "addresses": self._addresses}
        names |= {kind: [box.name for box in each] for kind, each in boxes.items()}
        if self._guard is not None:
            names["guard"] = self._guard.box.name
        chains = tuple(hand.chain for hand in hands)
        self._order = ServoOrder(specs, chains, names, spheres, traps, rate, spin, realtime, cpu, disarm_after)
        self._process: subprocess.Popen[bytes] | None = None
        self._known: list[Address | None] = [None] * n
        self._traps = traps
        self._over = False

    @property
    def names(self) -> dict[str, Any]:
        """Names of the mailboxes: `scenes`, `orders`, `status`, `guard` where there is one, and lists of them: `hands`,
        `rings`, `starts`, `addresses`."""
        return dict(self._order.names)

    @property
    def pid(self) -> int | None:
        """Number of the child, once started."""
        return self._process.pid if self._process else None

    @property
    def guardian(self) -> int | None:
        """Number of the guardian's process; None where no device needs one."""
        return self._guard.pid if self._guard else None

    @property
    def alive(self) -> bool:
        """Whether the child runs."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> ServoStatus:
        """Start the child; returns when all devices are open, the guardian is ready and the loop runs, disarmed.

        Raises:
            InputError: A device is not there, the guardian cannot reach it, or the child ended or said nothing.
        """
        if self._process is not None or self._over:
            raise InputError("servo: start may be called once, before stop")
        message = pickle.dumps(self._order)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        command = [sys.executable, "-c", "from otwarp.haptics.servo.child import child; child()"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, env=environment)
        pipe = self._pipe()
        try:
            pipe.write(LENGTH.pack(len(message)) + message)
            pipe.flush()
        except OSError as error:
            self.stop()
            raise InputError(f"servo: its process ended at once ({error})") from None
        if self._guard is not None:
            after, order = SHARE * self._order.disarm_after, self._order
            names, number = order.names, self._process.pid
            self._guard.start(GuardOrder(self._guard.kinds, names, self._traps, after, number, order.realtime))
        end = time.monotonic() + START_WITHIN
        while time.monotonic() < end:
            gone = not self.alive  # asked first: what it said last is in the mailbox by then
            self.heartbeat()
            status = self.status()
            if status is not None and status.state == "running" and self._is_guarded():
                return status
            if gone:
                break
            time.sleep(POLL)
        status, why = self.status(), ""
        if status is not None and status.state == "failed":
            why = status.grants
        elif status is not None and self._guard is not None:
            said = "; ".join(side.message for side in self._guard.report.hands if side.message)
            why = f"servo: its guardian is not ready ({said or 'it does not answer'})"
        code = self._process.poll()
        self.stop()
        raise InputError(why or f"servo: its process {'does not answer' if code is None else f'ended with {code}'}")

    def publish(self, scene: SceneFrame) -> None:
        """Tell the servo a state of the simulation; counts as a heartbeat.

        Raises:
            InputError: More spheres or traps than it was made for; the servo was stopped.
        """
        if not self._over:
            self._scenes.write(scene)
            self._cycles.published(scene)
        self.heartbeat()

    def heartbeat(self) -> None:
        """Say that the parent lives; without it for `servo.PARENT_SILENCE` all sides disarm."""
        self._tell(self._orders.next())

    def arm(self, hand: int | None = None) -> None:
        """Allow one side, or all, to push."""
        for i in self._which(hand):
            self._tell(self._orders.next(arm=i))

    def disarm(self, hand: int | None = None) -> None:
        """Let the force of one side, or of all, fall to zero."""
        for i in self._which(hand):
            self._tell(self._orders.next(disarm=i))

    def set_gains(self, hand: int, motion_gain: float | None = None, force_gain: float | None = None) -> None:
        """Change the gains of one side in mid-run [µm/m, N/pN]; None leaves one as it is.

        The force follows within the slew limit, traps do not jump, and chains that are made later have them too.

        Raises:
            InputError: No such hand, or a gain out of the range of `HandConfig`.
        """
        self._which(hand)
        new = checked_gains(motion_gain, force_gain)
        was = self._orders.gains
        pair = tuple(old if gain is None else float(gain) for old, gain in zip(was[hand], new, strict=True))
        self._tell(replace(self._orders.next(), gains=(*was[:hand], pair, *was[hand + 1 :])))

    def record(self, on: bool) -> None:
        """Begin a recording of all sides, at any time, or end it; `drain` has what it holds."""
        if self._over and not on:
            return
        self._tell(replace(self._orders.next(), recording=self._cycles.record(on)))

    def drain(self, hand: int) -> Cycles:
        """The cycles of one side since the last call, while a recording runs and after it; never blocks.

        To be called at least every `ring.SECONDS`. After `stop` it has the last ones, once.
        """
        self._which(hand)
        if self._over:
            rest = self._rest[hand]
            self._rest[hand] = Cycles(b"", rest.lost, rest.start)
            return rest
        return self._cycles.drain(hand)

    def hand(self, hand: int) -> ServoFrame | None:
        """What one side last published; None before the first, and the last of all after `stop`."""
        self._which(hand)
        new = None if self._over else self._boxes[hand].read()
        if new is not None:
            self._hands[hand] = new
        return self._hands[hand]

    def status(self) -> ServoStatus | None:
        """What the servo last reported; None before the first, and the last of all after `stop`."""
        new = None if self._over else self._status_box.read()
        if new is not None:
            self._status = new
        return self._status

    def residue(self, hand: int) -> Residue | None:
        """What is known of a side's force while the servo does not run (ended, killed, stopped); None while it does."""
        self._which(hand)
        process = self._process
        if process is None:
            return None
        status, guard = self.status(), self._guard
        over = self._over or (status is not None and status.state in ("stopped", "failed"))
        report = None
        if guard is not None:
            report = (guard.report if self._over else guard.look(over)).hands[hand]
        return residue(self._order.specs[hand], process.poll(), status, self.hand(hand), report)

    def stop(self) -> None:
        """Let the forces fall, end the child and close the mailboxes; may be called more than once."""
        if self._over:
            return
        process = self._process
        if process is not None:
            if process.poll() is None:
                self._tell(self._orders.next(stop=True))
                try:
                    process.wait(STOP_WITHIN)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
            if process.stdin is not None:
                try:
                    process.stdin.close()
                except OSError:  # it ended before it had read its order
                    process.stdin = None
            self.status()
            for i in range(len(self._boxes)):
                self.hand(i)
                self._rest[i] = self.drain(i)
        self._over = True
        if self._guard is not None:
            self._guard.stop()
        self._close_boxes()

    def __enter__(self) -> ServoProcess:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _which(self, hand: int | None) -> Sequence[int]:
        n = len(self._boxes)
        if hand is None:
            return range(n)
        if not 0 <= hand < n:
            raise InputError(f"hand = {hand!r}: must be from 0 to {n - 1}")
        return (hand,)

    def _tell(self, orders: Orders) -> None:
        if self._over:
            raise InputError("servo: stopped; make another to go on")
        self._orders = orders
        self._orders_box.write(orders)
        if self._guard is not None:
            self._guard.look(over=self._status is not None and self._status.state in ("stopped", "failed"))

    def _is_guarded(self) -> bool:
        """Whether the guardian is ready for every device that needs it."""
        if self._guard is None:
            return True
        self._known = [box.read() or known for box, known in zip(self._addresses, self._known, strict=True)]
        known = [address.number if address is not None else 0 for address in self._known]
        return all(side.ready == number for side, number in zip(self._guard.report.hands, known, strict=True))

    def _pipe(self) -> BinaryIO:
        pipe = self._process.stdin if self._process else None
        if pipe is None:
            raise InputError("servo: not started")
        return pipe  # type: ignore[return-value]
