"""A hand, a machine and a scene that do their worst to a chain: whatever energy they get is counted outside of it."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from otwarp.haptics.chain.chain import Chain
from otwarp.haptics.chain.passivity import LONGEST, REST
from otwarp.haptics.core import ZERO, DeviceSample, SceneFrame, SphereFrame, TrapFrame, Vec3
from otwarp.haptics.core.config import IDENTITY, ChainConfig, HandConfig, PassivityConfig, SafetyConfig
from otwarp.haptics.devices.virtual import advance

PERIOD = 1e-3
DEFAULT = PassivityConfig()
PER_METRE = 1e6
"""Motion gain [µm/m]: the scene is as large as the hand's motion."""


class Spring:
    """A spring in 3-D to the first sphere in place of the local model: what the hand feels is −K(x − sphere)."""

    def __init__(self, stiffness: float) -> None:
        self._stiffness = stiffness / PER_METRE
        self._sphere: Vec3 = ZERO

    def refresh(self, scene: SceneFrame, traps: Any) -> bool:
        if scene.spheres:
            self._sphere = scene.spheres[0].position
        return True

    def force(self, x: float, y: float, z: float) -> Vec3:
        k, (u, v, w) = self._stiffness, self._sphere
        return k * (x - u), k * (y - v), k * (z - w)

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: Any) -> None: ...


@dataclass(frozen=True, kw_only=True)
class Attack:
    """What hand, machine and scene do.

    Attributes:
        stiffness: Of the spring [N/m].
        moves: (direction, speed [m/s], cycles) one after another, again and again. Directions: `out` along the force,
            `in` against it, `side`, `still`, `x` along the axis whatever the force, `turn` along it to and fro, and
            `load`, `in` until the force is as large as the speed is in units of 0.1 m/s [N], and then `out`.
        intervals: Between cycles [s], again and again.
        acceleration: Largest of the hand [m/s²].
        noise: Of the device's position, uniform or at its worst [m].
        pose: Noise of the sphere's position [m of hand].
        drop: Probability that a state is lost.
        silent: Probability that the device says nothing in a cycle.
        longest: Longest silence of the device [s].
        fall: Probability that the force begins to fall in a cycle, or may come back.
        seed: Of all that is random.
    """

    stiffness: float
    moves: tuple[tuple[str, float, int], ...] = (("still", 0.0, 1),)
    intervals: tuple[float, ...] = (PERIOD,)
    acceleration: float = math.inf
    noise: float = 0.0
    pose: float = 0.0
    drop: float = 0.0
    silent: float = 0.0
    longest: float = LONGEST
    fall: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Loss:
    """What came of it.

    Attributes:
        least: Least energy taken from the hand, net [J].
        last: At the end [J].
        counted: Most that the chain counted above the truth [J].
        largest: Largest force [N].
        hold: Most that a hand of 0.5 m/s can get from one hold, |F|·v·T [J].
        slow: Time for which it was no faster than ten times `REST` [s]: nine tenths of every rest, or more.
    """

    least: float
    last: float
    counted: float
    largest: float
    hold: float
    slow: float


def spring_chain(stiffness: float, passivity: PassivityConfig | None, ramp: float = 0.0, quantum: float = 0.0) -> Chain:
    """A chain that renders a spring, not armed yet, with the limits of a Touch but for its motor guard."""
    chain = ChainConfig(passivity=passivity, quantum=quantum)
    safety = SafetyConfig(ramp_time=ramp, continuous_force=3.3)
    config = HandConfig(
        traps=(0,), motion_gain=PER_METRE, force_gain=1.0, axis_map=IDENTITY, chain=chain, safety=safety
    )
    return Chain(config, Spring(stiffness))


def along(force: Vec3, speed: float) -> Vec3:
    """A velocity of this speed along a force, along x where there is none."""
    size = math.hypot(*force)
    if size == 0.0:
        return speed, 0.0, 0.0
    return speed * force[0] / size, speed * force[1] / size, speed * force[2] / size


