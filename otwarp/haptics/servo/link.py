"""What passes between the servo and its parent by shared memory: scenes and orders one way, forces and status back."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace

from otwarp.errors import InputError
from otwarp.haptics.chain.rendering import ChainLike
from otwarp.haptics.core import STATES, DeviceInfo, SceneFrame, ServoFrame, SphereFrame, TrapFrame
from otwarp.haptics.core.config import Gains
from otwarp.haptics.core.shared_memory import Mailbox, RecordLayout

TEXT = 160
"""Bytes of a line about one device."""
GRANTS = 480
"""Bytes of what the operating system gave."""
START, START_SPHERE, START_TRAP = 16384, 384, 512
"""Bytes for what a chain remembers, and for each sphere and trap of its scene: a number takes up to 24 of them."""
RUNS = ("starting", "running", "ending", "stopped", "failed")
"""What `ServoStatus.state` may be, in the order of their codes."""
LARGEST = 4096
"""Most spheres or traps that a box may be created for; a typing error otherwise reserves the machine's memory."""


_STATE_CODES = {name: code for code, name in enumerate(STATES)}


@dataclass(frozen=True, slots=True)
class Orders:
    """What the parent wants; the latest counts, so arming goes by counters: a missed message loses none.

    Attributes:
        beat: Counts orders; the servo disarms when it stands still.
        arm, disarm: How often each side was armed and disarmed.
        stop: Whether to end.
        gains: Motion gain [µm/m] and force gain [N/pN] of each side, None for as configured; empty for all so.
        recording: Number of the one that runs, 0 for none.
    """

    beat: int
    arm: tuple[int, ...]
    disarm: tuple[int, ...]
    stop: bool = False
    gains: tuple[Gains, ...] = ()
    recording: int = 0

    def next(self, *, arm: int | None = None, disarm: int | None = None, stop: bool = False) -> Orders:
        """The next orders: one more beat, and a side armed or disarmed; all else as it was."""
        return replace(
            self,
            beat=self.beat + 1,
            arm=tuple(n + (i == arm) for i, n in enumerate(self.arm)),
            disarm=tuple(n + (i == disarm) for i, n in enumerate(self.disarm)),
            stop=self.stop or stop,
        )


@dataclass(frozen=True, slots=True)
class HandStatus:
    """How a device is.

    Attributes:
        present: Whether it answers.
        losses: How often it stopped answering.
        message: One line about the last thing that went wrong or right, empty if nothing did.
    """

    present: bool = False
    losses: int = 0
    message: str = ""


@dataclass(frozen=True, slots=True)
class ServoStatus:
    """How the servo is.

    Attributes:
        tick: Counts cycles; one that stands still means a servo that stands still.
        time: On its clock [s].
        state: `starting`, `running`, `ending`, `stopped` or `failed`.
        late: Deadlines that were dropped because a cycle took too long or woke too late.
        lateness: Worst wake after a deadline within the last second [s].
        refused: States of the simulation that were not finite.
        torn: Reads given up because the writer was in the way.
        hands: Each hand's device.
        grants: What the operating system gave, or why the servo failed.
    """

    tick: int
    time: float
    state: str
    late: int
    lateness: float
    refused: int
    torn: int
    hands: tuple[HandStatus, ...]
    grants: str = ""


class OrdersLayout:
    """`Orders` in a mailbox, for one or two sides; a gain that is as configured is NaN."""

    kind = b"orders"

    def __init__(self, hands: int):
        self._record = RecordLayout(self.kind, f"3Q{2 * hands}Q{2 * hands}d")
        self._hands = hands
        self.capacities, self.size = (hands, 0), self._record.size

    def pack(self, buffer: bytearray, value: Orders) -> None:
        """See `shared_memory.Layout`."""
        gains = value.gains or ((None, None),) * self._hands
        flat = [math.nan if gain is None else gain for pair in gains for gain in pair]
        self._record.pack(buffer, (value.beat, value.stop, value.recording, *value.arm, *value.disarm, *flat))

    def unpack(self, buffer: bytearray) -> Orders:
        """See `shared_memory.Layout`."""
        n = self._hands
        beat, stop, recording, *rest = self._record.unpack(buffer)
        flat = [None if gain != gain else gain for gain in rest[2 * n :]]
        gains = tuple(zip(flat[::2], flat[1::2], strict=True)) if any(gain is not None for gain in flat) else ()
        return Orders(beat, tuple(rest[:n]), tuple(rest[n : 2 * n]), bool(stop), gains, recording)


@dataclass(frozen=True, slots=True)
class Start:
    """What a chain remembered when a recording began.

    Attributes:
        recording: Its number.
        tick: Its first cycle.
        text: `Rendering.state` as JSON; "" if it was too long for its mailbox.
    """

    recording: int
    tick: int
    text: str


