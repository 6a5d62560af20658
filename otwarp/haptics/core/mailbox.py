"""One writer, any readers, the latest value: a seqlock over shared memory, with fixed layouts.

The writer makes the sequence number odd, copies the payload, makes it even again. A reader copies the payload between
two reads of the number and keeps the copy only if both were the same even number (the seqlock of the Linux kernel;
H.-J. Boehm, "Can seqlocks get along with programming language memory models?", 2012, doi:10.1145/2247684.2247688).

Memory ordering. Sequence numbers are one aligned 8-byte store or load each, which x86-64 and ARMv8 do not tear. x86
keeps stores in order and loads in order, and the C compiler cannot move them across CPython's bytecodes, which call
opaque functions: there the double read suffices. ARM may reorder both, and no bytecode implies a barrier: there it does
not. So the payload ends in a CRC-32 of itself, seeded with its sequence number, and the reader checks the very copy
that it decodes: a mixture of two payloads passes with probability 2⁻³² per collision on any machine.
"""

from __future__ import annotations

import os
import struct
import sys
import threading
import weakref
from collections.abc import Iterable
from contextlib import suppress
from math import isfinite
from multiprocessing import resource_tracker
from multiprocessing.shared_memory import SharedMemory
from typing import Any, Generic, Protocol, TypeVar
from zlib import crc32

from otwarp.errors import InputError
from otwarp.haptics.core.types import SceneFrame, ServoFrame, SphereFrame, TrapFrame

T = TypeVar("T")

MAGIC = b"otwarpmb"
VERSION = 1
HEADER = struct.Struct("8s4Q8s")
"""Magic, version, payload bytes, two capacities, kind. Little or big end as the machine: both sides are on one."""
SEQUENCE_AT = 64
"""The sequence number has a cache line of its own."""
PAYLOAD_AT = 128
RETRIES = 16
"""Reads that a writer may spoil before a reader goes without: it writes for 0.3 µs, a retry takes about 1 µs."""
LARGEST = 4096
"""Most spheres or traps that a box may be created for; a typing error otherwise reserves the machine's memory."""
STATES = ("disarmed", "ramping", "armed", "decaying", "fault")
"""What `ServoFrame.state` may be, in the order of their codes."""

_STATE_CODES = {name: code for code, name in enumerate(STATES)}
_CRC = struct.Struct("Q")
_SEED = 0xFFFFFFFF
_attach_lock = threading.Lock()


class Layout(Protocol[T]):
    """How a value lies in memory. `kind` has at most 8 bytes, `size` is a multiple of 8."""

    kind: bytes
    size: int
    capacities: tuple[int, int]

    def pack(self, buffer: bytearray, value: T) -> None:
        """Write `value` at the front of `buffer`; one InputError if it does not fit."""
        ...

    def unpack(self, buffer: bytearray) -> T:
        """The value at the front of `buffer`."""
        ...


