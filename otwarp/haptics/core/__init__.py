"""What the rooms of haptics tell each other: samples, the scene, what the servo commands, the record of a cycle.

Device side in SI units (m, s, N), scene side in µm, s, mW, pN. Vectors are tuples of three floats: the servo makes a
few hundred of them per millisecond, and NumPy's overhead per call would cost more than the arithmetic. Beside these,
which are here, the rooms share (open fields first):

config, fields   every number that shapes a force, with its range; presets; the way to JSON and back
realtime         clocks, and what the operating system grants a punctual loop
named_memory     pieces of shared memory, all of whose pages are there
shared_memory    `Mailbox` for the latest value, `Ring` for every cycle
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

from otwarp.errors import InputError

Vec3 = tuple[float, float, float]
ZERO: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceInfo:
    """What a device can do.

    Attributes:
        name: Which one, as the user named it.
        kind: Its row in `otwarp.haptics.devices.KINDS`.
        force: Largest force that it renders [N]; 0 for one that renders none.
        continuous_force: Force that it can hold for ever [N].
        absolute: Whether `DeviceSample.position` is a place of the hand; else it is the integral of a rate.
    """

    name: str
    kind: str
    force: float = 0.0
    continuous_force: float = 0.0
    absolute: bool = True


@dataclass(frozen=True, slots=True)
class DeviceSample:
    """What a device says at one time.

    Attributes:
        time: On the servo's clock [s].
        position: Of the hand, in the device's frame [m].
        buttons: Bit 0 the dead-man switch, bit 1 the clutch, others as the device has them.
        fresh: Whether the device spoke since the last sample.
    """

    time: float
    position: Vec3
    buttons: int = 0
    fresh: bool = True


@runtime_checkable
class Device(Protocol):
    """A haptic or a mere input device; all calls come from one thread, `read` and `write` never block."""

    @property
    def info(self) -> DeviceInfo:
        """What the device can do: its rate, force and buttons; known once it is open."""
        ...

    def open(self) -> None:
        """Find it and start it.

        Raises:
            InputError: It is not there, or may not be used; one line.
        """
        ...

    def read(self, time: float) -> DeviceSample:
        """The latest sample.

        Raises:
            DeviceLost: It is gone; `open` may bring it back.
        """
        ...

    def write(self, force: Vec3) -> None:
        """Render a force [N] in the device's frame; devices without motors ignore it.

        Raises:
            DeviceLost: It is gone.
        """
        ...

    def close(self) -> None:
        """Stop rendering and let go of it; may be called at any time, more than once."""
        ...


class ZeroForce(Protocol):
    """What sends zero force to a device in place of the servo that drove it; made while the servo drives it.

    A device whose driver goes on rendering without the servo (`devices.Kind.keeps`) has an `address`, a text, and its
    module `zero_force(address)`, which returns this. Both run in the guardian, a process of its own.
    """

    def send(self) -> None:
        """Zero force; may wait, and is called again and again.

        Raises:
            Exception: It could not be sent; one line.
        """
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class DeviceLost(Exception):
    """A device that was open does not answer any more."""


@dataclass(frozen=True, slots=True)
class TrapFrame:
    """A trap as it is: its index in the scene, focus [µm], power [mW]."""

    index: int
    position: Vec3
    power: float


@dataclass(frozen=True, slots=True)
class SphereFrame:
    """A trapped sphere as the simulation last reported it: centre [µm], and the index of its body."""

    position: Vec3
    body: int


@dataclass(frozen=True, slots=True)
class SceneFrame:
    """What the simulation last published.

    Attributes:
        beat: Counts published states; one that stands still means a simulation that stands still.
        time: Simulated time [s].
        spheres: Trapped spheres.
        traps: All traps, as the simulation has them.
        contact_force: Largest contact force on any body [pN], for warnings.
    """

    beat: int
    time: float
    spheres: tuple[SphereFrame, ...]
    traps: tuple[TrapFrame, ...]
    contact_force: float = 0.0


@dataclass(frozen=True, slots=True)
class ServoFrame:
    """What the servo publishes of one side.

    Attributes:
        tick: Counts servo cycles.
        time: On the servo's clock [s].
        position: Of the hand, device frame [m].
        force: Commanded, device frame [N].
        traps: Positions that the hand commands, by trap index [µm].
        state: `disarmed`, `ramping`, `armed`, `decaying`, or `fault`.
        energy: What the passivity observer has counted [J].
        buttons: As the device has them.
    """

    tick: int
    time: float
    position: Vec3
    force: Vec3
    traps: tuple[tuple[int, Vec3], ...]
    state: str
    energy: float
    buttons: int = 0


STATES = ("disarmed", "ramping", "armed", "decaying", "fault")
"""What `ServoFrame.state` may be, in the order of their codes."""

CYCLE = struct.Struct("<Q2d3d4Q4d3d3ddQ3d")
"""One cycle of one side, in the order of `Cycle`."""
ARMED, DISARMED, SILENT, ENDING, GAINS, MADE = 1, 2, 3, 4, 5, 6
ACTIONS = {
    ARMED: "armed",
    DISARMED: "disarmed by order",
    SILENT: "disarmed, no orders were heard",
    ENDING: "disarmed, the servo ends",
    GAINS: "gains set",
    MADE: "chain made anew",
}
"""What may happen to a chain before a step; `Cycle.actions` holds up to 16, four bits each, the first lowest."""
ACTION_BITS, MOST_ACTIONS = 4, 16

SAMPLED, FRESH, STEPPED, FAILED, LOST, BACK, PRESENT, ABSOLUTE = (1 << n for n in range(8))
"""Bits of `Cycle.flags`: the device gave a sample; a fresh one; the chain was stepped; it raised or its numbers were
not finite; the device was lost in this cycle; it came back in this cycle; it is there at its end; it tells places, not
rates."""


class Cycle(NamedTuple):
    """One cycle of one side.

    Attributes:
        tick: Counts the cycles of the servo.
        time: On the servo's clock, when the cycle began [s].
        sample_time: The device's word for when its sample was taken [s].
        position: Of the hand, device frame [m].
        buttons: As the device has them.
        flags: Bits `SAMPLED` to `ABSOLUTE`.
        beat: Of the simulation's state that was used.
        actions: What happened to the chain before its step, see `actions_of`.
        motion_gain, force_gain: Set by order, nan for as configured [µm/m, N/pN].
        limit, continuous: Largest force of the device, and what it can hold for ever [N].
        force: Sent [N].
        asked: What the chain asked of safety [N].
        energy: What the passivity observer has counted [J].
        state: Index into `STATES`.
        moved: How far the traps are commanded from where the hand took hold of them [µm].
    """

    tick: int
    time: float
    sample_time: float
    position: Vec3
    buttons: int
    flags: int
    beat: int
    actions: int
    motion_gain: float
    force_gain: float
    limit: float
    continuous: float
    force: Vec3
    asked: Vec3
    energy: float
    state: int
    moved: Vec3


def cycles_of(records: bytes) -> list[Cycle]:
    """The cycles of a batch.

    Raises:
        InputError: It is no whole number of records.
    """
    if len(records) % CYCLE.size:
        raise InputError(f"cycles: {len(records)} bytes; must be a multiple of {CYCLE.size}")
    out = []
    for v in CYCLE.iter_unpack(records):
        fields: tuple[Any, ...] = (*v[:3], v[3:6], *v[6:14], v[14:17], v[17:20], v[20], v[21], v[22:25])
        out.append(Cycle(*fields))
    return out


def actions_of(word: int) -> tuple[int, ...]:
    """The actions of a cycle, in order; ends at the first that is 0."""
    found = []
    while word:
        found.append(word & (1 << ACTION_BITS) - 1)
        word >>= ACTION_BITS
    return tuple(found)


def as_tuples(value: Any) -> Any:
    """Lists as tuples, to any depth: what JSON makes of a tuple, undone."""
    return tuple(as_tuples(item) for item in value) if isinstance(value, list | tuple) else value


def scene_to_list(scene: SceneFrame) -> list[Any]:
    """A state of the simulation as plain lists, for JSON."""
    traps = [(trap.index, trap.position, trap.power) for trap in scene.traps]
    spheres = [(sphere.position, sphere.body) for sphere in scene.spheres]
    return [scene.beat, scene.time, spheres, traps, scene.contact_force]


def scene_from_list(data: Any) -> SceneFrame:
    """The state that `scene_to_list` wrote, also after JSON has made lists of its tuples, bit for bit."""
    beat, time, spheres, traps, contact = data
    balls = tuple(SphereFrame(as_tuples(position), body) for position, body in spheres)
    return SceneFrame(beat, time, balls, tuple(TrapFrame(n, as_tuples(p), power) for n, p, power in traps), contact)