class Hand:
    """The moves of an `Attack`, within its acceleration."""

    def __init__(self, attack: Attack) -> None:
        self._attack, self._at, self._left, self._loaded = attack, 0, attack.moves[0][2], False
        self.position = self._velocity = ZERO

    def wanted(self, force: Vec3) -> Vec3:
        """The velocity that it would like now [m/s]."""
        moves = self._attack.moves
        if self._left <= 0:
            self._at = (self._at + 1) % len(moves)
            self._left, self._loaded = moves[self._at][2], False
        self._left -= 1
        kind, speed, _ = moves[self._at]
        if kind == "load":
            self._loaded |= math.hypot(*force) >= 10.0 * speed
            return along(force, 0.5 if self._loaded else -0.05)
        if kind == "side":
            u, v, _ = along(force, speed)
            return -v, u, 0.0
        if kind in ("x", "turn"):
            return (-speed if kind == "turn" and self._left % 2 else speed), 0.0, 0.0
        return along(force, {"out": speed, "in": -speed, "still": 0.0}[kind])

    def move(self, force: Vec3, time: float) -> Vec3:
        """Where it is after `time` [s] under a force that it feels [N]."""
        wanted, was, most = self.wanted(force), self._velocity, self._attack.acceleration
        if most == math.inf:
            now = mean = wanted
        else:
            change = math.dist(wanted, was)
            share = 1.0 if change <= most * time else most * time / change
            now = tuple(a + share * (b - a) for a, b in zip(was, wanted, strict=True))
            mean = tuple(0.5 * (a + b) for a, b in zip(was, now, strict=True))
        x, y, z = (p + time * v for p, v in zip(self.position, mean, strict=True))
        self._velocity = (now[0], now[1], now[2])
        self.position = (x, y, z)
        return self.position


class Path:
    """A hand that goes its way, whatever it feels."""

    def __init__(self, place: Callable[[float], float]) -> None:
        self._place, self._time = place, 0.0

    def move(self, force: Vec3, time: float) -> Vec3:
        self._time += time
        return self._place(self._time), 0.0, 0.0


class Grip:
    """A device in a hand that wants to stay where it is and gives way: 0.15 kg, 20 N/m, critically damped."""

    def __init__(self) -> None:
        self._x = self._v = 0.0

    def move(self, force: Vec3, time: float) -> Vec3:
        if time > 0.0:
            self._x, self._v = advance(self._x, self._v, force[0], 0.15, 0.2 + 2.0 * math.sqrt(20.0 * 0.15), 20.0, time)
        return self._x, 0.0, 0.0


class Moves(Protocol):
    def move(self, force: Vec3, time: float) -> Vec3: ...


def lose(
    attack: Attack,
    passivity: PassivityConfig | None = DEFAULT,
    cycles: int = 600,
    *,
    ramp: float = 0.0,
    quantum: float = 0.0,
    hand: Moves | None = None,
) -> Loss:
    """Run an attack on a chain that is armed from the start.

    Args:
        attack: What is done.
        passivity: Of the chain.
        cycles: How long.
        ramp: Time from armed to full force [s].
        quantum: Resolution of the position that the chain believes in; it gets exact ones [m].
        hand: Moves instead of the moves of the attack.
    """
    chain, rng = spring_chain(attack.stiffness, passivity, ramp, quantum), random.Random(attack.seed)
    chain.arm()
    hand = hand or Hand(attack)
    force, place, time = ZERO, hand.move(ZERO, 0.0), 0.0
    energy = least = counted = largest = hold = slow = since = 0.0
    trap, beat, sphere, error, known = TrapFrame(0, ZERO, 1.0), 1, ZERO, ZERO, place
    for n in range(cycles):
        if n:
            interval = attack.intervals[n % len(attack.intervals)]
            hold = max(hold, math.hypot(*force) * 0.5 * interval)
            before, place, time = place, hand.move(force, interval), time + interval
            since += interval
            slow += interval if math.dist(place, before) <= 10.0 * REST * interval else 0.0
            energy -= sum(f * (a - b) for f, a, b in zip(force, place, before, strict=True))
            least = min(least, energy)
        if rng.random() >= attack.drop:
            beat += 1
            x, y, z = (PER_METRE * attack.pose * rng.uniform(-1.0, 1.0) for _ in range(3))
            sphere = (x, y, z)
        if attack.noise:
            # towards the sphere one time, away from it the next: the force swings with it
            worst = along(place, attack.noise if n % 2 else -attack.noise)
            error = worst if rng.random() < 0.5 else tuple(rng.uniform(-1, 1) * attack.noise / 2.0 for _ in range(3))
        coming = attack.intervals[(n + 1) % len(attack.intervals)]
        fresh = since + coming > attack.longest or rng.random() >= attack.silent
        if fresh:
            u, v, w = (a + b for a, b in zip(place, error, strict=True))
            known, since = (u, v, w), 0.0
        if attack.fall and rng.random() < attack.fall:
            chain.disarm() if chain.safety.wanted else chain.arm()
        sample = DeviceSample(time, known, 0, fresh)
        now = chain.step(sample, SceneFrame(beat, time, (SphereFrame(sphere, 0),), (trap,)))
        force = now.force
        counted, largest = max(counted, now.energy - energy), max(largest, math.hypot(*force))
        if now.state in ("disarmed", "fault"):
            chain.arm()
    return Loss(least, energy, counted, largest, hold, slow)
