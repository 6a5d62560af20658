"""What runs in the servo's process: a fresh interpreter that takes its order from stdin, and ends with zero force.

Its end comes by order, by a signal, or by the death of its parent (the pipe between them closes; on POSIX its parent's
number changes as well); in each case the chains let go, every device gets zero force, and only then it ends.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from otwarp.errors import InputError
from otwarp.haptics.chain.rendering import ChainLike
from otwarp.haptics.core import DeviceInfo
from otwarp.haptics.core.realtime import RealClock, parent_is_gone, request_realtime
from otwarp.haptics.core.shared_memory import Mailbox, Ring
from otwarp.haptics.devices import DeviceSpec, create_device
from otwarp.haptics.servo.guard import LENGTH, AddressLayout, GuardLayout
from otwarp.haptics.servo.hand import Hand
from otwarp.haptics.servo.link import (
    HandLayout,
    HandStatus,
    OrdersLayout,
    SceneLayout,
    SceneReader,
    ServoStatus,
    StartLayout,
    StatusLayout,
)
from otwarp.haptics.servo.servo import Servo

SWITCH = 2e-4
"""Seconds after which Python takes the interpreter from a thread that re-opens a device; 5 ms by default."""
ENDING = ("SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK")
"""Signals that end a servo in order: a closed terminal and Ctrl-\\ reach the whole group of processes."""
UNHEEDED = ("SIGINT", "SIGTSTP", "SIGTTIN", "SIGTTOU")
"""Signals that a servo ignores. Ctrl-C goes to its parent as well, which stops it in order; and Ctrl-Z stops the
parent alone, for a servo that stood still would leave the last force on, with nobody there to take it back."""


@dataclass(frozen=True, slots=True)
class ServoOrder:
    """All that the process must know, see `process.ServoProcess`."""

    specs: tuple[DeviceSpec, ...]
    chains: tuple[Callable[[DeviceInfo], ChainLike], ...]
    names: dict[str, Any]
    spheres: int
    traps: int
    rate: float
    spin: float
    realtime: bool
    cpu: int | None
    disarm_after: float


def child() -> None:
    """What the child does: take its order from stdin, run the servo, end with its devices at zero force."""
    pipe = sys.stdin.buffer
    size = pipe.read(LENGTH.size)
    if len(size) < LENGTH.size:
        return  # the parent died before it had said anything
    order: ServoOrder = pickle.loads(pipe.read(LENGTH.unpack(size)[0]))
    ended = threading.Event()
    threading.Thread(target=lambda: (pipe.read(1), ended.set()), daemon=True).start()
    _heed_signals(ended)
    # os._exit: a thread may hang in a driver, or wait for the pipe; the devices are at zero force by now
    os._exit(_serve(order, ended.is_set))


def _heed_signals(ended: threading.Event) -> None:
    """No signal that a terminal sends ends this process, or stops it, with a force on; systems lack some of them."""
    for name in ENDING:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: ended.set())
    for name in UNHEEDED:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def _serve(order: ServoOrder, ended: Callable[[], bool]) -> int:
    """Attach, open, run; 0, or 2 after an InputError, which the status tells the parent."""
    n, names = len(order.specs), order.names
    status = Mailbox.attach(StatusLayout(n), names["status"])
    try:
        orders = Mailbox.attach(OrdersLayout(n), names["orders"])
        scenes = SceneReader(Mailbox.attach(SceneLayout(order.spheres, order.traps), names["scenes"]))
        start = StartLayout(order.spheres, order.traps)
        guard = Mailbox.attach(GuardLayout(n), names["guard"]) if "guard" in names else None
        hands = [
            Hand(
                create_device(spec),
                chain,
                Mailbox.attach(HandLayout(order.traps), names["hands"][i]),
                beside=True,
                ring=Ring.attach(names["rings"][i]),
                starts=Mailbox.attach(start, names["starts"][i]),
                addresses=Mailbox.attach(AddressLayout(), names["addresses"][i]) if guard is not None else None,
            )
            for i, (spec, chain) in enumerate(zip(order.specs, order.chains, strict=True))
        ]
        gone = parent_is_gone()
        grants = request_realtime(cpu=order.cpu) if order.realtime else ()
        granted = "; ".join(f"{g.what}: {g.detail}" if g.granted else f"no {g.what} ({g.detail})" for g in grants)
        # nothing in the loop makes cycles of references, and a collection would take milliseconds
        gc.collect()
        gc.freeze()
        gc.disable()
        sys.setswitchinterval(SWITCH)
        clock, orphaned = RealClock(order.spin), lambda: ended() or gone()
        servo = Servo(
            clock,
            hands,
            scenes,
            orders,
            status,
            rate=order.rate,
            orphaned=orphaned,
            grants=granted,
            disarm_after=order.disarm_after,
            guard=guard,
        )
    except InputError as error:
        status.write(ServoStatus(0, 0.0, "failed", 0, 0.0, 0, 0, (HandStatus(),) * n, str(error)))
        return 2
    try:
        servo.run()
    except InputError:  # its last report says it
        return 2
    except Exception as error:
        sys.excepthook(type(error), error, error.__traceback__)
        return 1
    return 0
