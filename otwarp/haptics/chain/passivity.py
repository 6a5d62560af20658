"""Energy at the port of a device: counted with the force that was really held, and kept from falling below −reserve.

A device holds the force F_k from one command to the next, so the work that it does is F_k·(x_{k+1} − x_k) whatever the
path and whatever the time between. Nobody can take a held force back: what the hand may do until the next command is
all that a bound can be about. With the reach δ of the hand in the coming hold, |F_k|·δ ≤ E_k + reserve gives
E ≥ −reserve for every motion within reach, whatever made the forces; and nothing weaker does.

Source: energy observer and controller after Hannaford and Ryu 2002, IEEE Transactions on Robotics and Automation 18(1),
1–10, doi:10.1109/70.988969, whose controller dissipates after the fact; a force that is bounded by the energy at hand
before it acts is the idea of the energy-bounding algorithm (Kim and Ryu 2010, International Journal of Robotics
Research 29(6)) and of energy tanks (Lee and Huang 2010; Franken et al. 2011, IEEE Transactions on Robotics 27(4)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from otwarp.haptics.core import ZERO, Vec3, as_tuples
from otwarp.haptics.core.config import PassivityConfig

STILL = 1e-12
"""Step of a hand that stands [m]: 1 pm is far below any encoder, and its direction is rounding."""

NEARLY = 0.95
"""Part of the energy at hand that the worst motion may take in one hold: below 1, so that a little force, which can win
energy back, always remains."""

KEPT = 0.9
"""Part of the reserve that motion which was foreseen may use up. What is left carries the forces that resist: with none
at all, nothing could win energy back."""

MEMORY = 2.0
"""Seconds for which a late cycle or a jerk is expected again, a late cycle up to twice that; and for which a hand must
rest until what it owes is forgiven."""

REST = 5e-3
"""Mean speed, by the length of its way, up to which a hand rests [m/s]: tremor of 0.1 mm at 10 Hz is 4 mm/s, and a
device of 0.15 kg has 2 µJ then, a fiftieth of the reserve."""

REFILL = 1e-5
"""Power at which the reserve of a hand that rests fills up again [W]: 10 s for all of it."""

LONGEST = 0.1
"""Longest hold that is foreseen [s]: by then the guardian of the servo has sent zero. What a longer one may have taken
is not counted, for nobody knows what was held."""

HELD = 0.02
"""Longest time between two cycles in which a force is surely held [s]: after it the drivers of some devices let it
fall, and the guardian sends zero (`devices.exchange`, `servo.guard`)."""

DEEPEST = 10.0
"""Largest debt [J]: 3 N along 3 m in one hold; an absurd position must not leave infinity behind."""

Account = tuple[float, float, float, float]
"""What a chain inherits of the one before it: energy, if it is a debt, floor, stake [J], longest hold [s]."""


def stiffest(config: PassivityConfig, period: float, hold: float) -> float:
    """Stiffness [N/m] up to which a spring that is pressed slowly is rendered as it is, if holds may last this long.

    At a depth d, K·d·δ ≤ `NEARLY`·(K·d²/2 + reserve) for all d: K ≤ 2·`NEARLY`²·reserve/δ². The hand rests, and its
    position is exact but for noise.

    Args:
        config: What is foreseen.
        period: Servo period [s].
        hold: Longest hold that is expected [s].
    """
    turn = 0.5 * config.acceleration * hold * (period + hold) + 2.0 * config.noise * hold / period
    reach = min(config.speed * hold, turn) + 4.0 * config.noise
    return 2.0 * NEARLY**2 * config.reserve / reach**2


class Passivity:
    """Energy observer, controller and bound of one hand.

    The reach of the hand in the coming hold follows from what is known when the force is sent:

    - the hold is as long as the longest of the last `MEMORY` seconds, at least a period and `hold`;
    - the hand goes on at its velocity, changed by at most `acceleration`, and no faster than `speed`. Who was jerkier
      within `MEMORY` is expected to reach `speed` at once;
    - positions are known to `noise` and `quantum`. Between two words of its device the hand goes straight, but for the
      detour that its acceleration and speed allow in that time, as far as it was foreseen.

    As long as a hold exceeds none of these, energy never falls below −`reserve`, and no noise adds up: every change of
    the force is charged with the largest error of the position, since by summation by parts Σ F_k·(n_{k+1} − n_k) is
    −Σ n_k·(F_k − F_{k−1}) but for its ends. A hold that exceeds them, the first late one, costs what it costs. It is
    counted in full, and until it is paid back no force drives: what resists may risk a stake that halves with every
    such hold, so that they do not add up.

    A hand that rests pays nothing back, and need not: what it was given went into motion, and that is over. After a
    block of `MEMORY` seconds of rest a debt from beyond the foreseen is forgiven, and of the reserve comes back what
    `REFILL` gives in that time. So what was foreseen takes `reserve` + `REFILL`·(time at rest) at most, and what was
    not is as bad again only after a rest.

    Args:
        config: Reserve, capacity and what is foreseen.
        period: Servo period [s].
        quantum: Resolution of the device's position [m].

    Attributes:
        energy: Taken from the hand, net, less what noise and silences may have hidden [J]; never above the capacity.
    """

    __slots__ = (
        "_age", "_anchor", "_changed", "_clock", "_config", "_error", "_floor", "_force", "_gap", "_hand", "_impulse",
        "_jerky", "_most", "_past", "_period", "_quantum", "_recent", "_since", "_span", "_stake", "_stood",
        "_velocity", "_way", "energy", "hold",
    )  # fmt: skip

    def __init__(self, config: PassivityConfig, period: float, quantum: float = 0.0) -> None:
        self._config, self._period = config, period
        self._quantum, self._error = quantum, quantum + 2.0 * config.noise
        self._hand: Vec3 | None = None
        self._anchor = self._velocity = self._force = self._impulse = self._stood = ZERO
        self._changed = self._most = self._way = 0.0
        self._span, self._since, self._age, self._gap = period, 0.0, 0.0, 0.0
        self._jerky = self._clock = self._past = self._recent = 0.0
        self.energy, self._floor, self._stake = 0.0, -config.reserve, config.reserve
        self.hold = max(period, config.hold)

    def observe(self, x: float, y: float, z: float, elapsed: float, *, known: bool = True) -> float:
        """Count the work that the held force has done in the last `elapsed` seconds; returns the energy [J].

        Args:
            x, y, z: Where the hand is [m].
            elapsed: Since the last call [s].
            known: Whether the device has said so just now.
        """
        self._age = age = self._age + elapsed
        self._since += elapsed
        self._gap = max(self._gap, elapsed)
        self._jerky -= elapsed
        self._clock += elapsed
        if self._changed or not known:
            (fx, fy, fz), (u, v, w) = self._force, self._impulse
            self._impulse = (u + fx * elapsed, v + fy * elapsed, w + fz * elapsed)
        if not known:
            return self.energy
        self._age = 0.0
        if self._hand is None:
            self._hand = self._anchor = self._stood = (x, y, z)
        else:
            self._count(x, y, z, age)
        if self._clock >= MEMORY or age > self._recent:
            self._remember(age)
        return self.energy

    def _count(self, x: float, y: float, z: float, age: float) -> None:
        """Work, way and velocity from the last position to this one, which is `age` [s] later."""
        (u, v, w), (fx, fy, fz), hidden = self._hand or ZERO, self._force, 0.0
        if self._changed:  # meanwhile: its mean, and what a detour may have hidden
            fx, fy, fz = (i / age for i in self._impulse)
            hidden, self._changed = self._changed * self._detour(min(age, self.hold)), 0.0
        self._impulse = ZERO
        work = fx * (x - u) + fy * (y - v) + fz * (z - w)
        if work < 0.0 and (age > LONGEST or self._gap > HELD):
            # what may have fallen meanwhile has not surely won anything
            work = 0.0
        self._gap = 0.0
        self._hand = (x, y, z)
        # together no more than there was room for
        self._pay(max(work, min(work + hidden, self._most)))
        way = math.dist(self._stood, self._hand)
        if way > self._error:
            self._stood, self._way = self._hand, self._way + way
        if self._since >= 0.5 * self._period:
            self._measure(x, y, z)

    def _detour(self, time: float) -> float:
        """Farthest that a hand strays from the straight line between two places that it is at this time apart [m]."""
        config = self._config
        way = 0.5 * config.speed * time
        return way if self._jerky > 0.0 else min(way, 0.125 * config.acceleration * time * time)

    def _remember(self, silence: float) -> None:
        """Longest time without a command or a position, and whether the hand rested, in this block of `MEMORY` seconds
        and in the last."""
        if self._clock >= MEMORY:
            if self._way <= REST * self._clock:
                self._rest()
            self._clock, self._past, self._recent, self._way = 0.0, self._recent, 0.0, 0.0
        self._recent = max(self._recent, min(silence, LONGEST))
        self.hold = max(self._period, self._config.hold, self._past, self._recent)

    def _rest(self) -> None:
        """The hand has rested for a block: a debt is forgiven, the reserve fills up; what is in store stays."""
        reserve = self._config.reserve
        back = REFILL * self._clock if self._floor >= -reserve else math.inf
        self.energy = max(self.energy, min(0.0, self.energy + back))
        self._floor, self._stake = -reserve, reserve

    def _pay(self, work: float) -> None:
        """Give `work` [J] away; the floor is what energy may not fall below next."""
        energy = self.energy - work
        if not -DEEPEST <= energy <= self._config.capacity:
            energy = self._config.capacity if energy > 0.0 else -DEEPEST
        self.energy = energy
        stake = self._stake
        if energy < self._floor:
            self._stake = stake = 0.5 * stake
            self._floor, self._way = energy - stake, math.inf
        elif energy >= 0.0:
            self._stake = reserve = self._config.reserve
            self._floor = -reserve
        elif energy - stake > self._floor:
            self._floor = energy - stake

    def _measure(self, x: float, y: float, z: float) -> None:
        """Velocity over the time that really passed, and whether it changed more than was foreseen."""
        span, last = self._since, self._span
        (u, v, w), (a, b, c) = self._anchor, self._velocity
        u, v, w = (x - u) / span, (y - v) / span, (z - w) / span
        self._anchor, self._velocity, self._span, self._since = (x, y, z), (u, v, w), span, 0.0
        # means over two neighbouring spans differ by no more than the speed can change between their middles
        change = 0.5 * self._config.acceleration * (last + span) + self._error * (1.0 / last + 1.0 / span)
        a, b, c = u - a, v - b, w - c
        if not a * a + b * b + c * c <= change * change:
            self._jerky = MEMORY

    def control(self, force: Vec3, velocity: Vec3) -> Vec3:
        """The force [N] that is asked for while the hand is expected to go on at `velocity` [m/s].

        What would give more than a share of the energy at hand is taken off along the motion, so that its end is
        approached smoothly; and a debt is won back by damping.
        """
        (fx, fy, fz), (vx, vy, vz), config = force, velocity, self._config
        work = fx * vx + fy * vy + fz * vz
        left = self.energy + KEPT * config.reserve
        if work <= 0.0 <= left:
            return force
        speed = math.sqrt(vx * vx + vy * vy + vz * vz)
        way = self.hold * speed
        if way < STILL:
            return force
        along = work / speed
        # an encoder says nothing for a while, and then a whole step
        given = config.share * left / (way + self._quantum) if left > 0.0 else 0.0
        less = max(along - given, 0.0)
        if left < 0.0:
            # what the force takes by itself counts towards winning back
            missing = min(along, 0.0) - left / way
            less += min(max(missing, 0.0), config.damping_limit * speed)
        k = less / speed
        return fx - k * vx, fy - k * vy, fz - k * vz

    def bound(self, force: Vec3, falling: bool = False) -> Vec3:
        """The force [N] made so small that no motion within reach can take more than there is.

        Between two positions of a device that is slower than the servo the force stays what it was: a change would be
        charged with the detour that the hand may have made. One that must fall falls, without a turn.
        """
        fx, fy, fz = force
        size = math.sqrt(fx * fx + fy * fy + fz * fz)
        if self._age > 0.0:
            (fx, fy, fz), held = self._force, math.dist(self._force, ZERO)
            k = size / held if falling and size < held else 1.0
            return k * fx, k * fy, k * fz
        self._most = 0.0
        if size == 0.0:
            return force
        config, t = self._config, self.hold
        room = NEARLY * (self.energy - self._floor - self._hidden(force))
        # the force's own end costs noise once more, and again when it is taken away
        ends = self._error + 2.0 * config.noise
        need = size * (t * config.speed + ends)
        if need > room:
            need = self._need(force, size, t, ends)
        k = 1.0 if need <= room else room / need if room > 0.0 else 0.0
        self._most = k * need
        return force if k == 1.0 else (k * fx, k * fy, k * fz)

    def _need(self, force: Vec3, size: float, t: float, ends: float) -> float:
        """Most work [J] that a hand can take from a force [N] of this size that is held for up to `t` [s]."""
        (fx, fy, fz), (vx, vy, vz), config = force, self._velocity, self._config
        reach = t * config.speed
        if self._jerky <= 0.0 and self._floor >= -config.reserve:
            along = (fx * vx + fy * vy + fz * vz) / size
            end = t * (along + config.acceleration * (0.5 * (self._span + t) + self._since))
            reach = min(reach, (end if end > 0.0 else 0.0) + self._error * t / self._span)
        return size * (reach + ends)

    def send(self, force: Vec3) -> None:
        """`force` [N] is held from now on."""
        if force == self._force:
            return
        if self._age > 0.0:
            self._changed += math.dist(force, self._force)
        self._pay(self._hidden(force))
        self._force = force

    def _hidden(self, force: Vec3) -> float:
        """Work [J] that an error of the position can hide when the force changes to this."""
        return self._config.noise * math.dist(force, self._force)

    @property
    def account(self) -> Account:
        """What a chain for the same hand inherits; energy in store is forgotten, a debt is not."""
        return min(self.energy, 0.0), self._floor, self._stake, self.hold

    @account.setter
    def account(self, value: Account) -> None:
        self.energy, self._floor, self._stake, self._past = value
        self._remember(0.0)

    def state(self) -> list[Any]:
        """All that changes from step to step, for JSON."""
        held = [self._hand, self.energy, self._floor, self._stake, self._force, self._age]
        moves = [self._anchor, self._velocity, self._span, self._since]
        times = [self._jerky, self._clock, self._past, self._recent, self.hold]
        return [*held, *moves, *times, self._impulse, self._changed, self._most, self._stood, self._way, self._gap]

    def restore(self, state: Sequence[Any]) -> None:
        """Go on from a `state`; earlier versions recorded the first two of it, then all but the last six, then all but
        the last."""
        self._hand, self.energy, *rest = as_tuples(state)
        if rest:
            self._floor, self._stake, self._force, self._age, *rest = rest
            self._anchor, self._velocity, self._span, self._since, *rest = rest
            self._jerky, self._clock, self._past, self._recent, self.hold, *rest = rest
        if rest:
            self._impulse, self._changed, self._most, self._stood, self._way, *rest = rest
        if rest:
            (self._gap,) = rest
