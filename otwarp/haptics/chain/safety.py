"""What stands between the chain and the motors: arming, ramp, slew limit, clamp, motor guard, watchdog.

What comes out is always finite and within the clamp. It changes no faster than the slew limit, but for what passivity
takes away: energy that is not there cannot wait.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from otwarp.haptics.core import ZERO, Vec3, as_tuples
from otwarp.haptics.core.config import SafetyConfig

BELOW = 1.0 - 1e-15
"""Shortens a vector that was scaled to a limit, so that rounding leaves it within."""

COOL = 0.5
"""Part of the continuous force, squared, that the motors may bear before their peak is lowered. Steady forces below
0.7 of the continuous one are never limited, and bursts have half the heat to spend."""

ROUNDING = 1e-9
"""Slack on ages [s]."""

SILENT = 1e-9
"""Force that counts as none when a hand disarms [N]; motors resolve a thousandth of a newton at best."""


class Safety:
    """Whether the motors of one side may push, and how hard.

    - A hand starts disarmed and pushes only after `arm`. With `dead_man`, button 0 must be held too; letting go lets
      the force fall, and holding it again ramps it in.
    - The clutch: while it is held the force falls too, and comes back by the ramp.
    - The watchdog: `age` is that of the newest state of the simulation or of the device's newest word, whichever is
      older. From `decay_after` on the force falls, linearly and whatever the hand does; at `disarm_after` it is zero
      and the hand disarmed. A state in between ramps it in again.
    - A fault (a number that is not finite) lets the last force fall in the same time, and disarms.

    Args:
        config: Limits and times.
        rate: Servo rate [Hz]; the slew limit never allows more than one period's change per step.
        bound: Shortens the force that would be sent, at once, and takes whether it must fall; `Passivity.bound`.

    Attributes:
        phase: `disarmed` (it needs `arm`), `ramping`, `armed`, `decaying` (it falls or has fallen, and comes back by
            itself unless it was disarmed) or `fault` (it needs `arm`).
        force: Last force sent [N].
        heat: Mean square force [N²].
    """

    __slots__ = (
        "_bound", "_ceiling", "_config", "_faulty", "_gain", "_held", "_period", "_wanted", "force", "heat", "phase"
    )  # fmt: skip

    def __init__(self, config: SafetyConfig, rate: float, bound: Callable[[Vec3, bool], Vec3] | None = None) -> None:
        self._config, self._period, self._bound = config, 1.0 / rate, bound
        self._wanted = self._faulty = False
        self._gain = 0.0
        self._held: Vec3 = ZERO
        self._ceiling = math.inf
        self.phase, self.force, self.heat = "disarmed", ZERO, 0.0

    def arm(self) -> None:
        """Allow force, from zero by the ramp; clears a fault."""
        self._wanted, self._faulty = True, False

    def disarm(self) -> None:
        """Let the force fall to zero, and leave it there."""
        self._wanted = False

    @property
    def wanted(self) -> bool:
        """Whether it was armed and nothing has disarmed it since."""
        return self._wanted

    def step(self, force: Vec3, *, elapsed: float, age: float, allowed: bool) -> Vec3:
        """The force to send [N].

        Args:
            force: What the chain asks for [N].
            elapsed: Time since the last step [s].
            age: Of what the force was computed from [s].
            allowed: Whether the dead-man switch is held, if there is one, and the clutch is not.
        """
        config = self._config
        fx, fy, fz = force
        if not math.isfinite(fx + fy + fz):
            self.fault()
        step = elapsed if elapsed < self._period else self._period
        # ages are sums of periods, and rounded
        stale = age >= config.decay_after - ROUNDING
        if age >= config.disarm_after - ROUNDING:
            self._wanted = False
        if self._faulty:
            fx, fy, fz = self._held
        if self._wanted and allowed and not stale:
            self._ceiling = math.inf
            self._gain = min(1.0, self._gain + step / config.ramp_time) if config.ramp_time > 0.0 else 1.0
            self.phase = "armed" if self._gain == 1.0 else "ramping"
        else:
            self._fall(elapsed, age)
        gain = self._gain
        self._send(gain * fx, gain * fy, gain * fz, step)
        if not self._wanted and not self._faulty and max(map(abs, self.force)) <= SILENT:
            self.phase = "disarmed"
        return self.force

    def fault(self) -> None:
        """Disarm, and let the force that is being sent fall."""
        if not self._faulty:
            self._faulty, self._wanted = True, False
            # the fall multiplies by the gain again
            k = 1.0 / self._gain if self._gain > 0.0 else 0.0
            self._held = (k * self.force[0], k * self.force[1], k * self.force[2])

    def state(self) -> list[Any]:
        """All that changes from step to step, for JSON."""
        return [self._ceiling, self._faulty, self._gain, self._held, self._wanted, self.force, self.heat, self.phase]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        self._ceiling, self._faulty, self._gain, held, self._wanted, force, self.heat, self.phase = state
        self._held, self.force = as_tuples(held), as_tuples(force)

    def _fall(self, elapsed: float, age: float) -> None:
        """Lower the gain, and the ceiling that keeps a moving hand from raising the force meanwhile."""
        config, gain = self._config, self._gain
        if self._ceiling == math.inf:
            self._ceiling = math.sqrt(sum(f * f for f in self.force)) / gain if gain > 0.0 else 0.0
        # zero two periods before the end, so that the slew limit has nothing left to do there
        span = max(config.disarm_after - config.decay_after - 2.0 * self._period, self._period)
        last = age >= config.disarm_after - self._period - ROUNDING
        self._gain = 0.0 if last else max(0.0, gain - elapsed / span)
        self.phase = "fault" if self._faulty else "decaying"

    def _send(self, fx: float, fy: float, fz: float, step: float) -> Vec3:
        """Guard, slew limit, clamp and bound."""
        config, heat = self._config, self.heat
        bears = config.continuous_force * config.continuous_force
        peak = config.clamp * config.clamp
        # from the peak while cool, down to what they bear for ever
        limit2 = min(peak, bears)
        if 0.0 < bears < peak and heat < bears:
            limit2 = min(peak, bears + (peak - bears) * (bears - heat) / ((1.0 - COOL) * bears))
        if self._ceiling < math.inf:
            limit2 = min(limit2, (self._gain * self._ceiling) ** 2)
        size2 = fx * fx + fy * fy + fz * fz
        if not size2 <= limit2:
            fx, fy, fz = _shortened(fx, fy, fz, math.sqrt(limit2))
        u, v, w = self.force
        dx, dy, dz = fx - u, fy - v, fz - w
        longest = config.slew * step
        if dx * dx + dy * dy + dz * dz > longest * longest:
            dx, dy, dz = _shortened(dx, dy, dz, longest)
            fx, fy, fz = u + dx, v + dy, w + dz
        # both ends of a limited change are within the clamp, and so is what lies between, but for rounding
        size2 = fx * fx + fy * fy + fz * fz
        if size2 > peak:
            fx, fy, fz = _shortened(fx, fy, fz, config.clamp)
        if self._bound:
            fx, fy, fz = self._bound((fx, fy, fz), self._ceiling < math.inf)
            size2 = fx * fx + fy * fy + fz * fz
        share = step / config.thermal_time
        self.heat = heat + (share if share < 1.0 else 1.0) * (size2 - heat)
        self.force = (fx, fy, fz)
        return self.force


def _shortened(x: float, y: float, z: float, length: float) -> Vec3:
    """A vector brought to a length, without overflow for any finite numbers."""
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0 or length == 0.0:
        return ZERO
    u, v, w = x / largest, y / largest, z / largest
    k = BELOW * length / math.sqrt(u * u + v * v + w * w)
    return k * u, k * v, k * w
