"""Commands that vary within a step, as the stages of an integrator are to see them.

Samples of traps may be finer than the step: a focus that circles, a beam that blinks or is shared out among places.
Within a step such a command is replaced by the line that, at the stages of the integrator, has the effect of the whole
course: its mean, and for two stages its first moment, of the power P and of the focus c, weighted by P where P varies.

For a spring, with τ from −½ to ½ over the step and the change Δ of c over it, a step of Heun's is right to second order
in k·dt for stages c̄ ∓ (2 ∫c τ dτ + Δ/3), where the last term keeps the lag behind a steady motion exact; one of the
exponential scheme for the best straight line, c̄ ∓ 6 ∫c τ dτ: both are c at the ends of the step where c is a line. One
stage sees the mean. Powers stay between those that occur.

Integrals are sums over the pieces between samples within one step, in float64, so that long tracks lose no digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.kernels.integrate.integrators import Integrator
from otwarp.kernels.integrate.schemes import EARLY
from otwarp.scene import Scene

Samples = tuple[np.ndarray, np.ndarray]
"""Times (k,) [s] and values (k, n)."""

STRAIGHT = 1e-3
"""By how much the mean, or first moment, of a focus within a step may differ from that of a line [µm], and that of a
power relative to the highest, before the step is given a line of its own."""


@dataclass(frozen=True, eq=False)
class Course:
    """A sampled command (n values) within the m steps in which there are samples.

    Attributes:
        step: (m,) numbers of these steps.
        mean, moment: (m, n) ∫c dτ and ∫c τ dτ.
        square: (m, n) ∫c² dτ.
        joint: (2, m, n) ∫P c dτ and ∫P c τ dτ with the last value P.
        low, high: (m, n) least and largest value.
        first, last: (m, n) values at start and end.
    """

    step: np.ndarray
    mean: np.ndarray
    moment: np.ndarray
    square: np.ndarray
    joint: np.ndarray
    low: np.ndarray
    high: np.ndarray
    first: np.ndarray
    last: np.ndarray

    @classmethod
    def of(cls, times: np.ndarray, values: np.ndarray, step: float) -> Course:
        """Of samples at times (k,) [s] with values (k, n), interpolated linearly and constant outside.

        Args:
            step: Time step [s].
        """
        number = np.unique(np.floor(times / step).astype(np.int64))
        number = number[number >= 0]
        starts, ends = number * step, (number + 1) * step
        knots = np.unique(np.concatenate([times, starts, ends]))
        at = interpolated(times, values, knots)
        # pieces between knots, and the step in whose middle part each lies
        owner = np.floor(0.5 * (knots[1:] + knots[:-1]) / step).astype(np.int64)
        inside = np.flatnonzero(np.isin(owner, number))
        row, left, right = np.searchsorted(number, owner[inside]), at[inside], at[inside + 1]
        width = np.diff(knots)[inside] / step
        middle = 0.5 * (knots[inside] + knots[inside + 1]) / step - number[row] - 0.5
        shape = (len(number), values.shape[1])
        sums = np.zeros((5, *shape))
        # two Gauss points integrate polynomials of third degree: P c τ, where both are lines
        for side in (-1.0, 1.0):
            weight = side / np.sqrt(3.0)
            c = 0.5 * (left + right) + 0.5 * weight * (right - left)
            tau = (middle + 0.5 * weight * width)[:, None]
            p = c[:, -1:]
            for total, value in zip(sums, (c, c * tau, c * c, p * c, p * c * tau), strict=True):
                np.add.at(total, row, 0.5 * width[:, None] * value)
        low, high = np.full(shape, np.inf), np.full(shape, -np.inf)
        for value in (left, right):
            np.minimum.at(low, row, value)
            np.maximum.at(high, row, value)
        first, last = interpolated(times, values, starts), interpolated(times, values, ends)
        return cls(number, sums[0], sums[1], sums[2], sums[3:], low, high, first, last)

    @property
    def bent(self) -> np.ndarray:
        """(m,) whether a step differs from a straight line by more than `STRAIGHT`."""
        scale = np.ones(self.mean.shape[1])
        scale[-1] = max(float(self.high[:, -1].max(initial=0.0)), 1e-300)
        change = self.last - self.first
        off = np.abs(self.mean - 0.5 * (self.first + self.last)), np.abs(2.0 * self.moment - change / 6.0)
        return np.any(np.maximum(*off) > STRAIGHT * scale, axis=1, keepdims=True)[:, 0]

    def lines(self, scheme: Integrator) -> tuple[np.ndarray, np.ndarray]:
        """(m, n) what the first and the second stage of a scheme see; values are a focus and a power P."""
        of_moment, of_change = scheme.course
        power, turn = self.mean[:, -1:], 2.0 * self.moment[:, -1:]
        varies = self.high[:, -1:] - self.low[:, -1:] > 1e-9 * self.high[:, -1:]
        lit = varies & (power > 0.0)
        over = np.where(lit, power, 1.0)
        mean = np.where(lit, self.joint[0] / over, self.mean)
        moment = np.where(lit, (self.joint[1] - 0.5 * mean * turn) / over, self.moment)
        half = of_moment * moment + np.where(varies, 0.0, of_change * (self.last - self.first))
        if scheme.correct is None:
            first = last = np.concatenate([(mean - half)[:, :-1], power], axis=1)
            return first, last
        # power and focus rise together: their product has the mean that it should have
        mean = mean - np.where(lit, turn * half / over, 0.0)
        first, last = mean - half, mean + half
        return np.concatenate([first[:, :-1], power - turn], 1), np.concatenate([last[:, :-1], power + turn], 1)


def interpolated(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(k, n) values at times (k,), linear between samples and constant outside."""
    return np.stack([np.interp(at, times, column) for column in values.T], axis=1)


