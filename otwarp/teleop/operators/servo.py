"""The servo of a session: a process of its own (`servo_process`), or one on the live loop's virtual clock.

What hands feel is compiled for the process (`compile_laws`): machine code of their force laws, made by Warp in this
one. A `VirtualServo` lives in the loop's process: every wait of the loop runs the cycles that fall into it, for tests
and studies that must come out the same on every machine. Devices, chains, loop and simulation are the real ones, only
time is not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from otwarp.device import start_warp
from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.core import SceneFrame, ServoFrame
from otwarp.haptics.core.config import checked_gains
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.haptics.core.shared_memory import SECONDS, Mailbox, Ring
from otwarp.haptics.devices import create_device, parse_devices
from otwarp.haptics.force.compiled import CompiledLaw, models_of, tried
from otwarp.haptics.force.law import Law
from otwarp.haptics.servo.cycles import CycleReader
from otwarp.haptics.servo.guard import ENDED, Residue
from otwarp.haptics.servo.hand import Hand
from otwarp.haptics.servo.link import (
    Cycles,
    HandLayout,
    HandSetup,
    Orders,
    OrdersLayout,
    SceneLayout,
    SceneReader,
    ServoStatus,
    StartLayout,
    StatusLayout,
)
from otwarp.haptics.servo.process import ServoProcess
from otwarp.haptics.servo.servo import Servo
from otwarp.kernels.optics.local_force import machine_code
from otwarp.teleop.operators import HandPlan, LocalScene


class ServoLike(Protocol):
    """What the loop asks of a servo; `ServoProcess`, or a double on a virtual clock."""

    def start(self) -> ServoStatus:
        """Open the devices and run the chains; what it reports of the start."""
        ...

    def publish(self, scene: SceneFrame) -> None:
        """A new state of the simulation."""
        ...

    def heartbeat(self) -> None:
        """Say that the session lives; a servo disarms when this is not heard for too long."""
        ...

    def arm(self, hand: int | None = None) -> None:
        """Let a hand, or all, push."""
        ...

    def disarm(self, hand: int | None = None) -> None:
        """Let the force of a hand, or of all, fall."""
        ...

    def set_gains(self, hand: int, motion_gain: float | None = None, force_gain: float | None = None) -> None:
        """Change a side's gains of motion [µm/m] and force [N/pN]; None leaves one."""
        ...

    def hand(self, hand: int) -> ServoFrame | None:
        """What a hand last published."""
        ...

    def status(self) -> ServoStatus | None:
        """What the servo last reported."""
        ...

    def residue(self, hand: int) -> Residue | None:
        """What is known of a hand's force while the servo does not run; None while it does."""
        ...

    def stop(self) -> None:
        """Let the forces fall and end."""
        ...

    @property
    def alive(self) -> bool:
        """Whether the servo runs."""
        ...


def servo_process(
    plans: Sequence[HandPlan],
    local: LocalScene,
    *,
    traps: int,
    pointers: dict[str, str],
    rate: float = 1000.0,
    code: CompiledLaw | None = None,
    **options: Any,
) -> ServoProcess:
    """A servo for these hands, not started.

    Args:
        plans: Hands.
        local: What they feel.
        traps: Number of traps of the scene.
        pointers: Hand → mailbox of its pointer, for `mouse`.
        rate: Cycles per second [Hz].
        code: The force laws compiled, None for plain Python.
        options: Others of `ServoProcess`.

    Raises:
        InputError: As `ServoProcess`.
    """
    setups = [
        HandSetup(
            plan.device,
            partial(make_chain, plan.config, {t: local.laws[t] for t in plan.config.traps}, local.kinds, code=code),
            pointers.get(plan.name),
            plan.name,
        )
        for plan in plans
    ]
    least = min(plan.config.safety.disarm_after for plan in plans)
    return ServoProcess(setups, spheres=len(local.kinds), traps=traps, rate=rate, disarm_after=least, **options)


def compile_laws(laws: Mapping[int, Sequence[Law]]) -> tuple[CompiledLaw | None, str]:
    """Code for the laws of traps, tried on them; None where plain Python must do. And which it is, for the user.

    The first call on a machine takes some seconds to compile, later ones 0.3 s to try what is in Warp's cache.
    """
    why = ""
    models = models_of(laws)
    if models is None:
        why = "one of the laws has no compiled form"
    elif not models:
        why = "no sphere is trapped"
    else:
        start_warp()
        try:
            code = CompiledLaw(**machine_code(models))
            why = tried(code, laws)
            if not why:
                return code, "compiled"
        except Exception as error:  # whatever a compiler or the folder of its cache says, there is the law in Python
            why = f"Warp cannot compile it ({error})"
    return None, f"in Python: {why}"


ServoFactory = Callable[[Sequence[HandPlan], LocalScene], ServoLike]
"""Makes the servo of a session; tests give a double."""


class LinkedClock(VirtualClock):
    """Time passes by waiting; the servo lives through it.

    Attributes:
        servo: That is linked to it.
    """

    def __init__(self) -> None:
        super().__init__()
        self.servo: VirtualServo | None = None

    def sleep_until(self, deadline: float) -> None:
        """See `Clock`."""
        while self.servo is not None and self.servo.running and self.servo.next <= deadline:
            self._now = max(self._now, self.servo.next)
            self.servo.cycle()
        self._now = max(self._now, deadline)


