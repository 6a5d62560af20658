"""Shared memory between two processes: a `Mailbox` for the latest value, a `Ring` for every cycle.

A mailbox is a seqlock: one writer, any readers. The writer makes the sequence number odd, copies the payload, makes it
even again. A reader copies the payload between two reads of the number and keeps the copy only if both were the same
even number (the seqlock of the Linux kernel; H.-J. Boehm, "Can seqlocks get along with programming language memory
models?", 2012, doi:10.1145/2247684.2247688).

Memory ordering. Sequence numbers are one aligned 8-byte store or load each, which x86-64 and ARMv8 do not tear. x86
keeps stores in order and loads in order, and the C compiler cannot move them across CPython's bytecodes, which call
opaque functions: there the double read suffices. ARM may reorder both, and no bytecode implies a barrier: there it does
not. So the payload ends in a CRC-32 of itself, seeded with its sequence number, and the reader checks the very copy
that it decodes: a mixture of two payloads passes with probability 2⁻³² per collision on any machine.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from multiprocessing.shared_memory import SharedMemory
from typing import Any, Generic, Protocol, TypeVar
from zlib import crc32

from otwarp.errors import InputError
from otwarp.haptics.core import CYCLE
from otwarp.haptics.core.named_memory import NamedMemory, attach_memory, bytes_of, create_memory

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
_CRC = struct.Struct("Q")
_SEED = 0xFFFFFFFF

SECONDS = 8.0
"""What a ring holds at the servo's rate: a consumer that is away longer loses cycles, and knows how many."""

RING_MAGIC, RING_VERSION = b"otwarprg", 1
RING_HEADER = struct.Struct("8s3Q")
"""Magic, version, bytes per record, slots."""
WRITTEN_AT, TAKEN_AT, LOST_AT, SLOTS_AT = 64, 128, 192, 256
"""The counters have cache lines of their own."""
_SLOT = CYCLE.size + _CRC.size
MOST_SLOTS = 1 << 20
"""Most slots: a typing error otherwise reserves the machine's memory."""


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