class Mailbox(Generic[T]):
    """One value in shared memory: `write` on one side, `read` on the others.

    The creator owns the memory: its `close` removes the name. If it is killed, Python's resource tracker of the creator
    removes the name; those attached keep their mapping until they close it. Exactly one process and thread may write.
    """

    def __init__(self, layout: Layout[T], memory: SharedMemory, owner: bool):
        self.layout = layout
        self.name = memory.name
        size, shared = layout.size, _bytes_of(memory)
        self._sequence = shared[SEQUENCE_AT : SEQUENCE_AT + 8].cast("Q")
        self._payload = shared[PAYLOAD_AT : PAYLOAD_AT + size + _CRC.size]
        # also at exit, before Python takes its modules apart
        self._let_go = weakref.finalize(self, _let_go, memory, (self._sequence, self._payload), os.getpid() * owner)
        self._staged = bytearray(size + _CRC.size)
        self._staged_body = memoryview(self._staged)[:size]
        self._copy = bytearray(size + _CRC.size)
        self._copy_body = memoryview(self._copy)[:size]
        self._next = self._sequence[0] + 1 & ~1  # a writer that was killed in mid-write left an odd number
        self._seen = 0
        self.torn = 0
        """Reads given up because the writer was in the way each time."""

    @classmethod
    def create(cls, layout: Layout[T]) -> Mailbox[T]:
        """A new box under a fresh name (`name`), with nothing in it yet."""
        memory = SharedMemory(create=True, size=PAYLOAD_AT + layout.size + _CRC.size)
        HEADER.pack_into(_bytes_of(memory), 0, MAGIC, VERSION, layout.size, *layout.capacities, layout.kind)
        return cls(layout, memory, owner=True)

    @classmethod
    def attach(cls, layout: Layout[T], name: str) -> Mailbox[T]:
        """The box that another process created.

        Raises:
            InputError: There is none of that name, or it has another version, kind or capacity.
        """
        try:
            memory = _attach(name)
        except (OSError, ValueError) as error:
            raise InputError(f"mailbox {name!r}: cannot be attached ({error}); is its creator running?") from None
        need = PAYLOAD_AT + layout.size + _CRC.size
        wanted = (MAGIC, VERSION, layout.size, *layout.capacities, layout.kind.ljust(8, b"\0"))
        found = HEADER.unpack_from(_bytes_of(memory), 0) if memory.size >= HEADER.size else None
        if found != wanted or memory.size < need:
            size = memory.size
            memory.close()
            raise InputError(
                f"mailbox {name!r}: holds {found or f'{size} bytes'}, must hold {wanted} "
                "(magic, version, payload bytes, capacities, kind) as its creator was told"
            )
        return cls(layout, memory, owner=False)

    def write(self, value: T) -> None:
        """Publish `value`; readers see the old one or this one, never a mixture.

        Raises:
            InputError: It does not fit the layout; what was published before stays.
        """
        staged = self._staged
        self.layout.pack(staged, value)
        after = self._next + 2
        _CRC.pack_into(staged, self.layout.size, crc32(self._staged_body, after & _SEED))
        self._sequence[0] = after - 1
        self._payload[:] = staged
        self._sequence[0] = after
        self._next = after

    def read(self) -> T | None:
        """The latest value if it is new to this reader, else None.

        None as well if the writer was in the way `RETRIES` times (counted in `torn`): a writer that was killed in
        mid-write looks like one that stands still, and a reader never waits.
        """
        sequence, copy = self._sequence, self._copy
        for _ in range(RETRIES):
            before = sequence[0]
            if before == self._seen:
                return None
            if before & 1:
                continue
            copy[:] = self._payload
            if sequence[0] != before:
                continue
            if _CRC.unpack_from(copy, self.layout.size)[0] == crc32(self._copy_body, before & _SEED):
                self._seen = before
                return self.layout.unpack(copy)
        self.torn += 1
        return None

    def close(self) -> None:
        """Let go of the memory, and remove its name if this side created it; may be called more than once."""
        self._let_go()

    def __enter__(self) -> Mailbox[T]:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _bytes_of(memory: SharedMemory) -> memoryview:
    shared = memory.buf
    if shared is None:
        raise InputError(f"mailbox {memory.name!r}: its memory was closed")
    return shared


def _let_go(memory: SharedMemory, views: tuple[memoryview, ...], owner: int) -> None:
    """Unmap; remove the name if this process (not a fork of it) is the owner."""
    for view in views:
        view.release()
    memory.close()
    if owner == os.getpid():
        with suppress(FileNotFoundError):
            memory.unlink()


def _attach(name: str) -> SharedMemory:
    """Shared memory of another process, unknown to this process's resource tracker.

    Python 3.11 registers what it attaches; the tracker of an unrelated process would then remove the name when that
    process ends, under the feet of the owner (python/cpython#82300; `track=False` exists from 3.13).
    """
    if sys.version_info >= (3, 13):
        return SharedMemory(name, track=False)
    register = resource_tracker.register

    def skip(tracked: str, rtype: str) -> None:
        if tracked.lstrip("/") != name:
            register(tracked, rtype)  # another thread creates one meanwhile

    with _attach_lock:
        resource_tracker.register = skip
        try:
            return SharedMemory(name)
        finally:
            resource_tracker.register = register


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
        """See `Layout`."""
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
        """See `Layout`."""
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
        self.capacities = (0, _capacity("traps", traps))
        self._head = struct.Struct("Q8d3Q")
        self.size = self._head.size + 32 * traps
        self._trap = struct.Struct("q3d")

    def pack(self, buffer: bytearray, value: ServoFrame) -> None:
        """See `Layout`."""
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
        """See `Layout`."""
        tick, time, x, y, z, fx, fy, fz, energy, state, buttons, n = self._head.unpack_from(buffer, 0)
        traps = []
        for at in range(self._head.size, self._head.size + 32 * n, 32):
            index, px, py, pz = self._trap.unpack_from(buffer, at)
            traps.append((index, (px, py, pz)))
        return ServoFrame(tick, time, (x, y, z), (fx, fy, fz), tuple(traps), STATES[state], energy, buttons)


class RecordLayout:
    """A tuple of numbers or bytes by a `struct` format of 8-byte fields and `s` fields.

    Args:
        kind: At most 8 bytes that name what it holds.
        fields: Native `struct` format.
    """

    def __init__(self, kind: bytes, fields: str):
        self.kind, self.capacities = kind, (0, 0)
        self._struct = struct.Struct(fields)
        self.size = -(-self._struct.size // 8) * 8

    def pack(self, buffer: bytearray, value: Iterable[Any]) -> None:
        """See `Layout`."""
        try:
            self._struct.pack_into(buffer, 0, *value)
        except struct.error as error:
            raise InputError(f"{self.kind.decode()} message {value!r}: {error}") from None

    def unpack(self, buffer: bytearray) -> tuple[Any, ...]:
        """See `Layout`."""
        return self._struct.unpack_from(buffer, 0)


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
    return isfinite(total)