class VirtualServo:
    """`ServoLike` in this process.

    Args:
        clock: Of the loop.
        plans: Hands.
        local: What they feel.
        traps: Number of traps of the scene.

    Attributes:
        forces: Every cycle of each hand.
        next: When the next cycle is due [s].
        running: Whether it was started, and not stopped.
    """

    def __init__(self, clock: LinkedClock, plans: Sequence[HandPlan], local: LocalScene, traps: int):
        n = len(plans)
        self._clock = clock
        rate = plans[0].config.chain.rate
        self._period = 1.0 / rate
        self._scenes = Mailbox.create(SceneLayout(len(local.kinds), traps))
        self._orders_box = Mailbox.create(OrdersLayout(n))
        self._status_box = Mailbox.create(StatusLayout(n))
        self._boxes = [Mailbox.create(HandLayout(traps)) for _ in plans]
        self._orders = Orders(0, (0,) * n, (0,) * n, gains=((None, None),) * n)
        specs = parse_devices([plan.device for plan in plans])
        rings = [Ring.create(math.ceil(SECONDS * rate)) for _ in plans]
        starts = [Mailbox.create(StartLayout(len(local.kinds), traps)) for _ in plans]
        self._cycles = CycleReader(rings, starts)
        self._hands = [
            Hand(create_device(spec), partial(make_chain, plan.config, local.laws, local.kinds), box, ring=ring,
                 starts=start)
            for spec, plan, box, ring, start in zip(specs, plans, self._boxes, rings, starts, strict=True)
        ]  # fmt: skip
        self._servo = Servo(
            clock, self._hands, SceneReader(self._scenes), self._orders_box, self._status_box, rate=rate
        )
        self._seen: list[ServoFrame | None] = [None] * n
        self.forces: list[list[ServoFrame]] = [[] for _ in plans]
        self.next = 0.0
        self.running = False
        clock.servo = self

    def cycle(self) -> None:
        """One cycle of all sides, at its time."""
        self._servo.cycle()
        self.next += self._period
        for n in range(len(self._boxes)):
            now = self.hand(n)
            if now is not None:
                self.forces[n].append(now)

    def start(self) -> ServoStatus:
        """See `ServoLike`."""
        for hand in self._hands:
            hand.open()
        self.running, self.next = True, self._clock.now() + self._period
        self._servo.cycle()
        status = self.status()
        assert status is not None
        return status

    @property
    def alive(self) -> bool:
        """See `ServoLike`."""
        return self.running

    def publish(self, scene: SceneFrame) -> None:
        """See `ServoLike`."""
        self._scenes.write(scene)
        self._cycles.published(scene)
        self.heartbeat()

    def heartbeat(self) -> None:
        """See `ServoLike`."""
        self._tell(self._orders.next())

    def arm(self, hand: int | None = None) -> None:
        """See `ServoLike`."""
        for n in range(len(self._boxes)) if hand is None else (hand,):
            self._tell(self._orders.next(arm=n))

    def disarm(self, hand: int | None = None) -> None:
        """See `ServoLike`."""
        for n in range(len(self._boxes)) if hand is None else (hand,):
            self._tell(self._orders.next(disarm=n))

    def set_gains(self, hand: int, motion_gain: float | None = None, force_gain: float | None = None) -> None:
        """See `ServoLike`."""
        new, was = checked_gains(motion_gain, force_gain), self._orders.gains
        pair = tuple(old if gain is None else gain for old, gain in zip(was[hand], new, strict=True))
        self._tell(replace(self._orders.next(), gains=(*was[:hand], pair, *was[hand + 1 :])))

    def record(self, on: bool) -> None:
        """Begin a recording of all sides, at any time, or end it; `drain` has what it holds."""
        self._tell(replace(self._orders.next(), recording=self._cycles.record(on)))

    def drain(self, hand: int) -> Cycles:
        """The cycles of one side since the last call, while a recording runs and after it."""
        return self._cycles.drain(hand)

    def hand(self, hand: int) -> ServoFrame | None:
        """See `ServoLike`."""
        new = self._boxes[hand].read()
        if new is not None:
            self._seen[hand] = new
        return self._seen[hand]

    def status(self) -> ServoStatus | None:
        """See `ServoLike`."""
        return self._status_box.read() or self._last_status()

    def residue(self, hand: int) -> Residue | None:
        """See `ServoLike`."""
        return None if self.running else Residue(True, f"{ENDED}; start the session anew")

    def stop(self) -> None:
        """See `ServoLike`."""
        if self.running:
            self.running = False
            for hand in self._hands:
                hand.release(self._clock.now())
            for n in range(len(self._boxes)):
                self.hand(n)
        self._clock.servo = None

    def _last_status(self) -> ServoStatus:
        return ServoStatus(
            self._servo.tick, self._clock.now(), "running", 0, 0.0, 0, 0, tuple(h.status for h in self._hands)
        )

    def _tell(self, orders: Orders) -> None:
        self._orders = orders
        self._orders_box.write(orders)