@dataclass(frozen=True, slots=True)
class Cycles:
    """What came out of a ring, see `cycles.CycleReader.drain`.

    Attributes:
        records: `ring.CYCLE`, one after another; `ring.cycles_of` reads them.
        lost: How many of this recording are missing so far, because they were not fetched in time.
        start: What the chain remembered before the first record of this recording; None until it is known.
        scenes: States published since any hand's were fetched, beginning with the one before the recording.
    """

    records: bytes = b""
    lost: int = 0
    start: Start | None = None
    scenes: tuple[SceneFrame, ...] = ()


class StartLayout:
    """`Start` in a mailbox.

    Args:
        spheres, traps: Most that a scene may hold; they are part of what is remembered.
    """

    kind = b"start"

    def __init__(self, spheres: int, traps: int):
        self._room = START + START_SPHERE * spheres + START_TRAP * traps
        self._record = RecordLayout(self.kind, f"3Q{self._room}s")
        self.capacities, self.size = (spheres, traps), self._record.size

    def pack(self, buffer: bytearray, value: Start) -> None:
        """See `shared_memory.Layout`."""
        data = value.text.encode()
        if len(data) > self._room:
            raise InputError(f"start of a recording: {len(data)} bytes; must be at most {self._room}")
        self._record.pack(buffer, (value.recording, value.tick, len(data), data))

    def unpack(self, buffer: bytearray) -> Start:
        """See `shared_memory.Layout`."""
        recording, tick, size, data = self._record.unpack(buffer)
        return Start(recording, tick, data[:size].decode())


class StatusLayout:
    """`ServoStatus` in a mailbox, for one or two sides."""

    kind = b"status"

    def __init__(self, hands: int):
        self._record = RecordLayout(self.kind, f"QdQQdQQ{GRANTS}s" + f"QQ{TEXT}s" * hands)
        self.capacities, self.size = (hands, 0), self._record.size

    def pack(self, buffer: bytearray, value: ServoStatus) -> None:
        """See `shared_memory.Layout`."""
        head = (value.tick, value.time, RUNS.index(value.state), value.late, value.lateness, value.refused, value.torn)
        flat: list[float | bytes] = [*head, cut(value.grants, GRANTS)]
        for hand in value.hands:
            flat += (hand.present, hand.losses, cut(hand.message, TEXT))
        self._record.pack(buffer, flat)

    def unpack(self, buffer: bytearray) -> ServoStatus:
        """See `shared_memory.Layout`."""
        tick, time, state, late, lateness, refused, torn, grants, *rest = self._record.unpack(buffer)
        rows = zip(rest[::3], rest[1::3], rest[2::3], strict=True)
        hands = tuple(HandStatus(bool(present), losses, text_of(message)) for present, losses, message in rows)
        return ServoStatus(tick, time, RUNS[state], late, lateness, refused, torn, hands, text_of(grants))


def cut(text: str, size: int) -> bytes:
    """A line as UTF-8 of at most `size` bytes."""
    return " ".join(text.split()).encode()[:size]


def text_of(data: bytes) -> str:
    """The line that `cut` made, without the zeros behind it and without half a character at its end."""
    return data.rstrip(b"\0").decode(errors="ignore")


def _capacity(argument: str, value: int) -> int:
    if not isinstance(value, int) or not 0 <= value <= LARGEST:
        raise InputError(f"{argument} = {value!r}: must be a whole number from 0 to {LARGEST}")
    return value


def _fits(what: str, count: int, capacity: int) -> None:
    if count > capacity:
        raise InputError(f"{what} = {count}: this mailbox was created for at most {capacity}")


class SceneLayout:
    """`SceneFrame`: beat, time, contact force, counts, then traps (index, x, y, z, power) and spheres (body, x, y, z).

    Args:
        spheres: Most trapped spheres that a state may hold.
        traps: Most traps.
    """

    kind = b"scene"

    def __init__(self, spheres: int, traps: int):
        self.capacities = (_capacity("spheres", spheres), _capacity("traps", traps))
        self._head = struct.Struct("Qdd2Q")
        self.size = self._head.size + 40 * traps + 32 * spheres
        self._bodies: dict[tuple[int, int], struct.Struct] = {}

    def _body(self, traps: int, spheres: int) -> struct.Struct:
        """Layout of that many traps and spheres; made once per count."""
        key = (traps, spheres)
        body = self._bodies.get(key)
        if body is None:
            body = self._bodies[key] = struct.Struct("q4d" * traps + "q3d" * spheres)
        return body

    def pack(self, buffer: bytearray, value: SceneFrame) -> None:
        """See `shared_memory.Layout`."""
        traps, spheres = value.traps, value.spheres
        _fits("traps", len(traps), self.capacities[1])
        _fits("spheres", len(spheres), self.capacities[0])
        flat: list[float] = []
        for trap in traps:
            flat += (trap.index, *trap.position, trap.power)
        for sphere in spheres:
            flat += (sphere.body, *sphere.position)
        try:
            self._body(len(traps), len(spheres)).pack_into(buffer, self._head.size, *flat)
            self._head.pack_into(buffer, 0, value.beat, value.time, value.contact_force, len(traps), len(spheres))
        except struct.error as error:
            raise InputError(f"scene state {value}: {error}; numbers must be reals, beat and indices whole") from None

    def unpack(self, buffer: bytearray) -> SceneFrame:
        """See `shared_memory.Layout`."""
        beat, time, contact, n_traps, n_spheres = self._head.unpack_from(buffer, 0)
        flat = self._body(n_traps, n_spheres).unpack_from(buffer, self._head.size)
        edge = 5 * n_traps
        rows = zip(*[iter(flat[:edge])] * 5, strict=True)
        traps = tuple([TrapFrame(i, (x, y, z), power) for i, x, y, z, power in rows])
        balls = zip(*[iter(flat[edge:])] * 4, strict=True)
        spheres = tuple([SphereFrame((x, y, z), body) for body, x, y, z in balls])
        return SceneFrame(beat, time, spheres, traps, contact)


