"""The chain of one side as the servo keeps it: made for a device, armed, tuned, stepped, checked, dropped on failure.

It knows neither the device nor the clock, so that a recording can be run again through the very same code
(`otwarp.teleop.recording.replay`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from typing import Any, Protocol

from otwarp.errors import InputError
from otwarp.haptics.chain.passivity import Account
from otwarp.haptics.core import (
    ACTION_BITS,
    ARMED,
    DISARMED,
    GAINS,
    MADE,
    MOST_ACTIONS,
    DeviceInfo,
    DeviceSample,
    SceneFrame,
    ServoFrame,
    Vec3,
)
from otwarp.haptics.core.config import Gains, checked_gains

ROUNDING = 1.0 + 1e-9
"""A force scaled to the limit of its device may exceed it by rounding."""


class ChainLike(Protocol):
    """The signal chain of one side, see `otwarp.haptics.chain.chain`.

    It starts disarmed, knows time by `sample.time`, and a simulation that stands still by a `scene.beat` that does. The
    first beat is 1: before it, no chain is stepped.
    """

    @property
    def asked(self) -> Vec3:
        """Force that was asked of safety in the last step [N]."""
        ...

    @property
    def moved(self) -> Vec3:
        """How far the traps are commanded from where the hand took hold of them [µm]."""
        ...

    @property
    def complaint(self) -> str:
        """Why it is at fault or has disarmed by itself, one line; "" since it was armed."""
        ...

    @property
    def heat(self) -> float:
        """Mean square force that the motors have borne of late [N²], see `safety.Safety`."""
        ...

    @heat.setter
    def heat(self, value: float) -> None: ...

    @property
    def account(self) -> Account:
        """Energy that the hand was given and has not paid back, see `passivity.Passivity`."""
        ...

    @account.setter
    def account(self, value: Account) -> None: ...

    def step(self, sample: DeviceSample, scene: SceneFrame) -> ServoFrame:
        """One servo cycle: the force to render and the traps to move."""
        ...

    def arm(self) -> None:
        """Allow force, by a ramp."""
        ...

    def disarm(self) -> None:
        """Let the force fall to zero."""
        ...

    def set_gains(self, motion_gain: float | None = None, force_gain: float | None = None) -> None:
        """Gains from now on [µm/m, N/pN]; None for as configured.

        Raises:
            InputError: Out of range; nothing has changed.
        """
        ...

    def state(self, scene: SceneFrame) -> Mapping[str, Any]:
        """All that the chain remembers, for JSON; `scene` is the one of its last step."""
        ...

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from the `state` of a chain of the same configuration.

        Raises:
            InputError: It does not fit.
        """
        ...


