"""A scripted hand on a virtual device: it follows a path, and gives way to the force that it feels.

    m·ẍ = F + k·(p(t) − x) + c·(ṗ(t) − ẋ) − b·ẋ

with the device's mass m and friction b, the rendered force F, and a grip of stiffness k and damping c that wants to be
at p(t). The force is held between two readings, as by motors; within one the equation is solved exactly for a path at
its middle, so that no integrator adds or takes energy. `mass=0` is a hand that nothing moves off its path; `grip=0` a
device that nobody holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec, parse_number, parse_parameters

Path3 = Callable[[float], Vec3]

SAME = 1e-9
"""Relative difference of the squared rates below which a hand is critically damped: sinh(x)/x is 1 to 1e-16 there."""
LONGEST_STEP = 0.1
"""Seconds that one reading may advance the hand."""

HAND: dict[str, tuple[float, float, float]] = {
    "mass": (0.15, 0.0, 10.0),
    "damping": (0.2, 0.0, 100.0),
    "grip": (300.0, 0.0, 1e5),
    "grip_damping": (-1.0, -1.0, 1e3),
    "force": (3.3, 0.0, 100.0),
    "continuous": (0.88, 0.0, 100.0),
    "buttons": (1.0, 0.0, 255.0),
}
"""Parameters of every script: default, least, most. SI units; `grip_damping` = −1 damps the grip critically; the forces
are those of a Touch."""

NUMBERS: dict[str, dict[str, tuple[float, float, float]]] = {
    "hold": {},
    "line": {"duration": (2.0, 1e-3, 1e4)},
    "circle": {"radius": (0.02, 0.0, 1.0), "period": (4.0, 1e-2, 1e4)},
    "sine": {"amplitude": (0.02, 0.0, 1.0), "frequency": (0.5, 0.0, 100.0)},
}
"""Scripts and their numbers: default, least, most."""
POINTS: dict[str, tuple[str, ...]] = {"hold": ("at",), "line": ("from", "to"), "circle": ("at",), "sine": ("at",)}
WORDS = {"circle": ("plane", ("xy", "yz", "zx")), "sine": ("axis", ("x", "y", "z"))}


@dataclass(frozen=True, slots=True, kw_only=True)
class HandModel:
    """Mass [kg], friction [N·s/m], stiffness [N/m] and damping [N·s/m] of the grip, see the module."""

    mass: float = 0.15
    damping: float = 0.2
    grip: float = 300.0
    grip_damping: float = -1.0

    @property
    def held_damping(self) -> float:
        """Damping of the grip, critical unless given [N·s/m]."""
        return 2.0 * math.sqrt(self.grip * self.mass) if self.grip_damping < 0.0 else self.grip_damping


def advance(
    x: float, v: float, push: float, mass: float, damping: float, stiffness: float, dt: float
) -> tuple[float, float]:
    """Position and velocity after `dt` of m·ẍ = push − c·ẋ − k·x, exactly.

    Args:
        x, v: Position [m] and velocity [m/s].
        push: Constant force [N].
        mass, damping, stiffness: m > 0 [kg], c [N·s/m], k [N/m].
        dt: Time [s].
    """
    rate, square = 0.5 * damping / mass, stiffness / mass
    if stiffness == 0.0:
        if rate * dt < SAME:  # no friction to speak of
            return x + v * dt + 0.5 * push / mass * dt * dt, v + push / mass * dt
        end = push / damping
        gone = -math.expm1(-2.0 * rate * dt)
        return x + end * dt + (v - end) * gone / (2.0 * rate), end + (v - end) * (1.0 - gone)
    rest = push / stiffness
    y = x - rest
    spread = rate * rate - square
    if abs(spread) <= SAME * square:
        decay = math.exp(-rate * dt)
        c, s = decay, decay * dt
    elif spread > 0.0:
        root = math.sqrt(spread)
        slow, fast = math.exp((root - rate) * dt), math.exp(-(root + rate) * dt)
        c, s = 0.5 * (slow + fast), 0.5 * (slow - fast) / root
    else:
        root, decay = math.sqrt(-spread), math.exp(-rate * dt)
        c, s = decay * math.cos(root * dt), decay * math.sin(root * dt) / root
    return rest + (c + rate * s) * y + s * v, (c - rate * s) * v - square * s * y


class VirtualDevice:
    """A scripted hand, see the module.

    Args:
        path: Where the hand wants to be [m] at a time since it was opened [s].
        model: How it gives way.
        info: Name and limits.
        buttons: Held all the time.
    """

    def __init__(self, path: Path3, model: HandModel | None = None, info: DeviceInfo | None = None, buttons: int = 1):
        self._path, self._model, self._buttons = path, model or HandModel(), buttons
        self.info = info or DeviceInfo(name="virtual", kind="virtual", force=3.3, continuous_force=0.88)
        self._start: float | None = None
        self._time = 0.0
        self._position: Vec3 = ZERO
        self._velocity: Vec3 = ZERO
        self._opened = False
        self.force: Vec3 = ZERO

    def open(self) -> None:
        """Put the hand at the start of its path; the script's time starts with the first `read`."""
        self._start, self._opened = None, True
        self.force = self._velocity = ZERO

    def read(self, time: float) -> DeviceSample:
        """See `Device`."""
        if not self._opened:
            raise DeviceLost(f"{self.info.name} is not open")
        if self._start is None:
            self._start = self._time = time
            self._position = self._path(0.0)
        dt = min(time - self._time, LONGEST_STEP)
        if dt > 0.0:
            self._move(self._time - self._start, time - self._start, dt)
            self._time = time
        return DeviceSample(time, self._position, self._buttons)

    def _move(self, before: float, after: float, dt: float) -> None:
        """Advance the hand from one script time [s] to another by `dt`."""
        model, path = self._model, self._path
        if model.mass == 0.0:
            self._position = path(after)
            return
        k, c = model.grip, model.held_damping if model.grip > 0.0 else 0.0
        here, there = path(before), path(after)
        moved = []
        for i in range(3):
            pull = 0.5 * k * (here[i] + there[i]) + c * (there[i] - here[i]) / (after - before)
            push = self.force[i] + pull
            moved.append(advance(self._position[i], self._velocity[i], push, model.mass, model.damping + c, k, dt))
        (x, u), (y, v), (z, w) = moved
        self._position, self._velocity = (x, y, z), (u, v, w)

    def write(self, force: Vec3) -> None:
        """See `Device`; held until the next."""
        if not self._opened:
            raise DeviceLost(f"{self.info.name} is not open")
        self.force = force

    def close(self) -> None:
        """See `Device`."""
        self._opened = False
        self.force = ZERO


