"""One side in the servo: its device, its chain, its mailbox, its ring, and what becomes of them when one fails."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from otwarp.errors import InputError
from otwarp.haptics.chain.rendering import ChainLike, Rendering
from otwarp.haptics.core import (
    ABSOLUTE,
    BACK,
    DISARMED,
    FAILED,
    FRESH,
    LOST,
    PRESENT,
    SAMPLED,
    STATES,
    STEPPED,
    ZERO,
    Device,
    DeviceInfo,
    DeviceLost,
    DeviceSample,
    SceneFrame,
    ServoFrame,
    Vec3,
)
from otwarp.haptics.core.shared_memory import Mailbox, Ring
from otwarp.haptics.servo.guard import Address
from otwarp.haptics.servo.link import HandStatus, Start

MOST_BUTTONS = 2**63
"""Buttons are bits of a number below it; a device that says otherwise cannot be relied on."""
SETTLE = 0.1
"""Seconds after a gap in which the device is not read: its driver's thread stood still as well, and has to catch up."""
REOPEN_AFTER = 0.5
"""Seconds from the loss of a device to the first attempt to open it again, and from one attempt to the next."""


class Opening:
    """An attempt to open a device anew.

    It may take long, so the servo runs it beside its loop, which leaves this device alone until `done`.
    """

    def __init__(self, device: Device, beside: bool):
        self.done, self.error = False, ""
        self._device = device
        if beside:
            threading.Thread(target=self._run, daemon=True).start()
        else:
            self._run()

    def _run(self) -> None:
        try:
            self._device.close()
            self._device.open()
        except Exception as error:  # whatever a driver raises, the servo goes on
            self.error = str(error) or type(error).__name__
        self.done = True