def staged_commands(scene: Scene, step: float, scheme: Integrator) -> list[Samples] | None:
    """Per trap its command as the stages of a scheme are to see it, None where all are the commands themselves."""
    commands = sampled_commands(scene)
    seen = [staged(*samples, step, scheme) if len(samples[0]) else None for samples in commands]
    if all(s is None for s in seen):
        return None
    return [command if s is None else s for command, s in zip(commands, seen, strict=True)]


def sampled_commands(scene: Scene) -> list[Samples]:
    """Per trap the times and (k, 4) focus [µm] and power [mW] on the union of its samples; none where it stays."""
    found = []
    for trap in scene.traps:
        times = np.zeros(0)
        if trap.position.animated or trap.power.animated:
            times = np.union1d(trap.position.times, trap.power.times)
        tracks = [interpolated(track.times, track.values, times) for track in (trap.position, trap.power)]
        found.append((times, np.concatenate(tracks, axis=1)))
    return found


def staged(times: np.ndarray, values: np.ndarray, step: float, scheme: Integrator) -> Samples | None:
    """Times and values of a command as the stages of a scheme are to see it, None where that is the command itself.

    Steps that are not straight have a line of their own, from a moment before they start to a moment before they end;
    where two lines meet there are two samples of one time, of which the later counts. The second stage looks `EARLY`
    before the end of its step, and so finds its own line and not the next.
    """
    course = Course.of(times, values, step)
    bent = course.bent
    if not bent.any():
        return None
    number = course.step[bent]
    start, end = (number - 0.5 * EARLY) * step, (number + 1 - 0.5 * EARLY) * step
    first, last = (side[bent] for side in course.lines(scheme))
    opens, closes = np.diff(number, prepend=-2) != 1, np.diff(number, append=number[-1] + 2) != 1
    slot = np.searchsorted(start, times, side="right") - 1
    free = (slot < 0) | (times >= end[slot])
    hold = [times[0] - 1.0, start[0] - 1.0], [times[-1] + 1.0, end[-1] + 1.0]
    rows = [
        (times[free], values[free], 1),
        (start[opens], course.first[bent][opens], 0),
        (start, first, 2),
        (end, last, 0),
        (end[closes], course.last[bent][closes], 2),
        ([min(hold[0])], values[:1], 0),
        ([max(hold[1])], values[-1:], 2),
    ]
    moments = np.concatenate([np.asarray(t, dtype=float) for t, _, _ in rows])
    order = np.lexsort((np.concatenate([np.full(len(t), rank) for t, _, rank in rows]), moments))
    return moments[order], np.concatenate([v for _, v, _ in rows])[order]