def create(spec: DeviceSpec) -> VirtualDevice:
    """`virtual:SCRIPT,key=value,…` with SCRIPT one of hold, line, circle, sine; points as `0/0.01/0`.

    Raises:
        InputError: Unknown script or parameter, or a value out of range.
    """
    where = f"device {spec.text!r}"
    argument = spec.argument or ""
    script = argument.split(",")[0].strip()
    if script not in NUMBERS:
        raise InputError(f"{where}: script {script!r} must be one of {', '.join(NUMBERS)}")
    ranges = NUMBERS[script] | HAND
    word = WORDS.get(script)
    allowed = (*POINTS[script], *NUMBERS[script], *((word[0],) if word else ()), *HAND)
    _, found = parse_parameters(where, argument, allowed)
    numbers = {key: parse_number(where, key, found.get(key), *ranges[key]) for key in ranges}
    points = [_point(where, key, found.get(key)) for key in POINTS[script]]
    choice = found.get(word[0], word[1][0]) if word else ""
    if word and choice not in word[1]:
        raise InputError(f"{where}: {word[0]} = {choice!r} must be one of {', '.join(word[1])}")
    model = HandModel(**{key: numbers[key] for key in ("mass", "damping", "grip", "grip_damping")})
    info = DeviceInfo(
        name=spec.text,
        kind="virtual",
        force=numbers["force"],
        continuous_force=min(numbers["continuous"], numbers["force"]),
    )
    return VirtualDevice(_path(script, numbers, points, choice), model, info, int(numbers["buttons"]))


def _path(script: str, numbers: dict[str, float], points: list[Vec3], choice: str) -> Path3:
    """The path of a script."""
    x, y, z = points[0]
    if script == "hold":
        return lambda time: (x, y, z)
    if script == "line":
        u, v, w = points[1]
        duration = numbers["duration"]

        def _line(time: float) -> Vec3:
            part = min(time / duration, 1.0)
            return (x + part * (u - x), y + part * (v - y), z + part * (w - z))

        return _line
    if script == "circle":
        radius, turn = numbers["radius"], 2.0 * math.pi / numbers["period"]
        first, second = "xyz".index(choice[0]), "xyz".index(choice[1])

        def _circle(time: float) -> Vec3:
            at = [x, y, z]
            at[first] += radius * (math.cos(turn * time) - 1.0)  # starts at `at`, not a radius beside it
            at[second] += radius * math.sin(turn * time)
            return (at[0], at[1], at[2])

        return _circle
    amplitude, turn, axis = numbers["amplitude"], 2.0 * math.pi * numbers["frequency"], "xyz".index(choice)

    def sine(time: float) -> Vec3:
        at = [x, y, z]
        at[axis] += amplitude * math.sin(turn * time)
        return (at[0], at[1], at[2])

    return sine


def _point(where: str, key: str, text: str | None) -> Vec3:
    if text is None:
        return ZERO if key != "to" else (0.05, 0.0, 0.0)
    try:
        x, y, z = (float(part) for part in text.split("/"))
    except ValueError:
        x = y = z = math.nan
    if not max(abs(x), abs(y), abs(z)) <= 1.0 or math.isnan(x + y + z):
        raise InputError(f"{where}: {key} = {text} must be x/y/z in metres, each within ±1")
    return (x, y, z)
