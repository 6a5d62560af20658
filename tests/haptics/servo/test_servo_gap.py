"""Time that passes without cycles: a servo that is stopped, a machine that sleeps; on a virtual clock."""

from __future__ import annotations

import math

import pytest

from otwarp.haptics.core import MADE, STATES, ZERO, DeviceSample, actions_of
from otwarp.haptics.core.realtime import RealClock
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.servo.guard import SILENCE, Address, AddressLayout, GuardLayout, GuardReport, SideReport
from otwarp.haptics.servo.hand import SETTLE
from otwarp.haptics.servo.servo import DISARM_AFTER
from tests.haptics.servo.rig import PERIOD, Rig, Traced
from tests.haptics.servo.test_servo_cycles import Recorded
from tests.haptics.setups import chain_for, hand_config, scene_at
from tests.haptics.spring import DISARM

SPEED = 0.02
"""Of the hand [m/s]: in 2 s it goes 40 mm, which is 4 µm of trap."""
FIRST, GAP = 300, 2.0
"""The cycle after which nothing happens for so long [s]."""


class Moving(Traced):
    """A hand that goes on while nobody looks, in reach of the sphere for a part of the way."""

    def read(self, time):
        self.time = time
        return DeviceSample(time, (0.002 + SPEED * max(0.0, time - FIRST * PERIOD), 0.0, 0.0), 1)


class Felt(Recorded):
    """A rig whose scene has a trap, felt by the real chain."""

    def __init__(self, devices, **options):
        config = hand_config(ramp_time=0.02, motion_gain=100.0, force_gain=0.05)
        super().__init__(devices, lambda info: chain_for(config, info), slots=4096, **options)

    def world(self):
        before = self.beat
        super().world()
        if self.beat != before:
            self.scenes.write(scene_at(self.beat, self.clock.now(), sphere=(0.2, 0.0, 0.0)))


def late(seconds: float):
    return lambda k: seconds if k == FIRST else 0.0


@pytest.mark.parametrize("gap", [1.01 * DISARM_AFTER, GAP])
def test_a_servo_that_stood_still_disarms_at_once_and_leaves_the_traps(gap):
    """The old chain would go on armed, with the hand and its traps 4 µm farther and the force of that place."""
    rig = Felt([Moving()], late=late(gap))
    rig.run((0.01, rig.order(recording=1)), (0.05, rig.arm()), (0.5 + gap, rig.stop))
    cycles = rig.cycles[0]
    n = next(n for n, c in enumerate(cycles[1:], 1) if c.time - cycles[n - 1].time > 0.9 * gap)
    before, after = cycles[n - 1], cycles[n:]
    assert STATES[before.state] == "armed" and math.hypot(*before.force) > 0.05
    assert all(c.force == ZERO and STATES[c.state] == "disarmed" for c in after[:-1])
    assert MADE in actions_of(after[0].actions)
    written = [force for time, force in rig.devices[0].written if time > before.time]
    assert set(written) == {0.0}
    traps = [place for time, s in rig.states[0] if time > before.time for _, place in s.traps]
    far = max(math.dist(place, (0.0, 0.0, 0.0)) for place in traps[1:])
    assert far < 1e6 * SPEED * 1e-4 * (0.2 + SETTLE) + 0.3  # only what the hand goes from there on
    message = next(h.message for h in [rig.hands[0].status])
    assert f"disarmed: the servo stood still for {gap + PERIOD:.2g} s; arm it again" in message


def test_a_shorter_gap_is_the_watchdogs_matter():
    rig = Felt([Moving()], late=late(0.5 * DISARM_AFTER))
    rig.run((0.01, rig.order(recording=1)), (0.05, rig.arm()), (0.36, rig.stop))
    assert "stood still" not in rig.hands[0].status.message


def test_what_was_armed_in_the_gap_stays_disarmed():
    rig = Felt([Moving()], late=late(GAP))
    rig.run((0.01, rig.order(recording=1)), (0.05, rig.arm()), (1.0, rig.arm()), (2.5, rig.stop))
    assert STATES[rig.cycles[0][-1].state] == "disarmed"
    assert rig.cycles[0][-1].force == ZERO


