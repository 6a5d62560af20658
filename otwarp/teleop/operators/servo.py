"""The session's side of the servo: `Hands` sends it scenes and takes in commanded traps and forces.

The servo is a process of its own (`servo_process`), or runs on the live loop's virtual clock (`virtual_servo`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from otwarp.errors import InputError
from otwarp.haptics.chain.chain import make_chain
from otwarp.haptics.core.types import ZERO, SceneFrame, ServoFrame, Vec3
from otwarp.haptics.force.compiled import CompiledLaw
from otwarp.haptics.servo.guard import Residue
from otwarp.haptics.servo.link import HandSetup, ServoStatus
from otwarp.haptics.servo.process import ServoProcess
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

    def residue(self, hand: int) -> Residue | None:
        """What is known of a hand's force while the servo does not run; None while it does."""
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
    least = min(plan.config.safety.disarm_after for plan in plans)
    return ServoProcess(setups, spheres=len(local.kinds), traps=traps, rate=rate, disarm_after=least, **options)


class Hands:
    """The hands of a session.

    Args:
        plans: As asked for.
        servo: Runs their chains, in their order; None without hands.

    Attributes:
        frames: Each hand as last heard of.
        status: The servo's last report.
        law: What computes the forces, for the user; "" for unknown.
    """

    def __init__(self, plans: Sequence[HandPlan], servo: ServoLike | None):
        self._servo = servo
        self._names = [plan.name for plan in plans]
        self._dead = False
        self._armed = [False] * len(self._names)
        self._notes = [""] * len(self._names)
        self.status: ServoStatus | None = None
        self.law = ""
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
        # the session goes on without hands when their servo has ended
        self._dead = self._dead or not servo.alive
        frames = []
        for n, frame in enumerate(self.frames):
            reported = status.hands[n] if status else None
            now, residue = servo.hand(n), servo.residue(n)
            self._notice(n, now)
            message = reported.message if reported and reported.message else self._notes[n]
            if residue is not None:
                message = residue.message
                if now is not None and residue.zero:  # what the servo sent last is not there any more
                    now = replace(now, force=ZERO, state="disarmed")
            present = reported is not None and reported.present and residue is None
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
