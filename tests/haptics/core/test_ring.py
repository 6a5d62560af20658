"""The ring: every record once and whole, in order; what does not fit is counted."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core import ARMED, CYCLE, DISARMED, GAINS, actions_of, cycles_of
from otwarp.haptics.core.shared_memory import LOST_AT, SLOTS_AT, TAKEN_AT, WRITTEN_AT, Ring


def record(tick: int) -> tuple[float, ...]:
    """A record of which every field says where it is."""
    return tuple(tick if k == 0 else k if k in (6, 7, 8, 9, 21) else 100.0 * tick + k for k in range(25))


def ticks(data: bytes) -> list[int]:
    return [cycle.tick for cycle in cycles_of(data)]


@pytest.fixture
def pair():
    with Ring.create(8) as parent, Ring.attach(parent.name) as servo:
        yield servo, parent


def test_fields_arrive_as_they_are_named(pair):
    servo, parent = pair
    assert servo.push(record(3))
    (cycle,) = cycles_of(parent.drain())
    flat = []
    for value in cycle:
        flat += value if isinstance(value, tuple) else (value,)
    assert tuple(flat) == record(3)
    assert (cycle.position, cycle.buttons, cycle.state) == ((303.0, 304.0, 305.0), 6, 21)
    assert parent.drain() == b""


@given(plan=st.lists(st.integers(0, 12), max_size=30))
@settings(max_examples=60, deadline=None)
def test_whatever_comes_between_each_record_comes_once_in_order_or_is_counted(plan):
    with Ring.create(8) as parent, Ring.attach(parent.name) as servo:
        pushed, got, refused = 0, [], 0
        for count in plan:
            for _ in range(count):
                pushed += 1
                refused += not servo.push(record(pushed))
            got += ticks(parent.drain())
        assert got == sorted(set(got))
        assert len(got) + refused == pushed
        assert parent.lost == servo.lost == refused == sum(max(0, count - 8) for count in plan)


@pytest.mark.parametrize(
    "bad", [(), (1.0,) * 24, (*record(1), 0.0), (-1, *record(1)[1:]), (*record(1)[:6], 2**64, *record(1)[7:])]
)
def test_what_is_no_record_is_counted_and_stops_nothing(pair, bad):
    servo, parent = pair
    assert not servo.push(bad)
    assert servo.push(record(2))
    assert (ticks(parent.drain()), parent.lost) == ([2], 1)


def test_a_slot_that_is_not_whole_yet_waits_and_then_counts_as_lost(pair):
    servo, parent = pair
    for tick in (1, 2, 3):
        servo.push(record(tick))
    at = CYCLE.size + 8 + 40  # in the second slot, as if a store came late
    whole = servo._memory[at]
    servo._memory[at] = whole ^ 1
    assert ticks(parent.drain()) == [1]
    servo._memory[at] = whole
    assert (ticks(parent.drain()), parent.lost) == ([2, 3], 0)
    servo.push(record(4))
    servo.push(record(5))
    servo._memory[3 * (CYCLE.size + 8) + 40] ^= 1
    assert ticks(parent.drain()) == []
    assert (ticks(parent.drain()), parent.lost) == ([5], 1)


def test_records_of_an_earlier_lap_are_not_taken_for_new_ones(pair):
    servo, parent = pair
    for tick in range(8):
        servo.push(record(tick))
    assert len(ticks(parent.drain())) == 8
    servo._written[0] += 1  # a count that is seen before its slot
    assert parent.drain() == b""


@given(data=st.data(), noise=st.binary(min_size=1, max_size=400))
@settings(max_examples=150, deadline=None)
def test_no_bytes_in_the_memory_do_more_than_raise_one_line(data, noise):
    with Ring.create(4) as parent, Ring.attach(parent.name) as servo:
        for tick in range(3):
            servo.push(record(tick))
        memory = parent._let_go.peek()[2][0].buf
        at = data.draw(st.sampled_from([WRITTEN_AT, TAKEN_AT, LOST_AT, SLOTS_AT, SLOTS_AT + CYCLE.size]))
        memory[at : at + len(noise)] = noise[: len(memory) - at]
        try:
            got = [ticks(parent.drain()) for _ in range(6)]
        except InputError as error:
            assert "\n" not in str(error)
        else:
            # never a record that was not pushed
            assert [tick for part in got for tick in part] == sorted(
                {tick for part in got for tick in part} & {0, 1, 2}
            )
        servo.push(record(9))


def test_rings_that_cannot_be_are_refused():
    for slots in (0, -1, 1 << 30):
        with pytest.raises(InputError, match=r"slots = .* must be from 1 to"):
            Ring.create(slots)
    with pytest.raises(InputError, match="cannot be attached"):
        Ring.attach("otwarp_no_such_ring")
    with Ring.create(2) as ring:
        memory = ring._let_go.peek()[2][0].buf
        memory[8:16] = struct.pack("Q", 99)
        with pytest.raises(InputError, match="must hold"):
            Ring.attach(ring.name)
    with pytest.raises(InputError, match="must be a multiple of"):
        cycles_of(b"1" * 9)


def test_actions_come_in_order():
    assert actions_of(ARMED | DISARMED << 4 | GAINS << 8) == (ARMED, DISARMED, GAINS)
    assert actions_of(0) == ()
    assert CYCLE.size == 8 * 25
    assert math.isnan(cycles_of(CYCLE.pack(1, *[math.nan] * 5, 0, 0, 0, 0, *[math.nan] * 11, 0, *[0.0] * 3))[0].limit)