def test_a_machine_that_slept_disarms():
    """CLOCK_MONOTONIC stands still in suspend: only its difference to CLOCK_BOOTTIME tells."""
    rig = Felt([Moving()])
    rig.run(
        (0.01, rig.order(recording=1)), (0.05, rig.arm()), (0.3, lambda: rig.clock.suspend(3600.0)), (0.5, rig.stop)
    )
    assert "disarmed: the machine was suspended for 3.6e+03 s" in rig.hands[0].status.message
    felt = [(c.time, math.hypot(*c.force)) for c in rig.cycles[0]]
    assert any(force > 0.05 for time, force in felt if time < 0.3)
    assert all(force == 0.0 for time, force in felt if time > 0.3 + 1.5 * PERIOD)
    clock = RealClock()
    assert abs(clock.suspended() - clock.suspended()) < 1.0  # a constant offset, whatever it is


class Guarded(Traced):
    """A device whose driver goes on without the servo."""

    address = "somewhere"


class Watched(Rig):
    """A rig with a guardian that says what the test wants."""

    def __init__(self, devices):
        super().__init__(devices)
        n = len(devices)
        self.guard, self.addresses = Mailbox.create(GuardLayout(n)), [Mailbox.create(AddressLayout()) for _ in devices]
        self.servo._guard = self.guard
        for hand, box in zip(self.hands, self.addresses, strict=True):
            hand._addresses = box
        self.watching, self.ready, self.number = True, 1, 1

    def world(self):
        super().world()
        if getattr(self, "watching", False):
            self.guard.write(
                GuardReport(self.number, self.servo.tick + 1, (SideReport(self.ready),) * len(self.devices))
            )


def test_a_hand_whose_guardian_is_silent_disarms_and_the_other_goes_on():
    rig = Watched([Guarded(), Traced()])
    seen = {}

    def look():
        seen["said"] = [hand.status.message for hand in rig.hands]
        seen["forces"] = [device.written[-1][1] for device in rig.devices]

    rig.run(
        (0.05, rig.arm(0)),
        (0.06, rig.arm(1)),
        (0.3, rig.set(watching=False)),
        (0.35 + SILENCE + 0.1, look),
        (0.7, rig.arm(0)),
        (0.8, rig.stop),
    )
    assert "no word of its guardian" in seen["said"][0] and not seen["said"][1]
    assert seen["forces"][0] == 0.0 and seen["forces"][1] != 0.0
    assert "cannot be armed without a guardian" in rig.hands[0].status.message
    assert rig.addresses[0].read() == Address(1, "somewhere") and rig.addresses[1].read() is None


def test_a_guardian_must_be_ready_for_the_device_as_it_is_now():
    rig = Watched([Guarded()])
    rig.ready = 0
    rig.run((0.05, rig.arm(0)), (0.2, rig.set(ready=1)), (0.21, rig.stop))
    assert "cannot be armed without a guardian" in rig.hands[0].status.message
    assert {force for _, force in rig.devices[0].written} == {0.0}


@pytest.mark.parametrize(
    ("change", "said"), [({"number": 2}, "another takes its place"), ({"ready": 0}, "is not ready any more")], ids=str
)
def test_a_hand_is_not_handed_on_from_one_guardian_to_another(change, said):
    """However soon another speaks: between the two nobody watched. It may be armed under the new one."""
    rig = Watched([Guarded(), Traced()])
    seen = {}

    def look():
        seen["said"] = [hand.status.message for hand in rig.hands]

    rig.run(
        (0.05, rig.arm(0)),
        (0.06, rig.arm(1)),
        (0.3, rig.set(**change)),
        (0.45, look),
        (0.5, rig.set(ready=1)),
        (0.55, rig.arm(0)),
        (0.8, rig.stop),
    )
    assert said in seen["said"][0] and not seen["said"][1]
    assert rig.force(0.29) != 0.0 and rig.force(0.29, 1) == rig.force(0.45, 1) != 0.0
    assert {force for time, force in rig.devices[0].written if 0.3 + DISARM + 2e-3 < time < 0.55} == {0.0}
    assert rig.force(0.79) != 0.0
