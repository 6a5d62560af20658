"""From the hand's position to its velocity, through the virtual coupling, to the motion of its traps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from otwarp.haptics.core import Vec3, as_tuples
from otwarp.haptics.core.config import CouplingConfig, HandConfig

AT_ONCE = 1e-3
"""Part of a period below which two samples are at one time, and tell no velocity."""

LONGEST_WINDOW = 15
"""Periods that a velocity estimate looks back at most: 15 ms at 1 kHz is what a slow hand can spare."""


class VectorFilter:
    """A low-pass filter of a vector: `value` follows what `step` is given."""

    __slots__ = ("alpha", "value")

    def __init__(self, alpha: float, value: Vec3 = (0.0, 0.0, 0.0)) -> None:
        self.alpha = alpha
        self.value = value

    def step(self, x: float, y: float, z: float) -> Vec3:
        """One sample; returns the filtered vector."""
        a, (u, v, w) = self.alpha, self.value
        self.value = (u + a * (x - u), v + a * (y - v), w + a * (z - w))
        return self.value

    def state(self) -> list[Any]:
        """What changes from step to step, for JSON."""
        return [self.value]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        (self.value,) = as_tuples(state)


class VelocityEstimate:
    """First-order adaptive windowing, end-fit: the slope over the longest window that the noise margin allows.

    Of the lines through the newest sample and the n-th before it, the longest is taken for which every sample between
    lies within ±quantum of the line. Fast motion has a short window and little delay, slow motion a long one and
    little noise.

    Source: Janabi-Sharifi, Hayward and Chen 2000, "Discrete-time adaptive windowing for velocity estimation", IEEE
    Transactions on Control Systems Technology 8(6), 1003–1009, doi:10.1109/87.880606.

    Args:
        period: Servo period [s].
        quantum: Noise margin [m]; 0 takes the difference of the last two samples, except in perfectly even motion.
    """

    __slots__ = ("_ages", "_axes", "_period", "_quantum", "_velocity")

    def __init__(self, period: float, quantum: float) -> None:
        self._period, self._quantum = period, quantum
        self.reset()

    def reset(self) -> None:
        """Forget all samples: the velocity is zero until more have come."""
        self._axes: tuple[list[float], ...] = ([], [], [])
        self._ages: list[float] = []
        self._velocity: Vec3 = (0.0, 0.0, 0.0)

    def step(self, x: float, y: float, z: float, elapsed: float | None = None) -> Vec3:
        """Velocity [m/s] with the hand at x, y, z [m].

        Args:
            x, y, z: The new sample.
            elapsed: Time since the last one [s], None for a period; the velocity is as it was if that is 0.
        """
        elapsed = self._period if elapsed is None else elapsed
        if elapsed >= AT_ONCE * self._period:
            a, b, c = self._axes
            if self._quantum > 0.0:
                ages = self._ages
                self._ages = ages = [elapsed, *[age + elapsed for age in ages[: len(a) - 1]]] if a else []
                self._velocity = self._slope(a, x), self._slope(b, y), self._slope(c, z)
            else:
                if a:
                    self._velocity = (x - a[0]) / elapsed, (y - b[0]) / elapsed, (z - c[0]) / elapsed
                self._axes = [x], [y], [z]
        return self._velocity

    def state(self) -> list[Any]:
        """What changes from step to step, for JSON: the window of each axis, its ages, and the newest result."""
        return [*(list(axis) for axis in self._axes), list(self._ages), self._velocity]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`; earlier versions recorded the windows alone, of samples a period apart."""
        x, y, z, *rest = state
        self._axes = (list(x), list(y), list(z))
        ages, velocity = rest or ([n * self._period for n in range(1, len(x))], (0.0, 0.0, 0.0))
        self._ages, self._velocity = list(ages), as_tuples(velocity)

    def _slope(self, past: list[float], x: float) -> float:
        """Slope of one axis; `past` holds its samples, newest first."""
        low, high, slope, q = -math.inf, math.inf, 0.0, self._quantum
        for before, age in zip(past, self._ages, strict=True):
            s = (x - before) / age
            if not low <= s <= high:
                break
            slope = s
            # slopes of lines through x that pass this sample within the margin
            margin = q / age
            if s - margin > low:
                low = s - margin
            if s + margin < high:
                high = s + margin
        past.insert(0, x)
        del past[LONGEST_WINDOW:]
        return slope