class Rendering:
    """The chain of one side.

    Args:
        make_chain: The chain for a device; called again after the device was away and after a fault, so that nothing
            remembered of the hand's motion carries over the gap. Gains do: they are the user's.

    Attributes:
        chain: None before `make`, after a failure and while the device is away.
        gains: As last set.
        limit, continuous: Of the device [N].
        heat, account: Of the last chain that was let go, which the next one begins with: the motors are the same [N²],
            and so is the hand, whose debts no new chain forgives.
        said: What went wrong or was limited in the last step, or "".
    """

    def __init__(self, make_chain: Callable[[DeviceInfo], ChainLike]):
        self._make_chain = make_chain
        self.chain: ChainLike | None = None
        self.info: DeviceInfo | None = None
        self.gains: Gains = (None, None)
        self.limit = self.continuous = self.heat = 0.0
        self.account: Account | None = None
        self.said = self._complained = ""
        self._log = self._logged = 0

    def make(self, info: DeviceInfo) -> None:
        """A new chain for a device, disarmed, with the gains that were set.

        Raises:
            InputError: It does not suit the device.
        """
        self.drop()
        self.info, self.limit, self.continuous = info, info.force, info.continuous_force
        chain = self._make_chain(info)
        if self.gains != (None, None):
            chain.set_gains(*self.gains)
        chain.heat = self.heat
        if self.account is not None:
            chain.account = self.account
        self.chain = chain
        self._note(MADE)

    def arm(self) -> None:
        """Allow force; a chain that was dropped is made anew."""
        if self.info is None:
            return
        if self.chain is None:
            self.make(self.info)
        if self.chain is not None:
            self.chain.arm()
            self._note(ARMED)

    def disarm(self, action: int = DISARMED) -> None:
        """Let the force fall; `action` says why, see `ring.ACTIONS`."""
        if self.chain is not None:
            self.chain.disarm()
            self._note(action)

    def set_gains(self, motion_gain: float | None, force_gain: float | None) -> None:
        """Gains of this chain and of those to come; None for as configured.

        Raises:
            InputError: Out of range.
        """
        gains = motion_gain, force_gain
        if gains == self.gains:
            return
        if self.chain is not None:
            self.chain.set_gains(*gains)
        self.gains = gains
        self._note(GAINS)

    def step(self, sample: DeviceSample, scene: SceneFrame) -> ServoFrame | None:
        """A step of the chain, within the device's limit; None if there is none, or it failed."""
        chain, self.said = self.chain, ""
        if chain is None:
            return None
        try:
            now = chain.step(sample, scene)
            x, y, z = now.force
            size = math.sqrt(x * x + y * y + z * z)
            total = size
            for _, (tx, ty, tz) in now.traps:
                total += tx + ty + tz
            complaint = chain.complaint
        except Exception as error:  # a defect of a chain must not leave a force on
            return self._fail(f"{type(error).__name__}: {error}")
        if complaint != self._complained:
            self._complained = complaint
            self.said = f"disarmed: {complaint}; arm it again" if complaint else ""
        if not math.isfinite(total):
            return self._fail(f"force ({x:g}, {y:g}, {z:g}) N or traps {now.traps} not finite")
        limit = self.limit
        if size > limit * ROUNDING and limit > 0.0:  # a device without motors ignores every force
            k = limit / size
            self.said = f"force of {size:.3g} N held to the limit of {limit:g} N"
            return replace(now, force=(k * x, k * y, k * z))
        return now

    def drop(self) -> None:
        """The device is away: its chain goes."""
        if self.chain is not None:
            self.heat, self.account = self.chain.heat, self.chain.account
        self.chain = None

    def actions(self) -> int:
        """What happened to the chain since the last call, see `ring.actions_of`."""
        log, self._log, self._logged = self._log, 0, 0
        return log

    def state(self, scene: SceneFrame) -> dict[str, Any]:
        """All that a rendering of the same configuration needs to go on from here, for JSON."""
        return {
            "gains": list(self.gains),
            "heat": self.heat,
            "account": self.account,
            "device": asdict(self.info) if self.info else None,
            "chain": self.chain.state(scene) if self.chain is not None else None,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a `state`.

        Raises:
            InputError: It is none, or of another configuration.
        """
        try:
            motion, force = state["gains"]
            heat, account = float(state.get("heat", 0.0)), state.get("account")  # earlier versions lack them
            if account is not None:
                energy, floor, stake, hold = map(float, account)
                account = energy, floor, stake, hold
            device, chain = state["device"], state["chain"]
            info = DeviceInfo(**device) if device is not None else None
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"start of a recording: is none ({error})") from None
        self.gains, self.heat, self.account = checked_gains(motion, force), heat, account
        if info is not None:
            self.make(info)
            if chain is None:
                self.drop()
                self.heat, self.account = heat, account
        if chain is not None and self.chain is not None:
            self.chain.restore(chain)
        self.actions()

    def _fail(self, why: str) -> None:
        self.drop()
        self.said = f"chain at fault, arm again: {why}"

    def _note(self, action: int) -> None:
        if self._logged < MOST_ACTIONS:
            self._log |= action << ACTION_BITS * self._logged
            self._logged += 1