class HandLayout:
    """`ServoFrame`: tick, time, position, force, energy, state, buttons, count, then traps (index, x, y, z).

    Args:
        traps: Most traps that the hand may command.
    """

    kind = b"hand"

    def __init__(self, traps: int):
        self.capacities: tuple[int, int] = (0, _capacity("traps", traps))
        self._head = struct.Struct("Q8d3Q")
        self.size = self._head.size + 32 * traps
        self._trap = struct.Struct("q3d")

    def pack(self, buffer: bytearray, value: ServoFrame) -> None:
        """See `shared_memory.Layout`."""
        _fits("traps of a hand", len(value.traps), self.capacities[1])
        state = _STATE_CODES.get(value.state)
        if state is None:
            raise InputError(f"state = {value.state!r}: must be one of {', '.join(STATES)}")
        moving = (value.time, *value.position, *value.force, value.energy)
        try:
            self._head.pack_into(buffer, 0, value.tick, *moving, state, value.buttons, len(value.traps))
            at = self._head.size
            for index, position in value.traps:
                self._trap.pack_into(buffer, at, index, *position)
                at += 32
        except struct.error as error:
            raise InputError(f"hand state {value}: {error}; numbers must be reals, tick and indices whole") from None

    def unpack(self, buffer: bytearray) -> ServoFrame:
        """See `shared_memory.Layout`."""
        tick, time, x, y, z, fx, fy, fz, energy, state, buttons, n = self._head.unpack_from(buffer, 0)
        traps = []
        for at in range(self._head.size, self._head.size + 32 * n, 32):
            index, px, py, pz = self._trap.unpack_from(buffer, at)
            traps.append((index, (px, py, pz)))
        return ServoFrame(tick, time, (x, y, z), (fx, fy, fz), tuple(traps), STATES[state], energy, buttons)


class SceneReader:
    """The latest state of the simulation that can be trusted, for a servo that has one at any time.

    A state with a number that is not finite is refused: the beat that the chains see then stands still, and their
    watchdogs do what they do for a simulation that stalled.
    """

    def __init__(self, box: Mailbox[SceneFrame]):
        self._box = box
        self.scene = SceneFrame(0, 0.0, (), ())
        self.refused = 0
        """States that were not finite."""

    @property
    def torn(self) -> int:
        """Reads given up, see `Mailbox.read`."""
        return self._box.torn

    def latest(self) -> SceneFrame:
        """The newest finite state; the same object as before when there is none newer, beat 0 before the first."""
        new = self._box.read()
        if new is not None:
            if is_finite(new):
                self.scene = new
            else:
                self.refused += 1
        return self.scene


def is_finite(scene: SceneFrame) -> bool:
    """Whether every number of a state is finite: sums keep NaN and infinity, and one test costs less than a hundred."""
    total = scene.time + scene.contact_force
    for sphere in scene.spheres:
        x, y, z = sphere.position
        total += x + y + z
    for trap in scene.traps:
        x, y, z = trap.position
        total += x + y + z + trap.power
    return math.isfinite(total)


@dataclass(frozen=True, slots=True)
class HandSetup:
    """One side as its parent wants it.

    Attributes:
        device: Such as `virtual:circle`, see `otwarp.haptics.devices`.
        chain: Makes the chain for a device; pickled by reference, so a function of a module, or a `functools.partial`
            of one with plain arguments.
        pointer: Name of the page's mailbox, for `mouse`.
        name: `left` or `right`; a recording that is replayed holds devices by name.
    """

    device: str
    chain: Callable[[DeviceInfo], ChainLike]
    pointer: str | None = None
    name: str | None = None