class VirtualCoupling:
    """A massless proxy drawn by the hand through k_c and b_c, and by the force of the scene.

    0 = k_c(h − p) + b_c(ḣ − ṗ) + F(p). The proxy carries the traps and the hand feels F(p), which the coupling passes
    on: a stiffness k and the coupling in series, k·k_c/(k + k_c) at rest. The coupling's own spring is solved
    implicitly; F is that of the last period.

    Source: Colgate, Stanley and Brown 1995, "Issues in the haptic display of tool use", IROS.

    Args:
        config: k_c [N/m] and b_c [N·s/m].
        rate: Servo rate [Hz].
    """

    __slots__ = ("_damping", "_hand", "_stiffness", "proxy")

    def __init__(self, config: CouplingConfig, rate: float) -> None:
        self._stiffness = config.stiffness
        self._damping = config.damping * rate
        self._hand: Vec3 | None = None
        self.proxy: Vec3 = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        """The next step puts the proxy at the hand."""
        self._hand = None

    def step(self, x: float, y: float, z: float, force: Vec3) -> Vec3:
        """Proxy [m] for the hand at x, y, z [m] and the force that the hand was last given by the scene [N]."""
        if self._hand is None:
            self._hand = self.proxy = (x, y, z)
        k, b = self._stiffness, self._damping
        (u, v, w), (p, q, r), (fx, fy, fz) = self._hand, self.proxy, force
        s = 1.0 / (k + b)
        p = s * (b * (p + x - u) + k * x + fx)
        q = s * (b * (q + y - v) + k * y + fy)
        r = s * (b * (r + z - w) + k * z + fz)
        self._hand, self.proxy = (x, y, z), (p, q, r)
        return self.proxy

    def state(self) -> list[Any]:
        """What changes from step to step, for JSON."""
        return [self._hand, self.proxy]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        self._hand, self.proxy = as_tuples(state)


class Motion:
    """G_control: how far the hand has carried its traps, Δtrap = motion_gain·A·Δhand, while it holds them.

    `carried` is where the force is evaluated; `commanded` lags behind it by the motion low-pass and is what
    the simulation gets. In absolute mode the traps follow the place of the hand from where it took hold.
    """

    __slots__ = ("_absolute", "_axes", "_hand", "_last", "_limit", "_map", "_origin", "carried", "commanded", "filter")

    def __init__(self, config: HandConfig) -> None:
        chain = config.chain
        self._axes = config.axis_map
        self._map = self._scaled(config.motion_gain)
        self._absolute = config.absolute
        self._limit = chain.trap_speed / chain.rate
        low_pass = chain.motion_filter
        self.filter = VectorFilter(low_pass.at(chain.rate).alpha) if low_pass and low_pass.alpha < 1.0 else None
        self._hand: Vec3 | None = None
        self._last: Vec3 = (0.0, 0.0, 0.0)
        self._origin: Vec3 = (0.0, 0.0, 0.0)
        self.carried: Vec3 = (0.0, 0.0, 0.0)
        self.commanded: Vec3 = (0.0, 0.0, 0.0)

    def _scaled(self, gain: float) -> tuple[float, ...]:
        return tuple(gain * entry for row in self._axes for entry in row)

    def set_gain(self, gain: float) -> None:
        """Another motion gain [µm/m] from the next motion on; what was carried so far stays where it is."""
        if self._absolute and self._hand is not None:
            # the place for where the hand is now belongs to it under both gains
            self._origin = self._place(*self._last)
            self._hand = self._last
        self._map = self._scaled(gain)

    def reset(self) -> None:
        """Take hold anew: nothing carried yet."""
        self._hand = None
        self._origin = self.carried = self.commanded = (0.0, 0.0, 0.0)
        if self.filter:
            self.filter.value = (0.0, 0.0, 0.0)

    def step(self, x: float, y: float, z: float, holds: bool) -> Vec3:
        """Carry the traps to where the hand at x, y, z [m] takes them, if it holds them; returns `carried` [µm]."""
        if self._hand is None:
            self._hand = (x, y, z)
        if self._absolute:
            self._last = (x, y, z)
            if holds:
                self.carried = self._place(x, y, z)
        else:
            if holds:
                p, q, r = self._slowed(*self._moved(x, y, z))
                u, v, w = self.carried
                self.carried = (u + p, v + q, w + r)
            self._hand = (x, y, z)
        self.commanded = self.filter.step(*self.carried) if self.filter else self.carried
        return self.carried

    def state(self) -> list[Any]:
        """What changes from step to step, for JSON; without the filter, which has a state of its own."""
        return [self._hand, self._last, self._map, self._origin, self.carried, self.commanded]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`."""
        self._hand, self._last, self._map, self._origin, self.carried, self.commanded = as_tuples(state)

    def _moved(self, x: float, y: float, z: float) -> Vec3:
        """What the way from `_hand` to x, y, z [m] is to the traps [µm]."""
        u, v, w = self._hand or (x, y, z)
        u, v, w = x - u, y - v, z - w
        a, b, c, d, e, f, g, h, i = self._map
        return a * u + b * v + c * w, d * u + e * v + f * w, g * u + h * v + i * w

    def _place(self, x: float, y: float, z: float) -> Vec3:
        """Where absolute motion puts the traps for a hand at x, y, z [m]."""
        p, q, r = self._moved(x, y, z)
        u, v, w = self._origin
        return u + p, v + q, w + r

    def _slowed(self, p: float, q: float, r: float) -> Vec3:
        """A step [µm] no longer than the traps' speed limit allows."""
        length = self._limit
        if length < math.inf:
            step = math.sqrt(p * p + q * q + r * r)
            if step > length:
                k = length / step
                return k * p, k * q, k * r
        return p, q, r
