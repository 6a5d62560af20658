"""What the servo did in every cycle, in a ring of shared memory: one producer that never waits, one consumer.

A cycle is one record of 8-byte little-endian fields (`CYCLE`), so that a batch of them is at once the body of a ROS 2
message (`otwarp.haptics.recording.messages`). With it, the chain of a hand can be run again on what it was given.

Memory ordering. The producer fills a slot and then raises `written`; the consumer copies the slots below `written` and
then raises `taken`. x86-64 keeps stores in order and loads in order. ARM may not: there a slot may be seen before it is
filled. So each slot ends in a CRC-32 of itself, seeded with its number, as in `core.mailbox`; the consumer
checks its copy and comes back later for a slot that is not whole. It raises `taken` only after that check, and a store
that depends on a branch is not moved before the loads that the branch tests, on ARM either.
"""

from __future__ import annotations

import os
import struct
import weakref
from multiprocessing.shared_memory import SharedMemory
from typing import NamedTuple
from zlib import crc32

from otwarp.errors import InputError
from otwarp.haptics.core.mailbox import _attach, _bytes_of, _let_go
from otwarp.haptics.core.types import Vec3

CYCLE = struct.Struct("<Q2d3d4Q4d3d3ddQ3d")
"""One cycle of a hand, in the order of `Cycle`."""
SECONDS = 8.0
"""What a ring holds at the servo's rate: a consumer that is away longer loses cycles, and is told how many."""

MAGIC, VERSION = b"otwarprg", 1
HEADER = struct.Struct("8s3Q")
"""Magic, version, bytes per record, slots."""
WRITTEN_AT, TAKEN_AT, LOST_AT, SLOTS_AT = 64, 128, 192, 256
"""The counters have cache lines of their own."""
_CRC = struct.Struct("Q")
_SLOT = CYCLE.size + _CRC.size
_SEED = 0xFFFFFFFF
LARGEST = 1 << 20
"""Most slots: a typing error otherwise reserves the machine's memory."""

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
    """One cycle of one hand.

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
        state: Index into `otwarp.haptics.core.mailbox.STATES`.
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
        out.append(Cycle(*v[:3], v[3:6], *v[6:14], v[14:17], v[17:20], v[20], v[21], v[22:25]))
    return out


def actions_of(word: int) -> tuple[int, ...]:
    """The actions of a cycle, in order; ends at the first that is 0."""
    found = []
    while word:
        found.append(word & (1 << ACTION_BITS) - 1)
        word >>= ACTION_BITS
    return tuple(found)


class Ring:
    """Records on their way from the servo (`push`) to its parent (`drain`).

    The creator owns the memory: its `close` removes the name. One process and thread may push, one may drain.
    """

    def __init__(self, memory: SharedMemory, slots: int, owner: bool):
        self.name, self.slots = memory.name, slots
        shared = _bytes_of(memory)
        counters = [shared[at : at + 8].cast("Q") for at in (WRITTEN_AT, TAKEN_AT, LOST_AT)]
        self._written, self._taken, self._lost = counters
        self._memory = shared[SLOTS_AT : SLOTS_AT + slots * _SLOT]
        self._let_go = weakref.finalize(self, _let_go, memory, (*counters, self._memory), os.getpid() * owner)
        self._staged = bytearray(_SLOT)
        self._body = memoryview(self._staged)[: CYCLE.size]
        self._next, self._read, self._doubted = self._written[0], self._taken[0], -1
        self.spoiled = 0
        """Records that never became whole, as seen by this consumer."""

    @classmethod
    def create(cls, slots: int) -> Ring:
        """A new ring under a fresh name (`name`).

        Raises:
            InputError: Slots out of range.
        """
        if not 1 <= slots <= LARGEST:
            raise InputError(f"slots = {slots!r}: must be from 1 to {LARGEST}")
        memory = SharedMemory(create=True, size=SLOTS_AT + slots * _SLOT)
        HEADER.pack_into(_bytes_of(memory), 0, MAGIC, VERSION, CYCLE.size, slots)
        return cls(memory, slots, owner=True)

    @classmethod
    def attach(cls, name: str) -> Ring:
        """The ring that another process created.

        Raises:
            InputError: There is none of that name, or it is none of this version.
        """
        try:
            memory = _attach(name)
        except (OSError, ValueError) as error:
            raise InputError(f"ring {name!r}: cannot be attached ({error}); is its creator running?") from None
        found = HEADER.unpack_from(_bytes_of(memory), 0) if memory.size >= HEADER.size else (b"", 0, 0, 0)
        slots = found[3]
        if found[:3] != (MAGIC, VERSION, CYCLE.size) or memory.size < SLOTS_AT + slots * _SLOT or not slots:
            memory.close()
            raise InputError(f"ring {name!r}: holds {found}, must hold {(MAGIC, VERSION, CYCLE.size)} and its slots")
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
        """Count a record that cannot be told."""
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

    def close(self) -> None:
        """Let go of the memory, and remove its name if this side created it; may be called more than once."""
        self._let_go()

    def __enter__(self) -> Ring:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
