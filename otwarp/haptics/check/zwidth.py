"""Z-width on a virtual clock, here and in the paper, and what limits the force that is felt.

Z-width is the stiffest wall or spring that a bare device renders without sustaining a vibration.

The device is a mass with viscous damping, m·ẍ = F − b·ẋ, integrated exactly over each period in which F is held; no
hand damps it. On a spring it is let go at rest where the spring pushes it with the starting force; on a wall it is let
go at the surface, and a constant force of that size presses it in. A stiffness is stable if the vibration does not
grow: the largest speed in the last quarter of the run is at most `REST` of the largest in the first. Colgate and
Schenkel 1997 (Journal of Robotic Systems 14(1), 37–47) give b > K·T/2 as the condition for a wall to be passive with
any hand: K < 2b/T.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.chain.paper_mode import RELEASE_ALPHA, RELEASE_RATE, PaperForce
from otwarp.haptics.chain.passivity import LONGEST, stiffest
from otwarp.haptics.core import DeviceSample, SceneFrame, SphereFrame, TrapFrame, Vec3
from otwarp.haptics.core.config import (
    IDENTITY,
    TOUCH_DAMPING,
    TOUCH_MASS,
    TOUCH_QUANTUM,
    TOUCH_SAFETY,
    ChainConfig,
    HandConfig,
    PassivityConfig,
    SafetyConfig,
)
from otwarp.haptics.servo.guard import SHARE, kinds_that_keep

REST = 1.0
"""Part of the first quarter's largest speed that the last may have. A linear loop grows or dies exponentially, so that
this is the limit of stability itself; what a loop with passivity control does there is bounded, and dies by the
device's own damping."""

Render = Callable[[float, float], float]
"""(time [s], measured position [m]) → force [N]; called once per period."""

RATE = 1000.0
"""Of the servo [Hz]."""

HIGH = 20_000.0
"""Stiffest spring that is tried [N/m]; a chain that is stable there passes for stable everywhere."""

PAPER_FILTERED, PAPER_RELEASE = 10.3, 1.4
"""Largest stable stiffness of the release's chain: α = 0.05 at 1 kHz, and at 120 Hz with 5 ms of delay [N/m]; from the
same device on a virtual clock."""

DELAY = 0.005

PASSIVE = ChainConfig(passivity=PassivityConfig())
BARE = ChainConfig(passivity=None)
"""The two chains that the table of `otwarp haptics check` compares."""

