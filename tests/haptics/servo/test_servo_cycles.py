"""What the servo writes down of its cycles, and gains on their way through it; on a virtual clock."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import pytest

from otwarp.haptics.core import (
    ABSOLUTE,
    ARMED,
    BACK,
    DISARMED,
    ENDING,
    FAILED,
    FRESH,
    GAINS,
    LOST,
    MADE,
    PRESENT,
    SAMPLED,
    SILENT,
    STATES,
    STEPPED,
    ZERO,
    Cycle,
    DeviceLost,
    actions_of,
    cycles_of,
)
from otwarp.haptics.core.shared_memory import Mailbox, Ring
from otwarp.haptics.servo.hand import REOPEN_AFTER, Hand
from otwarp.haptics.servo.link import Orders, OrdersLayout, Start, StartLayout
from otwarp.haptics.servo.servo import PARENT_SILENCE
from tests.haptics.servo.rig import PERIOD, Breaking, Rig, Traced
from tests.haptics.setups import hand_config, make_chain
from tests.haptics.spring import SpringChain


class Recorded(Rig):
    """A rig with a ring and a start for each hand, drained after every cycle."""

    def __init__(self, devices, chain=SpringChain, slots=64, **options):
        super().__init__(devices, chain, **options)
        self.rings = [Ring.create(slots) for _ in devices]
        self.starts = [Mailbox.create(StartLayout(2, 2)) for _ in devices]
        for hand, ring, starts in zip(self.hands, self.rings, self.starts, strict=True):
            hand._ring, hand._starts = ring, starts
        self.cycles: list[list[Cycle]] = [[] for _ in devices]
        self.begun: list[list[Start]] = [[] for _ in devices]

    def world(self):
        super().world()
        for i, ring in enumerate(getattr(self, "rings", ())):
            self.cycles[i] += cycles_of(ring.drain())
            self.begun[i] += [start for start in [self.starts[i].read()] if start is not None]

    def order(self, **values):
        """An order that changes what is so until further notice."""

        def tell():
            fields = {name: getattr(self.told, name) for name in self.told.__slots__} | values
            self.told = Orders(**fields | {"beat": self.told.beat + 1})
            self.orders.write(self.told)

        return tell


def events(rig, hand=0):
    """(time, actions) of the cycles in which anything happened."""
    return [(round(c.time, 3), actions_of(c.actions)) for c in rig.cycles[hand] if c.actions]


def test_every_cycle_of_a_recording_is_told_as_it_was():
    rig = Recorded([Traced(), Traced(-0.02)])
    rig.run((0.05, rig.order(recording=1)), (0.1, rig.arm()), (0.3, rig.order(recording=0)), (0.4, rig.stop))
    cycles = rig.cycles[0]
    assert [c.tick for c in cycles] == list(range(cycles[0].tick, cycles[0].tick + len(cycles)))
    assert abs(len(cycles) - 250) <= 1
    assert cycles[0].time == pytest.approx(0.05, abs=1.5 * PERIOD)
    assert rig.begun[0] == [Start(1, cycles[0].tick, rig.begun[0][0].text)]
    assert json.loads(rig.begun[0][0].text)["chain"]["phase"] == "disarmed"
    assert [actions for _, actions in events(rig)] == [(ARMED,)]
    assert events(rig, 1) == []
    written = dict(rig.devices[0].written)
    told = {now.tick: now for _, now in rig.states[0]}
    for c in cycles:
        assert c.force[0] == written[c.time]
        assert (c.force, STATES[c.state]) == (told[c.tick].force, told[c.tick].state)
        assert (c.sample_time, c.position, c.buttons) == (c.time, (0.01, 0.0, 0.0), 1)
        assert c.flags == SAMPLED | FRESH | STEPPED | PRESENT | ABSOLUTE
        assert math.isnan(c.motion_gain + c.force_gain)
        assert (c.limit, c.continuous) == (3.3, 0.88)
    assert len({c.beat for c in cycles}) > 50
    assert rig.cycles[1][7].position == (-0.02, 0.0, 0.0)


def test_reasons_of_disarming_are_told():
    rig = Recorded([Traced()])
    rig.run(
        (0.01, rig.order(recording=1)),
        (0.02, rig.arm()),
        (0.1, lambda: rig.tell(disarm=0)),
        (0.2, rig.arm()),
        (0.3, rig.set(heartbeats=False)),
        (1.6, rig.set(heartbeats=True)),
        (1.7, rig.arm()),
        (1.8, rig.stop),
    )
    found = events(rig)
    assert [actions for _, actions in found] == [(ARMED,), (DISARMED,), (ARMED,), (SILENT,), (ARMED,), (ENDING,)]
    assert found[3][0] == pytest.approx(0.3 + PARENT_SILENCE, abs=2 * PERIOD)


def test_losses_failures_and_new_chains_are_told_and_keep_the_gains():
    device = Traced()
    rig = Recorded([device], chain=type("Broken", (Breaking,), {"how": "nan"}))
    made = []
    make = rig.hands[0]._rendering._make_chain
    rig.hands[0]._rendering._make_chain = lambda info: made.append(make(info)) or made[-1]
    gains = rig.order(gains=((20.0, None),))
    rig.run(
        (0.01, rig.order(recording=1)),
        (0.05, rig.arm()),
        (0.1, gains),
        (0.3, rig.arm()),  # after it failed at 0.2
        (0.5, lambda: setattr(device, "away", DeviceLost)),
        (0.6, lambda: setattr(device, "away", None)),
        (0.6 + 2 * REOPEN_AFTER, rig.stop),
    )
    assert [actions for _, actions in events(rig)] == [(ARMED,), (GAINS,), (MADE, ARMED), (MADE,), (ENDING,)]
    flags = [c.flags for c in rig.cycles[0]]
    assert (
        sum(f & FAILED > 0 for f in flags) == sum(f & LOST > 0 for f in flags) == sum(f & BACK > 0 for f in flags) == 1
    )
    lost = next(c for c in rig.cycles[0] if c.flags & LOST)
    assert math.isnan(lost.sample_time) and not lost.flags & (SAMPLED | PRESENT)
    away = [c for c in rig.cycles[0] if not c.flags & PRESENT]
    assert {c.force for c in away} == {ZERO}
    assert {c.motion_gain for c in rig.cycles[0] if c.time > 0.101} == {20.0}
    assert [chain.gains for chain in made] == [(20.0, None)] * 3


def test_gains_ordered_reach_the_chain_once_and_smoothly():
    config = hand_config(slew=100.0)
    rig = Recorded([Traced(0.004)], chain=lambda info: make_chain(config))
    rig.x = 0.3
    rig.run(
        (0.01, rig.order(recording=1)),
        (0.05, rig.arm()),
        (0.9, rig.order(gains=((None, 0.25),))),
        (1.2, rig.order(gains=((None, 1e9),))),  # a parent that does not check
        (1.5, rig.stop),
    )
    assert [actions for _, actions in events(rig)] == [(ARMED,), (GAINS,), (ENDING,)]
    assert "force_gain is 1000000000.0; allowed" in rig.status.read().hands[0].message
    forces = [c.force for c in rig.cycles[0]]
    assert max(math.dist(a, b) for a, b in pairwise(forces)) <= 100.0 * PERIOD * (1.0 + 1e-9)


def test_a_ring_that_nobody_empties_stops_nothing_and_counts():
    rig = Recorded([Traced()], slots=16)
    rig.order(recording=1)()
    ring, rig.rings = rig.rings[0], []
    rig.run((0.05, rig.arm()), (0.3, rig.stop))
    assert [c.tick for c in cycles_of(ring.drain())] == list(range(1, 17))
    assert ring.lost > 250
    assert rig.force(0.25) != 0.0


def test_a_sample_that_cannot_be_told_keeps_its_hand_alive():
    class Odd(Traced):
        def read(self, time):
            sample = super().read(time)
            return sample if time < 0.1 else type(sample)("soon", sample.position, 1, True)

    rig = Recorded([Odd()])
    rig.order(recording=1)()
    rig.run((0.05, rig.arm()), (0.3, rig.stop))
    assert rig.rings[0].lost > 100
    assert rig.status.read().state == "stopped"


def test_a_start_that_is_too_long_is_said_and_the_recording_goes_on():
    class Long(SpringChain):
        def state(self, scene):
            return {"text": "x" * 100_000}

    class Broken(SpringChain):
        def state(self, scene):
            raise ZeroDivisionError("0/0")

    for chain in (Long, Broken):
        rig = Recorded([Traced()], chain=chain)
        rig.run((0.05, rig.order(recording=1)), (0.2, rig.stop))
        assert rig.begun[0][0].text == ""
        assert "the start of the recording cannot be kept" in rig.status.read().hands[0].message
        assert len(rig.cycles[0]) >= 150


def test_orders_with_gains_and_a_recording_pass_their_mailbox():
    with Mailbox.create(OrdersLayout(2)) as box:
        for gains in ((), ((None, 0.5), (3.0, None))):
            orders = Orders(0, (0, 0), (0, 0), gains=gains, recording=7).next(arm=1)
            box.write(orders)
            assert box.read() == orders
    with Mailbox.create(StartLayout(1, 1)) as box:
        box.write(Start(2, 10**12, "{é}"))
        assert box.read() == Start(2, 10**12, "{é}")


def test_a_hand_without_a_ring_records_nothing():
    rig = Rig([Traced()])
    assert isinstance(rig.hands[0], Hand)
    rig.told = Orders(0, (0,), (0,), recording=1)
    rig.run((0.1, rig.stop))
    assert rig.servo.tick > 90
