"""The session's side of the servo: `Hands` sends it scenes and takes in commanded traps and forces.

The servo is a process of its own (`servo_process`), or runs on the live loop's virtual clock (`VirtualServo`): there
every wait of the loop runs the cycles that fall into it, for tests and studies that must come out the same on every
machine. Devices, chains, loop and simulation are the real ones, only time is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.core.config import checked_gains
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.core.types import SceneFrame, ServoFrame, Vec3
from otwarp.haptics.devices import create_device, parse_devices
from otwarp.haptics.force.compiled import CompiledLaw
from otwarp.haptics.servo.link import (
    HandLayout,
    HandSetup,
    Orders,
    OrdersLayout,
    SceneLayout,
    SceneReader,
    ServoStatus,
    StatusLayout,
)
from otwarp.haptics.servo.process import ServoProcess
from otwarp.haptics.servo.servo import Hand, Servo
from otwarp.teleop.core import HandFrame
from otwarp.teleop.operators.hands import HandPlan, LocalScene


class ServoLike(Protocol):
    """What the loop asks of a servo; `ServoProcess`, or a double on a virtual clock."""

    def start(self) -> ServoStatus:
        """Open the devices and run."""
        ...

    def publish(self, scene: SceneFrame) -> None:
        """A new state of the simulation."""
        ...

    def heartbeat(self) -> None:
        """The session lives."""
        ...

    def arm(self, hand: int | None = None) -> None:
        """Let a hand, or all, push."""
        ...

    def disarm(self, hand: int | None = None) -> None:
        """Let the force of a hand, or of all, fall."""
        ...

    def set_gains(self, hand: int, motion_gain: float | None = None, force_gain: float | None = None) -> None:
        """Change gains [µm/m, N/pN]."""
        ...

    def hand(self, hand: int) -> ServoFrame | None:
        """What a hand last published."""
        ...

    def status(self) -> ServoStatus | None:
        """What the servo last reported."""
        ...

    def stop(self) -> None:
        """Let the forces fall and end."""
        ...

    @property
    def alive(self) -> bool:
        """Whether it runs."""
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
    return ServoProcess(setups, spheres=len(local.kinds), traps=traps, rate=rate, **options)


class Hands:
    """The hands of a session.

    Args:
        plans: As asked for.
        servo: Runs their chains, in their order; None without hands.

    Attributes:
        frames: Each hand as last heard of.
        status: The servo's last report.
    """

    def __init__(self, plans: Sequence[HandPlan], servo: ServoLike | None):
        self._servo = servo
        self._names = [plan.name for plan in plans]
        self._dead = False
        self._armed = [False] * len(self._names)
        self._notes = [""] * len(self._names)
        self.status: ServoStatus | None = None
        self.frames: tuple[HandFrame, ...] = tuple(
            HandFrame(
                name=plan.name,
                device=plan.device,
                traps=plan.config.traps,
                motion_gain=plan.config.motion_gain,
                force_gain=plan.config.force_gain,
                clamp=plan.config.safety.clamp,
            )
            for plan in plans
        )

    @property
    def servo(self) -> ServoLike | None:
        """What runs the chains."""
        return self._servo

    def start(self) -> None:
        """Open the devices and run the servo.

        Raises:
            InputError: A device is not there.
        """
        if self._servo is not None:
            self.status = self._servo.start()

    def listen(self) -> dict[int, Vec3]:
        """Take in what the servo says; returns the traps that hands command now [µm]."""
        servo = self._servo
        if servo is None:
            return {}
        self.status = status = servo.status()
        # one that ended by itself has let the forces of its devices fall; the session goes on without hands
        self._dead = self._dead or not servo.alive
        frames = []
        for n, frame in enumerate(self.frames):
            reported = status.hands[n] if status else None
            now, present = servo.hand(n), reported is not None and reported.present and not self._dead
            self._notice(n, now)
            message = reported.message if reported and reported.message else self._notes[n]
            message = "the servo has ended, nothing is felt any more; start the session anew" if self._dead else message
            frames.append(replace(frame, now=now, present=present, message=message))
        self.frames = tuple(frames)
        if self._dead:
            return {}
        return {trap: place for frame in frames if frame.now for trap, place in frame.now.traps}

    def _notice(self, n: int, now: ServoFrame | None) -> None:
        """Keep in mind that a hand was disarmed without an order: by its watchdog, unless the servo says why."""
        if now is None:
            return
        armed = now.state in ("ramping", "armed", "decaying")
        if self._armed[n] and now.state == "disarmed":
            nobody = self.frames[n].device == "mouse" and not now.buttons
            why = "no window of the page holds it" if nobody else "no fresh state of simulation or device for 0.1 s"
            self._notes[n] = f"disarmed, for {why}; arm it again"
        elif armed:
            self._notes[n] = ""
        self._armed[n] = armed

    def publish(self, scene: SceneFrame | None) -> None:
        """A new state of the simulation, or word that the session lives."""
        if self._servo is None or self._dead:
            return
        if scene is None:
            self._servo.heartbeat()
        else:
            self._servo.publish(scene)

    def arm(self, hand: str | None = None, on: bool = True) -> None:
        """Let hands push, or no more; None for all.

        Raises:
            InputError: No such hand.
        """
        indices = [self._index(hand)] if hand is not None else range(len(self._names))
        if self._servo is None or self._dead:
            return
        for n in indices:
            (self._servo.arm if on else self._servo.disarm)(n)
            self._armed[n], self._notes[n] = False, ""

    def set_gains(self, hand: str, motion_gain: float | None, force_gain: float | None) -> None:
        """Change gains in mid-run [µm/m, N/pN].

        Raises:
            InputError: No such hand, or a gain out of range.
        """
        n = self._index(hand)
        if self._servo is None or self._dead:
            return
        self._servo.set_gains(n, motion_gain, force_gain)
        given = {"motion_gain": motion_gain, "force_gain": force_gain}
        changed = replace(self.frames[n], **{k: v for k, v in given.items() if v is not None})
        self.frames = (*self.frames[:n], changed, *self.frames[n + 1 :])

    @property
    def died(self) -> bool:
        """Whether the servo ended by itself."""
        return self._dead

    def stop(self) -> None:
        """Let the forces fall, end the servo; may be called more than once."""
        if self._servo is not None:
            self._servo.stop()
            self.status = self._servo.status()

    def _index(self, hand: str) -> int:
        if hand not in self._names:
            allowed = ", ".join(self._names) or "none, for this session has no hand with a device"
            raise InputError(f"hand is {hand!r}; allowed: {allowed}")
        return self._names.index(hand)


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
        self._hands = [
            Hand(create_device(spec), partial(make_chain, plan.config, local.laws, local.kinds), box)
            for spec, plan, box in zip(specs, plans, self._boxes, strict=True)
        ]
        self._servo = Servo(
            clock, self._hands, SceneReader(self._scenes), self._orders_box, self._status_box, rate=rate
        )
        self._seen: list[ServoFrame | None] = [None] * n
        self.forces: list[list[ServoFrame]] = [[] for _ in plans]
        self.next = 0.0
        self.running = False
        clock.servo = self

    def cycle(self) -> None:
        """One cycle."""
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

    def hand(self, hand: int) -> ServoFrame | None:
        """See `ServoLike`."""
        new = self._boxes[hand].read()
        if new is not None:
            self._seen[hand] = new
        return self._seen[hand]

    def status(self) -> ServoStatus | None:
        """See `ServoLike`."""
        return self._status_box.read() or self._last_status()

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