DEVICE = f"{TOUCH_MASS:g} kg, {TOUCH_DAMPING:g} N·s/m"
"""What all Z-widths are stated for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BareDevice:
    """A device without a hand: mass [kg], damping [N·s/m], resolution of its position [m] (0: exact)."""

    mass: float = 0.15
    damping: float = 0.2
    quantum: float = 0.0

    def advance(self, x: float, v: float, force: float, time: float) -> tuple[float, float]:
        """Position and velocity after `time` [s] of a constant force."""
        fade = math.exp(-self.damping / self.mass * time)
        terminal = force / self.damping
        return x + terminal * time + (v - terminal) * (1.0 - fade) * self.mass / self.damping, terminal + (
            v - terminal
        ) * fade

    def measured(self, x: float) -> float:
        """Position as its encoder says [m]."""
        return round(x / self.quantum) * self.quantum if self.quantum else x


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """How a run starts and ends.

    Attributes:
        force: That the rendered spring pushes with at the start, or that presses on the wall [N].
        duration: Of the run [s].
    """

    force: float = 0.5
    duration: float = 4.0


def speeds(
    device: BareDevice, render: Render, *, start: float, rate: float, duration: float, press: float = 0.0
) -> list[float]:
    """Largest speed [m/s] in each quarter of a run that starts at rest at `start` [m], pressed to −x by `press` [N]."""
    period, steps = 1.0 / rate, math.ceil(duration * rate)
    x, v, found = start, 0.0, [0.0] * 4
    for n in range(steps):
        force = render(n * period, device.measured(x))
        x, v = device.advance(x, v, force - press, period)
        quarter = 4 * n // steps
        if not abs(v) < 1e6:
            found[quarter:] = [math.inf] * (4 - quarter)
            break
        found[quarter] = max(found[quarter], abs(v))
    return found


def largest_stable(
    make: Callable[[float], Render],
    *,
    device: BareDevice,
    rate: float,
    release: Release,
    low: float,
    high: float,
    wall: bool = False,
    tolerance: float = 2e-4,
) -> float:
    """Largest stable stiffness [N/m] by bisection between `low` and `high`; `high` if that is stable, 0 if not `low`.

    Args:
        make: Renderer of a stiffness, in a state of its own.
        wall: Whether it is one.
        tolerance: Relative width at which the bisection ends.
    """

    def stable(stiffness: float) -> bool:
        start, press = (0.0, release.force) if wall else (-release.force / stiffness, 0.0)
        found = speeds(device, make(stiffness), start=start, rate=rate, duration=release.duration, press=press)
        return math.isfinite(found[3]) and found[3] <= REST * found[0]

    if stable(high):
        return high
    if not stable(low):
        return 0.0
    while high > low * (1.0 + tolerance):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


class LinearField:
    """A spring or wall in place of the local model: stiffness [N/m] at x < 0, and beyond it unless it is a wall."""

    def __init__(self, stiffness: float, *, wall: bool) -> None:
        self._stiffness, self._wall = stiffness, wall
        self._origin = 0.0

    def refresh(self, scene: SceneFrame, traps: Mapping[int, Vec3]) -> bool:
        """See `ForceModel.refresh`."""
        self._origin = next(iter(traps.values()))[0]
        return math.isfinite(self._origin)

    def force(self, x: float, y: float, z: float) -> Vec3:
        """See `ForceModel.force`: minus what the hand is to feel, as on a sphere."""
        place = self._origin + x
        return (0.0 if self._wall and place > 0.0 else self._stiffness * place), 0.0, 0.0

    def state(self) -> dict[str, Any]:
        """Nothing: `refresh` says all."""
        return {}

    def restore(self, state: Mapping[str, Any]) -> None:
        """See `ForceModel.restore`: there is no state."""


UNLIMITED = SafetyConfig(ramp_time=0.0, slew=1e6, clamp=100.0, continuous_force=100.0)
"""Safety that does not show at the forces of a Z-width run, so that the chain alone is measured."""

PER_METRE = 1e6
"""Motion gain of the runs [µm/m]: the wall is as large as it is."""


def chain_renderer(chain: ChainConfig, *, start: float, stiffness: float, wall: bool, safety: SafetyConfig) -> Render:
    """A spring or wall rendered by a whole `Chain` that took hold at `start` [m]."""
    config = HandConfig(
        traps=(0,), motion_gain=PER_METRE, force_gain=1.0, axis_map=IDENTITY, chain=chain, safety=safety
    )
    servo = Chain(config, LinearField(stiffness / PER_METRE, wall=wall))
    servo.arm()
    trap = TrapFrame(0, (start * PER_METRE, 0.0, 0.0), 1.0)
    scene = SceneFrame(0, 0.0, (SphereFrame((0.0, 0.0, 0.0), 0),), (trap,))
    beat = 0

    def _render(time: float, x: float) -> float:
        nonlocal beat
        beat += 1
        now = servo.step(DeviceSample(time, (x, 0.0, 0.0)), replace(scene, beat=beat, time=time))
        return now.force[0]

    return _render


def chain_width(
    chain: ChainConfig,
    *,
    device: BareDevice | None = None,
    wall: bool = False,
    safety: SafetyConfig = UNLIMITED,
    release: Release | None = None,
    high: float = 1e5,
) -> float:
    """Z-width of our chain [N/m]: the largest stable stiffness up to `high`.

    Args:
        chain: Its configuration; `passivity=None` leaves the bare sampled loop.
        device: None for 0.15 kg, 0.2 N·s/m.
        wall: A wall at x < 0 instead of a spring.
        safety: None of it shows by default.
        release: How it is let go.
    """
    release = release or Release()

    def _make(stiffness: float) -> Render:
        start = 0.0 if wall else -release.force / stiffness
        return chain_renderer(chain, start=start, stiffness=stiffness, wall=wall, safety=safety)

    device = device or BareDevice()
    return largest_stable(_make, device=device, rate=chain.rate, release=release, low=1.0, high=high, wall=wall)


def paper_width(
    *,
    rate: float,
    delay: float = 0.0,
    alpha: float = RELEASE_ALPHA,
    device: BareDevice | None = None,
    release: Release | None = None,
    servo: float = 1000.0,
) -> float:
    """Z-width of the release's force node [N/m]: `rate` messages per second [Hz], each heard `delay` [s] late.

    The hand is the trap, a robot stands at 0; each message makes a force that is held until the next arrives. Hand
    motion is not filtered: the release's motion filter lies between the hand and its simulator, and lowers the figure.
    """
    device, release = device or BareDevice(), release or Release(duration=60.0)

    def _make(stiffness: float) -> Render:
        node = PaperForce(lambda d: stiffness * d, gain=1.0, alpha=alpha)
        node.robot_message((0.0, 0.0, 0.0), 0.0)
        flying: deque[tuple[float, float]] = deque()
        sent = 0

        def _render(time: float, x: float) -> float:
            nonlocal sent
            if time * rate >= sent - 1e-6:
                flying.append((time + delay, x))
                sent += 1
            while flying and flying[0][0] <= time + 1e-9:
                node.trap_message((flying.popleft()[1], 0.0, 0.0), time)
            return node.force[0]

        return _render

    return largest_stable(_make, device=device, rate=servo, release=release, low=0.1, high=1e4)


@dataclass(frozen=True, slots=True)
class Width:
    """A row of the table of Z-widths.

    Attributes:
        loop: What renders.
        found: Largest stable stiffness of a spring [N/m].
        open_ended: Whether it is the stiffest that was tried, so that the true one is larger.
        reference: What theory or the paper has [N/m], None for nothing.
        source: Of the reference.
    """

    loop: str
    found: float
    open_ended: bool
    reference: float | None
    source: str


def widths(progress: Callable[[str], None] = lambda line: None) -> tuple[Width, ...]:
    """Z-width of a bare 0.15 kg, 0.2 N·s/m device on a virtual clock: no hand, no machine is in it. Takes some 15 s."""
    cases: tuple[tuple[str, Callable[[], float], float | None, str], ...] = (
        ("stable, passivity control off", lambda: chain_width(BARE, high=2000.0), 2.0 * TOUCH_DAMPING * RATE, "2b/T"),
        ("stable", lambda: chain_width(PASSIVE, high=HIGH), None, ""),
        ("stable, a wall", lambda: chain_width(PASSIVE, wall=True, high=HIGH), None, ""),
        ("paper, α = 0.05 per message at 1 kHz", lambda: paper_width(rate=RATE), PAPER_FILTERED, "b/τ"),
        (
            f"paper, {2.0 * RELEASE_RATE:g} messages/s, {1e3 * DELAY:g} ms late",
            lambda: paper_width(rate=2.0 * RELEASE_RATE, delay=DELAY),
            PAPER_RELEASE,
            "the release's loop",
        ),
    )
    found = []
    for loop, measure, reference, source in cases:
        progress(f"Z-width: {loop}")
        value = measure()
        found.append(Width(loop, value, value >= HIGH, reference, source))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class FeltLimit:
    """Something that bounds what is felt, and why."""

    what: str
    value: str
    why: str


def limits() -> tuple[FeltLimit, ...]:
    """What is limited in the Touch's preset, and in the paper's chain, by its numbers."""
    period, b, safety, passivity = 1.0 / RATE, TOUCH_DAMPING, TOUCH_SAFETY, PassivityConfig()
    springs = ", ".join(f"{stiffest(passivity, period, t):.3g} at {1e3 * t:g} ms" for t in (period, 0.008, LONGEST))
    tau = -period / math.log(1.0 - RELEASE_ALPHA)
    step = 1e4 * TOUCH_QUANTUM
    return (
        FeltLimit(
            "stiffness without passivity control",
            f"2b/T = {2.0 * b / period:.0f} N/m",
            "a force held for a period is half a period late and gives energy; only the device's friction takes it",
        ),
        FeltLimit(
            "stiffness behind a filter of the force",
            f"b/τ = {b / tau:.1f} N/m",
            f"α = {RELEASE_ALPHA:g} at {RATE:g} Hz is a lag of {1e3 * tau:.1f} ms, and friction must pay for it",
        ),
        FeltLimit(
            "stiffness by the longest hold of the last seconds",
            f"{springs} [N/m]",
            "passivity control: a stiffer spring is softened where one hold could give more than the hand gave to it",
        ),
        FeltLimit(
            "energy that the hand is given",
            f"{1e3 * passivity.reserve:g} mJ on time",
            f"for motion to {passivity.speed:g} m/s and {passivity.acceleration:g} m/s²; a first late hold T may give "
            f"force × {passivity.speed:g} m/s × T, which must be paid back",
        ),
        FeltLimit(
            "smoothness of a stiff wall",
            f"{step:.2f} N per step at 10 kN/m",
            f"the encoder resolves {1e6 * TOUCH_QUANTUM:.0f} µm: a vibration stays, bounded",
        ),
        FeltLimit(
            "change of the force",
            f"{safety.slew:g} N/s, {safety.slew * period:g} N per period",
            "slew limit: no output jumps, but for a force that passivity takes away",
        ),
        FeltLimit("force", f"{safety.clamp:g} N", "clamp: what the device can render"),
        FeltLimit(
            "force that lasts",
            f"{safety.continuous_force:g} N rms over {safety.thermal_time:g} s",
            "continuous-force guard: what its motors bear",
        ),
        FeltLimit(
            "force after the last state",
            f"falls from {1e3 * safety.decay_after:.0f} ms, zero at {1e3 * safety.disarm_after:.0f} ms",
            "watchdog: a simulation that died is not felt for ever",
        ),
        FeltLimit(
            "force of a servo that was killed or stopped",
            f"zero sent within {1e3 * SHARE * safety.disarm_after:.0f} ms",
            f"guardian, for {', '.join(kinds_that_keep('driver'))}; {' and '.join(kinds_that_keep('library'))} run "
            "inside the servo and end with it: there the device's own timeout has to act",
        ),
    )