class Hand:
    """One side in the servo: its device, its chain, its mailbox, its ring.

    Args:
        device: Not opened yet.
        make_chain: See `Rendering`.
        box: Takes a `ServoFrame` each cycle.
        beside: Whether to re-open the device in a thread, see `Opening`.
        ring: Takes a record of each cycle while `record` says so.
        starts: Takes what the chain remembered when a recording began.
        addresses: Takes where the device is, for the guardian.

    Attributes:
        opened: How often the device was opened.
        guarded: Whether the device needs a guardian: its driver goes on without the servo.
        status: How the device is.
    """

    def __init__(
        self,
        device: Device,
        make_chain: Callable[[DeviceInfo], ChainLike],
        box: Mailbox[ServoFrame],
        beside: bool = False,
        *,
        ring: Ring | None = None,
        starts: Mailbox[Start] | None = None,
        addresses: Mailbox[Address] | None = None,
    ):
        self._device, self._box, self._beside = device, box, beside
        self._rendering = Rendering(make_chain)
        self._ring, self._starts, self._recording = ring, starts, False
        self._addresses, self.opened, self.guarded = addresses, 0, False
        self._opening: Opening | None = None
        self._try_at, self._read_from = math.inf, -math.inf
        self._begun = False
        self._last = ServoFrame(0, 0.0, ZERO, ZERO, (), "disarmed", 0.0)
        self._sample: DeviceSample | None = None
        self._flags = 0
        self.status = HandStatus()

    @property
    def force(self) -> Vec3:
        """Last force sent to the device [N]."""
        return self._last.force

    def open(self) -> None:
        """Open the device for the first time.

        Raises:
            InputError: It is not there.
        """
        self._device.open()
        self._welcome("")

    def _welcome(self, message: str) -> None:
        """A device that has just been opened: a chain of its own, disarmed."""
        self._device.write(ZERO)
        self.opened += 1
        if self._addresses is not None and (address := getattr(self._device, "address", "")):
            self.guarded = True
            self._addresses.write(Address(self.opened, address))
        self._rendering.make(self._device.info)
        self.status = replace(self.status, present=True, message=message)

    def arm(self, watched: bool = True) -> None:
        """Allow force, if the device is there and the simulation has spoken; clears a fault.

        Args:
            watched: Whether the guardian, where it is needed, is ready for this device.
        """
        if not self.status.present:
            return
        if self.guarded and not watched:
            self._say("cannot be armed without a guardian, which would send zero force if the servo died; try again")
            return
        if not self._begun:
            self._say("cannot be armed before the simulation has published a state")
            return
        self._rendering.arm()
        self._say("")

    def disarm(self, message: str = "", action: int = DISARMED) -> None:
        """Let the force fall to zero by the safety's ramp; a `message` says why in the status of a present device."""
        self._rendering.disarm(action)
        if message and self.status.present:
            self.status = replace(self.status, message=message)

    def stand(self, now: float, message: str) -> None:
        """Time has passed without cycles: zero force, and a new chain, which takes hold of the traps where they are.

        What the old one remembers of the hand would move the traps by all the way that the hand has gone meanwhile.
        """
        if not self.status.present:
            return
        try:
            self._device.write(ZERO)
            self._rendering.make(self._device.info)
        except Exception as error:
            self._lose(now, str(error) or type(error).__name__)
            return
        self._last, self._read_from = replace(self._last, force=ZERO, state="disarmed"), now + SETTLE
        if self._begun:
            self._say(message)

    def set_gains(self, motion_gain: float | None, force_gain: float | None) -> None:
        """Gains from now on [µm/m, N/pN], also of chains made later; None for as configured."""
        try:
            self._rendering.set_gains(motion_gain, force_gain)
        except InputError as error:
            self._say(str(error))

    def record(self, recording: int, tick: int, scene: SceneFrame) -> None:
        """Record from this cycle on, under this number, with all that the chain remembers now; 0 ends it."""
        self._recording = recording > 0 and self._ring is not None
        if not self._recording or self._starts is None:
            return
        self._rendering.actions()  # what they did is in the snapshot
        try:
            self._starts.write(Start(recording, tick, json.dumps(self._rendering.state(scene), separators=(",", ":"))))
        except Exception as error:  # reported; it replays from the next chain on, and the device goes on regardless
            self._starts.write(Start(recording, tick, ""))
            self._say(f"the start of the recording cannot be kept: {error}")

    def cycle(self, now: float, scene: SceneFrame, tick: int = 0) -> None:
        """One servo cycle: read the device, step the chain, write the force, publish."""
        self._begun = scene.beat > 0
        self._sample, self._flags = None, 0
        if not self.status.present:
            self._look_for_it(now)
        state = None
        if self.status.present:
            state = self._feel(now, scene) if now >= self._read_from else self._resting(now)
        if state is None:  # away, or at fault: no force, and the traps stay where they are
            state = replace(self._last, tick=self._last.tick + 1, time=now, force=ZERO, state="fault")
        self._last = state
        self._box.write(state)
        if self._recording and self._ring is not None:
            try:
                self._ring.push(self._as_record(tick, now, scene.beat, state))
            except Exception:  # whatever a driver calls a sample, its hand goes on
                self._ring.miss()

    def _resting(self, now: float) -> ServoFrame:
        """A cycle without a look at the device."""
        return replace(self._last, tick=self._last.tick + 1, time=now)

    def _feel(self, now: float, scene: SceneFrame) -> ServoFrame | None:
        """A cycle of a device that is there; None when it is lost or the chain failed."""
        device, rendering = self._device, self._rendering
        try:
            sample = self._sample = device.read(now)
            if not 0 <= sample.buttons < MOST_BUTTONS:
                raise DeviceLost(f"buttons are {sample.buttons!r}")
            if not self._begun:  # a chain would look in vain for its traps
                state = replace(self._resting(now), position=sample.position)
            else:
                stepped = rendering.chain is not None
                state = rendering.step(sample, scene)
                if stepped:
                    self._flags |= STEPPED if state is not None else STEPPED | FAILED
                if rendering.said:
                    self._say(rendering.said)
            device.write(state.force if state is not None else ZERO)
        except Exception as error:  # `DeviceLost`, or whatever else a driver raises: it cannot be relied on any more
            self._lose(now, str(error) or type(error).__name__)
            return None
        return state

    def _as_record(self, tick: int, now: float, beat: int, state: ServoFrame) -> tuple[float, ...]:
        """This cycle in the order of `ring.CYCLE`."""
        sample, rendering, flags = self._sample, self._rendering, self._flags
        at, position, buttons = math.nan, (math.nan, math.nan, math.nan), 0
        if sample is not None:
            at, position, buttons = sample.time, sample.position, sample.buttons & 0xFFFFFFFFFFFFFFFF
            flags |= SAMPLED | FRESH if sample.fresh else SAMPLED
        if self.status.present:
            flags |= PRESENT
        if rendering.info is not None and rendering.info.absolute:
            flags |= ABSOLUTE
        chain, (motion, force) = rendering.chain, rendering.gains
        asked, moved = (chain.asked, chain.moved) if chain is not None else (ZERO, ZERO)
        gains = math.nan if motion is None else motion, math.nan if force is None else force
        limits, code = (rendering.limit, rendering.continuous), STATES.index(state.state)
        head = (tick, now, at, *position, buttons, flags, beat, rendering.actions(), *gains, *limits)
        return (*head, *state.force, *asked, state.energy, code, *moved)

    def _lose(self, now: float, why: str) -> None:
        name = self._device.info.name
        self._flags |= LOST
        with suppress(Exception):  # one that failed in reading may still let go
            self._device.write(ZERO)
        self._rendering.drop()
        self._try_at = now + REOPEN_AFTER
        self.status = HandStatus(False, self.status.losses + 1, f"{name}: lost, disarmed ({why})")

    def _look_for_it(self, now: float) -> None:
        """Attempt to open a lost device, every so often; one that comes back is disarmed."""
        opening = self._opening
        if opening is None:
            if now >= self._try_at:
                self._opening = Opening(self._device, self._beside)
            return
        if not opening.done:
            return
        self._opening = None
        self._try_at = now + REOPEN_AFTER
        if opening.error:
            return
        try:
            self._welcome(f"{self._device.info.name}: back; arm it to feel it again")
            self._flags |= BACK
        except Exception as error:  # lost again at once, or another device that its chain refuses
            self._rendering.drop()
            self._say(f"back, but {error}")

    def _say(self, message: str) -> None:
        """A line about the device, or none."""
        line = f"{self._device.info.name}: {message}" if message else ""
        if line != self.status.message:
            self.status = replace(self.status, message=line)

    def release(self, now: float) -> None:
        """Zero force, report it, close the device."""
        if self._opening is None or self._opening.done:
            zero = (lambda: self._device.write(ZERO),) if self.status.present else ()
            for last in (*zero, self._device.close):
                try:
                    last()
                except Exception as error:  # it must not keep the other device from being released
                    self._say(str(error))
        self._last = replace(self._last, tick=self._last.tick + 1, time=now, force=ZERO, state="disarmed")
        self._box.write(self._last)