class Mailbox(NamedMemory, Generic[T]):
    """One value in shared memory: `write` on one side, `read` on the others.

    The creator owns the memory: its `close` removes the name. If it is killed, Python's resource tracker of the creator
    removes the name; those attached keep their mapping until they close it. Exactly one process and thread may write.
    """

    def __init__(self, layout: Layout[T], memory: SharedMemory, owner: bool):
        self.layout = layout
        size, shared = layout.size, bytes_of(memory)
        self._sequence = shared[SEQUENCE_AT : SEQUENCE_AT + 8].cast("Q")
        self._payload = shared[PAYLOAD_AT : PAYLOAD_AT + size + _CRC.size]
        super().__init__(memory, (self._sequence, self._payload), owner)
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
        """A new box under a fresh name (`name`), with nothing in it yet.

        Raises:
            InputError: There is no room for it.
        """
        memory = create_memory(f"the {layout.kind.decode()} mailbox", PAYLOAD_AT + layout.size + _CRC.size)
        HEADER.pack_into(bytes_of(memory), 0, MAGIC, VERSION, layout.size, *layout.capacities, layout.kind)
        return cls(layout, memory, owner=True)

    @classmethod
    def attach(cls, layout: Layout[T], name: str) -> Mailbox[T]:
        """The box that another process created.

        Raises:
            InputError: There is none of that name, or it has another version, kind or capacity.
        """
        memory = attach_memory("mailbox", name)
        need = PAYLOAD_AT + layout.size + _CRC.size
        wanted = (MAGIC, VERSION, layout.size, *layout.capacities, layout.kind.ljust(8, b"\0"))
        found = HEADER.unpack_from(bytes_of(memory), 0) if memory.size >= HEADER.size else None
        if found != wanted or memory.size < need:
            size = memory.size
            memory.close()
            raise InputError(
                f"mailbox {name!r}: holds {found or f'{size} bytes'}, must hold {wanted} "
                "(magic, version, payload bytes, capacities, kind) as its creator was asked"
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


class Ring(NamedMemory):
    """What a servo did in every cycle, on its way from the servo (`push`), which never waits, to its parent (`drain`).

    A record has 8-byte little-endian fields (`CYCLE`), so that a batch of them is at once the body of a ROS 2 message
    (`otwarp.haptics.recording`). With it, the chain of a hand can be run again on what it was given.

    Memory ordering. The producer fills a slot and then raises `written`; the consumer copies the slots below `written`
    and then raises `taken`. x86-64 keeps stores in order and loads in order. ARM may not: there a slot may be seen
    before it is filled. So each slot ends in a CRC-32 of itself, seeded with its number, as a mailbox does; the
    consumer checks its copy and comes back later for a slot that is not whole. It raises `taken` only after that check,
    and a store that depends on a branch is not moved before the loads that the branch tests, on ARM either.

    The creator owns the memory: its `close` removes the name. One process and thread may push, one may drain.
    """

    def __init__(self, memory: SharedMemory, slots: int, owner: bool):
        self.slots = slots
        shared = bytes_of(memory)
        counters = [shared[at : at + 8].cast("Q") for at in (WRITTEN_AT, TAKEN_AT, LOST_AT)]
        self._written, self._taken, self._lost = counters
        self._memory = shared[SLOTS_AT : SLOTS_AT + slots * _SLOT]
        super().__init__(memory, (*counters, self._memory), owner)
        self._staged = bytearray(_SLOT)
        self._body = memoryview(self._staged)[: CYCLE.size]
        self._next, self._read, self._doubted = self._written[0], self._taken[0], -1
        self.spoiled = 0
        """Records that never became whole, as seen by this consumer."""

    @classmethod
    def create(cls, slots: int) -> Ring:
        """A new ring under a fresh name (`name`).

        Raises:
            InputError: Slots out of range, or no room.
        """
        if not 1 <= slots <= MOST_SLOTS:
            raise InputError(f"slots = {slots!r}: must be from 1 to {MOST_SLOTS}")
        memory = create_memory(f"a ring of {slots} cycles", SLOTS_AT + slots * _SLOT)
        RING_HEADER.pack_into(bytes_of(memory), 0, RING_MAGIC, RING_VERSION, CYCLE.size, slots)
        return cls(memory, slots, owner=True)

    @classmethod
    def attach(cls, name: str) -> Ring:
        """The ring that another process created.

        Raises:
            InputError: There is none of that name, or it is none of this version.
        """
        memory = attach_memory("ring", name)
        found = RING_HEADER.unpack_from(bytes_of(memory), 0) if memory.size >= RING_HEADER.size else (b"", 0, 0, 0)
        slots = found[3]
        if found[:3] != (RING_MAGIC, RING_VERSION, CYCLE.size) or memory.size < SLOTS_AT + slots * _SLOT or not slots:
            memory.close()
            must = (RING_MAGIC, RING_VERSION, CYCLE.size)
            raise InputError(f"ring {name!r}: holds {found}, must hold {must} and its slots")
        return cls(memory, slots, owner=False)

    def push(self, values: tuple[float, ...]) -> bool:
        """Append a record of `CYCLE`'s fields; False, and counted, if the ring is full or a field does not fit."""
        n = self._next
        if n - self._taken[0] >= self.slots:
            self.miss()
            return False
        staged = self._staged
        try:
            CYCLE.pack_into(staged, 0, *values)
        except struct.error:
            self.miss()
            return False
        _CRC.pack_into(staged, CYCLE.size, crc32(self._body, n & _SEED))
        at = n % self.slots * _SLOT
        self._memory[at : at + _SLOT] = staged
        self._next = n + 1
        self._written[0] = n + 1
        return True

    def miss(self) -> None:
        """Count a record that does not fit."""
        self._lost[0] += 1

    def drain(self) -> bytes:
        """All whole records since the last call, one after another.

        Raises:
            InputError: The counters cannot be: something else wrote into the ring.
        """
        n, written = self._read, self._written[0]
        if not n <= written <= n + self.slots:
            raise InputError(f"ring {self.name!r}: {written} written with {n} taken; must be 0 to {self.slots} more")
        whole, memory = [], self._memory
        while n < written:
            at = n % self.slots * _SLOT
            slot = bytes(memory[at : at + _SLOT])
            body = slot[: CYCLE.size]
            if _CRC.unpack_from(slot, CYCLE.size)[0] == crc32(body, n & _SEED):
                whole.append(body)
            elif self._doubted == n:  # it had its time
                self.spoiled += 1
            else:
                self._doubted = n
                break
            n += 1
        self._read = n
        self._taken[0] = n
        return b"".join(whole)

    @property
    def lost(self) -> int:
        """Records that found the ring full or did not fit, plus those that never became whole."""
        return self._lost[0] + self.spoiled
