"""The haptic chain of one side: from a sample of its device and the newest state of the scene to a force.

stable: velocity → coupling → motion gain with clutch → force sum → force gain → filter → damping → passivity → safety
paper:  motion low-pass and gain with clutch → the release's force node, per published state → its damping → safety

Safety (arming, ramp, slew limit, clamp, motor guard, watchdog) ends both: the release has none, and what it would send
is `Chain.asked`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from otwarp.errors import InputError
from otwarp.haptics.chain.motion import Motion, VectorFilter, VelocityEstimate, VirtualCoupling
from otwarp.haptics.chain.paper_mode import PaperRenderer
from otwarp.haptics.chain.passivity import Account, Passivity
from otwarp.haptics.chain.safety import Safety
from otwarp.haptics.core import (
    ZERO,
    DeviceInfo,
    DeviceSample,
    SceneFrame,
    ServoFrame,
    Vec3,
    as_tuples,
    scene_from_list,
    scene_to_list,
)
from otwarp.haptics.core.config import HandConfig, PassivityConfig, SafetyConfig, checked_gains
from otwarp.haptics.force import Code, ForceModel, local_model
from otwarp.haptics.force.law import Law

DEAD_MAN, CLUTCH = 1, 2
"""Bits of `DeviceSample.buttons`."""


OLD_NAMES = {
    "": "chain",
    "motion._filter": "motion filter",
    "_coupling": "coupling",
    "_filter": "force filter",
    "_paper": "paper",
    "_paper._node": "paper node",
    "_paper._node._filter": "paper node filter",
    "windows": "velocity",
}
"""Names that recordings of earlier versions have for parts of a chain."""


class Part(Protocol):
    """Part of a chain that remembers something from one step to the next."""

    def state(self) -> list[Any]:
        """What changes from step to step, for JSON."""
        ...

    def restore(self, state: Any) -> None:
        """Go on from a `state`, of which JSON has made lists."""
        ...


class Chain:
    """The signal chain of one side: from a sample of its device to a force and places for its traps.

    Args:
        config: Of the hand.
        model: What it feels, `local_model(config, laws)` for the traps of a scene.

    Raises:
        InputError: Paper mode with a table.

    Attributes:
        asked: Force that was asked of safety in the last step [N].
        complaint: What made the last fault, or was silent until the watchdog disarmed; one line, "" since it was armed.
        safety, passivity, motion: Its parts.
    """

    def __init__(self, config: HandConfig, model: ForceModel) -> None:
        chain = config.chain
        self.config, self.model = config, model
        self._period = 1.0 / chain.rate
        self._limited = chain.passivity is not None
        self.passivity = Passivity(chain.passivity or PassivityConfig(), self._period, chain.quantum)
        self.safety = Safety(config.safety, chain.rate, self.passivity.bound if self._limited else None)
        self.motion = Motion(config)
        self._velocity = VelocityEstimate(self._period, chain.quantum)
        self._coupling = VirtualCoupling(chain.coupling, chain.rate) if chain.coupling else None
        low_pass = chain.force_filter
        self._filter = VectorFilter(low_pass.at(chain.rate).alpha) if low_pass and chain.mode == "stable" else None
        self._paper = PaperRenderer(config, model) if chain.mode == "paper" else None
        self._back = self._to_hand(config.force_gain)
        self._moves = self._limited or chain.damping > 0.0
        self._damping = chain.damping
        self._tick = 0
        self._time: float | None = None
        self._beat: int | None = None
        self._scene_time = -math.inf
        self._scene_age = self._device_age = 0.0
        self._anchors: dict[int, Vec3] = {}
        self._position: Vec3 = ZERO
        self._felt: Vec3 = ZERO
        self._paper_force: Vec3 = ZERO
        self.asked: Vec3 = ZERO
        self.complaint = ""

    def arm(self) -> None:
        """Allow force, from zero by the ramp; clears a fault. What is stale stays so, and disarms it again."""
        self.complaint = ""
        self.safety.arm()

    def disarm(self) -> None:
        """Let the force fall to zero, and leave it there until `arm`."""
        self.safety.disarm()

    def set_gains(self, motion_gain: float | None = None, force_gain: float | None = None) -> None:
        """Gains from the next step on; None for as configured.

        Traps stay where they are and follow further motion with the new gain. The force goes to its new value within
        the slew limit, and passivity control goes on counting: it bounds what a force may give back whatever made it.

        Args:
            motion_gain: [µm/m].
            force_gain: [N/pN].

        Raises:
            InputError: Out of the range of `HandConfig`; nothing has changed.
        """
        motion_gain, force_gain = checked_gains(motion_gain, force_gain)
        config = self.config
        self.motion.set_gain(config.motion_gain if motion_gain is None else motion_gain)
        force_gain = config.force_gain if force_gain is None else force_gain
        self._back = self._to_hand(force_gain)
        if self._paper:
            self._paper.set_gain(force_gain)

    def _to_hand(self, gain: float) -> tuple[float, ...]:
        """−G_hand·Aᵀ for the force on the spheres; the release's force is that on the hand already."""
        sign, rows = 1.0 if self._paper else -gain, self.config.axis_map
        return tuple(sign * rows[j][i] for i in range(3) for j in range(3))

    @property
    def moved(self) -> Vec3:
        """How far the traps are commanded from where the hand took hold of them [µm]."""
        return self.motion.commanded

    def state(self, scene: SceneFrame) -> dict[str, Any]:
        """All that it remembers after a step with `scene`, for JSON, part by part as recordings hold it.

        Configuration, laws and tables are not in it: a recording holds them once. Floats come back bit for bit, as
        Python writes them by `repr`.
        """
        own = [self._back, self._tick, self._time, self._beat, self._scene_time, self._scene_age, self._device_age]
        own += [self._position, self._felt, self._paper_force, self.asked, self.complaint]
        parts = {name: part.state() for name, part in self.parts().items() if part is not None}
        scenes = {"anchors": list(self._anchors.items()), "scene": scene_to_list(scene)}
        return {"chain": own, **parts, **self.model.state(), **scenes}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from the `state` of a chain of the same configuration, of an earlier version as well.

        Raises:
            InputError: It is of another configuration, or none.
        """
        try:
            state = {OLD_NAMES.get(name, name): value for name, value in state.items()}
            anchors = {int(trap): as_tuples(place) for trap, place in state["anchors"]}
            if anchors:
                self.model.refresh(scene_from_list(state["scene"]), anchors)
            self._anchors = anchors
            own = as_tuples(state["chain"])
            self._back, self._tick, self._time, self._beat, self._scene_time, self._scene_age, *rest = own
            self._device_age, self._position, self._felt, self._paper_force, self.asked, self.complaint = rest
            for name, part in self.parts().items():
                if (part is None) != (name not in state):
                    raise ValueError(f"{name} is {'not ' * (part is None)}configured")
                if part is not None:
                    part.restore(state[name])
            self.model.restore(state)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"start of a recording: does not fit its configuration ({error})") from None

    def parts(self) -> dict[str, Part | None]:
        """Name in recordings → part, None for one that is not configured; the model is apart, for its scene."""
        paper, node = self._paper, self._paper.node if self._paper else None
        return {
            "safety": self.safety,
            "passivity": self.passivity,
            "motion": self.motion,
            "motion filter": self.motion.filter,
            "coupling": self._coupling,
            "force filter": self._filter,
            "paper": paper,
            "paper node": node,
            "paper node filter": node.filter if node else None,
            "velocity": self._velocity,
        }

    @property
    def heat(self) -> float:
        """Mean square force that the motors have borne of late [N²]; set for a chain that follows another."""
        return self.safety.heat

    @heat.setter
    def heat(self, value: float) -> None:
        self.safety.heat = value

    @property
    def account(self) -> Account:
        """What the hand was given and has not paid back; set for a chain that follows another."""
        return self.passivity.account

    @account.setter
    def account(self, value: Account) -> None:
        self.passivity.account = value

    def step(self, sample: DeviceSample, scene: SceneFrame) -> ServoFrame:
        """One servo period; never raises for what is in a sample or a scene, and its force is always safe to send."""
        self._tick += 1
        x, y, z = sample.position
        elapsed = self._elapsed(sample.time)
        self._scene_age += elapsed
        self._device_age = 0.0 if sample.fresh else self._device_age + elapsed
        finite = math.isfinite(x + y + z)
        if finite:
            self._position = (x, y, z)
        else:
            self._fault("the device's position is not finite")
            x, y, z = self._position
        self.passivity.observe(x, y, z, elapsed, known=finite and sample.fresh)
        new = scene.beat != self._beat
        if new:
            self._refresh(scene)
        config, buttons = self.config, sample.buttons
        held = (buttons & DEAD_MAN) != 0 or not config.safety.dead_man
        holds = held and not (config.clutch and buttons & CLUTCH)
        alive = self._scene_age < config.safety.disarm_after
        if self._anchors and not alive:
            # a simulation that comes back has its traps where it left them
            self._anchors = {}
        force = self._render(x, y, z, elapsed, holds, new, scene) if self._anchors else ZERO
        if not math.isfinite(force[0] + force[1] + force[2]):
            self._fault("the force is not finite")
            force = ZERO
        self.asked = force
        age = self._scene_age if self._scene_age > self._device_age else self._device_age
        wanted = self.safety.wanted
        sent = self.safety.step(force, elapsed=elapsed, age=age, allowed=holds)
        if wanted and not self.safety.wanted and not self.complaint:
            silent = "simulation" if self._scene_age >= self._device_age else "device"
            self.complaint = f"nothing new from the {silent} for {config.safety.disarm_after:g} s"
        self.passivity.send(sent)
        return self._report(sample, sent)

    def _elapsed(self, time: float) -> float:
        """Time since the last step [s]: one period at first, after a clock that ran backwards or is no number."""
        last, self._time = self._time, time
        if last is None or not 0.0 <= time - last < math.inf:
            if not math.isfinite(time):
                self._time = last
                self._fault("the servo's time is not finite")
            return self._period
        return time - last

    def _refresh(self, scene: SceneFrame) -> None:
        """Take in a new state; take hold of the traps where there is no hold, or where simulated time began anew."""
        self._beat = scene.beat
        anew = not self._anchors or scene.time < self._scene_time
        anchors = self._anchors
        if anew:
            anchors = {trap.index: trap.position for trap in scene.traps if trap.index in self.config.traps}
        try:
            if len(anchors) < len(self.config.traps):
                lacks = sorted(set(self.config.traps) - set(anchors))
                raise InputError(f"hand.traps has {lacks[0]}, which the scene lacks; allowed: traps of the scene")
            finite = self.model.refresh(scene, anchors) and math.isfinite(scene.time)
        except InputError as error:
            self._fault(str(error))
            return
        if not finite:
            self._fault("the simulation's state is not finite")
            return
        self._scene_age, self._scene_time = 0.0, scene.time
        if anew:
            self._anchors = anchors
            self._take_hold()

    def _take_hold(self) -> None:
        """Forget everything that was carried, filtered or felt."""
        self.motion.reset()
        self._velocity.reset()
        self._felt = self._paper_force = ZERO
        if self._filter:
            self._filter.value = ZERO
        if self._coupling:
            self._coupling.reset()
        if self._paper:
            self._paper.reset()

    def _fault(self, why: str) -> None:
        self.complaint = why
        self.safety.fault()
        self._anchors = {}

    def _render(self, x: float, y: float, z: float, elapsed: float, holds: bool, new: bool, scene: SceneFrame) -> Vec3:
        """The force that the chain asks for [N]."""
        velocity = self._velocity.step(x, y, z, elapsed) if self._moves or self._paper else ZERO
        if self._coupling:
            x, y, z = self._coupling.step(x, y, z, self._felt)
        carried = self.motion.step(x, y, z, holds)
        if self._paper:
            if new:
                fx, fy, fz = self._on_hand(self._paper.published(scene, self._time or 0.0))
                vx, vy, vz = velocity
                b = self._damping
                self._paper_force = (fx - b * vx, fy - b * vy, fz - b * vz)
            return self._paper_force
        force = self._felt = self._on_hand(self.model.force(*carried))
        if self._filter:
            force = self._filter.step(*force)
        if self._damping > 0.0:
            b, (fx, fy, fz), (vx, vy, vz) = self._damping, force, velocity
            force = (fx - b * vx, fy - b * vy, fz - b * vz)
        return self.passivity.control(force, velocity) if self._limited else force

    def _on_hand(self, force: Vec3) -> Vec3:
        """From the scene's axes and units to the device's."""
        (u, v, w), (a, b, c, d, e, f, g, h, i) = force, self._back
        return a * u + b * v + c * w, d * u + e * v + f * w, g * u + h * v + i * w

    def _report(self, sample: DeviceSample, sent: Vec3) -> ServoFrame:
        """What is published; traps only while the hand has hold of them."""
        traps: tuple[tuple[int, Vec3], ...] = ()
        x, y, z = self.motion.commanded
        if self._anchors:
            if math.isfinite(x + y + z):
                traps = tuple((n, (u + x, v + y, w + z)) for n, (u, v, w) in self._anchors.items())
            else:
                self._fault("the hand's motion is not finite")
        safety, time = self.safety, self._time
        return ServoFrame(
            self._tick,
            0.0 if time is None else time,
            self._position,
            sent,
            traps,
            safety.phase,
            self.passivity.energy,
            sample.buttons,
        )


def make_chain(
    config: HandConfig,
    laws: Mapping[int, Sequence[Law]],
    kinds: Sequence[int],
    info: DeviceInfo,
    *,
    code: Code | None = None,
) -> Chain:
    """A chain, disarmed, that asks no more of a device than it can give.

    `functools.partial(make_chain, config, laws, kinds)` is what `servo.process.HandSetup` wants: it goes to another
    interpreter by name.

    Args:
        config: Of the hand.
        laws, kinds, code: As `law.local_model`.
        info: Of the device, once it is open.

    Raises:
        InputError: As `Chain` and `local_model`.
    """
    config = replace(config, safety=within(config.safety, info))
    return Chain(config, local_model(config, laws, kinds, code))


def within(safety: SafetyConfig, info: DeviceInfo) -> SafetyConfig:
    """Limits of the configuration or of the device, whichever are lower; a device without motors has none."""
    if info.force <= 0.0:
        return safety
    continuous = min(safety.continuous_force, info.continuous_force or info.force)
    return replace(safety, clamp=min(safety.clamp, info.force), continuous_force=continuous)
