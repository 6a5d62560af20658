"""What stands between the chain and the motors: `Passivity` bounds the energy that is given, `Safety` the force.

Safety arms, ramps, limits slew and size, guards the motors, and watches for silence. What comes out is always finite,
within the clamp, and changes no faster than the slew limit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from otwarp.haptics.core.config import PassivityConfig, SafetyConfig
from otwarp.haptics.core.types import ZERO, Vec3, as_tuples

BELOW = 1.0 - 1e-15
"""Shortens a vector that was scaled to a limit, so that rounding leaves it within."""

COOL = 0.5
"""Part of the continuous force, squared, that the motors may bear before their peak is lowered. Steady forces below
0.7 of the continuous one are never limited, and bursts have half the heat to spend."""

ROUNDING = 1e-9
"""Slack on ages [s]."""

SILENT = 1e-9
"""Force that counts as none when a hand disarms [N]; motors resolve a thousandth of a newton at best."""

STILL = 1e-24
"""Squared step of a hand that stands [m²]: 1 pm is far below any encoder, and its direction is rounding."""


class Passivity:
    """Energy at the port of the device, counted exactly and kept from falling below −reserve.

    A device holds a force F over a period, so the work it does while the hand moves by Δx is F·Δx whatever the path:
    with the force that was really sent (after ramp, slew limit and clamp) the observer E ← E − F·Δx knows the energy
    taken from the hand without an error of sampling. Before each period the controller foresees the work w = F·v̂T. If
    it exceeds what may be given, a share of E + reserve, it takes the surplus off along the motion; if E has fallen
    below −reserve, by a step that could not be foreseen, it also damps, with at most `damping_limit`, until that is won
    back. Whatever delays, drops or jumps the scene makes, they can only cost force, never add energy.

    Source: after Hannaford and Ryu 2002, IEEE Transactions on Robotics and Automation 18(1), 1–10,
    doi:10.1109/70.988969, whose controller dissipates after the fact; limiting the work of the coming period is ours.

    Args:
        config: Reserve, capacity, share, damping limit.
        period: Servo period [s].

    Attributes:
        energy: Taken from the hand, net [J]; never above the capacity.
    """

    __slots__ = ("_capacity", "_hand", "_limit", "_period", "_reserve", "_share", "energy")

    def __init__(self, config: PassivityConfig, period: float) -> None:
        self._reserve, self._capacity, self._share = config.reserve, config.capacity, config.share
        self._limit = config.damping_limit / period
        self._period = period
        self._hand: Vec3 | None = None
        self.energy = 0.0

    def observe(self, x: float, y: float, z: float, force: Vec3) -> float:
        """Count the work that `force` [N] has done since the last call, with the hand now at x, y, z [m]."""
        if self._hand is not None:
            u, v, w = self._hand
            fx, fy, fz = force
            energy = self.energy - (fx * (x - u) + fy * (y - v) + fz * (z - w))
            # the floor is never met in use; it keeps an absurd position from leaving infinity behind
            self.energy = max(-self._capacity, min(energy, self._capacity)) if energy == energy else -self._capacity
        self._hand = (x, y, z)
        return self.energy

    def control(self, force: Vec3, velocity: Vec3) -> Vec3:
        """The force [N] that may be sent for a period in which the hand is expected to go on at `velocity` [m/s]."""
        (fx, fy, fz), (vx, vy, vz), t = force, velocity, self._period
        dx, dy, dz = t * vx, t * vy, t * vz
        work = fx * dx + fy * dy + fz * dz
        left = self.energy + self._reserve
        given = self._share * left if left > 0.0 else 0.0
        surplus = work - given
        if surplus <= 0.0 and left >= 0.0:
            return force
        step2 = dx * dx + dy * dy + dz * dz
        if step2 < STILL:
            return force
        per_step = max(surplus, 0.0) / step2
        if left < 0.0:
            # what the force takes by itself counts towards winning back
            missing = (min(work, 0.0) - left) / step2
            per_step += min(max(missing, 0.0), self._limit)
        return fx - per_step * dx, fy - per_step * dy, fz - per_step * dz

    def state(self) -> list[Any]:
        """All that changes from step to step, for JSON."""
        return [self._hand, self.energy]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        self._hand, self.energy = as_tuples(state)


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

    Attributes:
        phase: `disarmed` (it needs `arm`), `ramping`, `armed`, `decaying` (it falls or has fallen, and comes back by
            itself unless it was disarmed) or `fault` (it needs `arm`).
        force: Last force sent [N].
        heat: Mean square force [N²].
    """

    __slots__ = ("_ceiling", "_config", "_faulty", "_gain", "_held", "_period", "_wanted", "force", "heat", "phase")

    def __init__(self, config: SafetyConfig, rate: float) -> None:
        self._config, self._period = config, 1.0 / rate
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
        """Guard, slew limit and clamp."""
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
