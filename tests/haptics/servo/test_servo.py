"""The servo's cycle on a virtual clock, with a small chain of its own (`spring.py`)."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost
from otwarp.haptics.core.realtime import RealClock, next_deadline
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.servo.hand import REOPEN_AFTER
from otwarp.haptics.servo.link import (
    RUNS,
    HandStatus,
    Orders,
    OrdersLayout,
    SceneLayout,
    SceneReader,
    ServoStatus,
    StatusLayout,
)
from otwarp.haptics.servo.servo import PARENT_SILENCE, STATUS_EVERY
from tests.haptics.servo.rig import CYCLE, NAN, PERIOD, Breaking, Rig, Traced, steps
from tests.haptics.spring import DECAY, DISARM, RAMP, SLEW, STIFFNESS, SpringChain


def test_force_comes_after_arming_by_the_ramp_and_goes_before_the_end():
    rig = Rig([Traced()])
    rig.run((0.1, rig.arm()), (0.3, rig.stop))
    assert {f for t, f in rig.devices[0].written if t < 0.1} == {0.0}
    assert rig.force(0.1 + RAMP / 2) == pytest.approx(-0.5 * STIFFNESS * 0.01, rel=0.1)
    assert rig.force(0.3) == pytest.approx(-STIFFNESS * 0.01)
    assert rig.state(0.299).state == "armed"
    assert rig.state(0.299).traps == ((0, (10.0, 0.0, 0.0)),)
    assert rig.devices[0].written[-1][1] == 0.0
    assert max(steps(rig)) <= SLEW * PERIOD * (1 + 1e-9)
    assert rig.devices[0].closed
    assert rig.status.read().state == "stopped"
    assert rig.state(math.inf).state == "disarmed"


def test_every_cycle_reads_each_device_once_on_the_grid_and_publishes_it():
    rig = Rig([Traced(), Traced(-0.01)])
    rig.run((0.05, rig.arm(1)), (0.5, rig.stop))
    times = [state.time for _, state in rig.states[0]][:400]
    assert times == pytest.approx([k * PERIOD for k in range(400)], abs=1e-9)
    assert [state.tick for _, state in rig.states[0]][:400] == list(range(1, 401))
    assert rig.force(0.4, 0) == 0.0  # not armed
    assert rig.force(0.4, 1) == pytest.approx(STIFFNESS * 0.01)


def nan_state(rig):
    """A simulation whose numbers are gone and whose beat goes on."""

    def poison():
        rig.x = NAN

    return poison


def killed_in_mid_write(rig):
    def kill():
        rig.publishing = False
        rig.scenes._sequence[0] += 1

    return kill


ENDS = {"stalled": lambda rig: rig.set(publishing=False), "nan": nan_state, "killed": killed_in_mid_write}


@pytest.mark.parametrize("end", ENDS)
def test_force_falls_20_ms_after_the_last_state_and_is_gone_by_100(end):
    rig = Rig([Traced()])
    rig.run((0.05, rig.arm()), (0.2, ENDS[end](rig)), (0.5, rig.stop))
    last = max(t for t in (0.004 * k for k in range(51)) if t < 0.2 - 1e-9)
    full = -STIFFNESS * 0.01
    heard = last + PERIOD  # in the cycle after it was published
    assert all(f == pytest.approx(full) for t, f in rig.devices[0].written if 0.15 <= t <= heard + DECAY - CYCLE)
    assert abs(rig.force(heard + DECAY + CYCLE)) < abs(full)
    assert {f for t, f in rig.devices[0].written if t >= heard + DISARM + CYCLE} == {0.0}
    assert rig.state(heard + DISARM + 2 * CYCLE).state == "disarmed"
    assert max(steps(rig)) <= SLEW * PERIOD * (1 + 1e-9)
    assert (rig.status.read().refused > 0) == (end == "nan")


def test_a_simulation_that_comes_back_does_not_arm_the_hand():
    rig = Rig([Traced()])
    said = []
    look = (0.39, lambda: said.append(rig.status.read().hands[0].message))
    stalls = ((0.2, rig.set(publishing=False)), look, (0.4, rig.set(publishing=True)))
    rig.run((0.05, rig.arm()), *stalls, (0.6, rig.stop))
    assert "disarmed: nothing new from the simulation; arm it again" in said[0]
    assert rig.force(0.19) != 0.0
    assert {f for t, f in rig.devices[0].written if t > 0.35} == {0.0}


def test_no_arming_before_the_first_state():
    rig = Rig([Traced()])
    rig.publishing = False
    said = []
    rig.scenes.close()
    rig.scenes = Mailbox.create(SceneLayout(2, 2))
    rig.servo._scenes = SceneReader(rig.scenes)
    look = (0.1, lambda: said.append(rig.status.read().hands[0]))
    rig.run((0.05, rig.arm()), look, (0.15, rig.set(publishing=True)), (0.3, rig.stop))
    assert "cannot be armed before the simulation" in said[0].message
    assert {f for _, f in rig.devices[0].written} == {0.0}
    assert rig.state(0.1).position == (0.01, 0.0, 0.0)


@pytest.mark.parametrize("error", [DeviceLost, OSError, ValueError])
def test_a_lost_device_disarms_says_so_and_comes_back_disarmed(error):
    rig = Rig([Traced(), Traced(-0.01)])
    device, seen = rig.devices[0], {}

    def unplug():
        device.away = error

    def plug():
        device.away = None

    def look(when):
        return lambda: seen.__setitem__(when, rig.status.read().hands[0])

    rig.run(
        (0.01, rig.arm(0)),
        (0.02, rig.arm(1)),
        (0.2, unplug),
        (0.3, look("away")),
        (0.4, rig.arm(0)),  # in vain
        (0.2 + 2.2 * REOPEN_AFTER, plug),
        (0.2 + 3.5 * REOPEN_AFTER, look("back")),
        (2.2, rig.arm(0)),
        (2.4, rig.stop),
    )
    assert seen["away"] == HandStatus(False, 1, "virtual: lost, disarmed (unplugged)")
    assert rig.state(0.3).state == "fault"
    assert rig.state(0.3).force == ZERO
    assert rig.state(0.3).traps == rig.state(0.19).traps  # the traps stay where the hand left them
    # one that gave no sample is told to let go in the same cycle, not when it is opened anew
    assert rig.force(0.2 + CYCLE) == 0.0
    # at first, in vain 0.5 and 1.0 s after the loss, then with success
    assert device.opens == 4
    assert seen["back"] == HandStatus(True, 1, "virtual: back; arm it to feel it again")
    after = [(t, f) for t, f in device.written if t > 0.2 + CYCLE]
    assert {f for t, f in after if t < 2.2} == {0.0}
    assert rig.force(2.39) == pytest.approx(-STIFFNESS * 0.01)
    # the other hand felt nothing of it
    held = {round(f, 9) for t, f in rig.devices[1].written if 0.15 < t < 2.39}
    assert held == {round(STIFFNESS * 0.01, 9)}


def test_a_device_may_be_lost_in_writing_and_reopened_in_a_thread():
    """The thread ends when it ends: the servo only has to find it back in some later cycle."""
    rig = Rig([Traced()], beside=True)
    device = rig.devices[0]
    write, losing = device.write, [True]

    def lose(force):
        if losing and device.time > 0.1:
            losing.clear()
            raise DeviceLost("cable")
        write(force)

    device.write = lose
    back = []

    def watch():
        status = rig.status.read()
        if status is not None and status.hands[0].losses and status.hands[0].present:
            back.append(status.hands[0])
            rig.stop()
        else:
            rig.script.append((rig.clock.now() + 0.05, watch))

    rig.run((0.05, rig.arm()), (0.2, watch))
    assert back == [HandStatus(True, 1, "virtual: back; arm it to feel it again")]
    assert device.opens == 2


def test_a_silent_parent_disarms_and_one_that_speaks_again_must_arm_anew():
    rig = Rig([Traced()])
    seen = []
    rig.run(
        (0.05, rig.arm()),
        (0.2, rig.set(heartbeats=False)),
        (0.2 + PARENT_SILENCE + 0.2, lambda: seen.append(rig.status.read().hands[0].message)),
        (1.5, rig.set(heartbeats=True)),
        (1.7, rig.stop),
    )
    assert rig.force(0.2 + PARENT_SILENCE - 0.01) == pytest.approx(-STIFFNESS * 0.01)
    assert {f for t, f in rig.devices[0].written if t > 0.2 + PARENT_SILENCE + DISARM} == {0.0}
    assert seen == ["disarmed: no orders for 1 s"]


def test_an_orphan_lets_go_by_the_slew_limit_and_ends():
    dead = [False]
    rig = Rig([Traced()], orphaned=lambda: dead[0])

    def die():
        dead[0] = True
        rig.publishing = rig.heartbeats = False

    rig.run((0.05, rig.arm()), (0.2, die))
    assert rig.clock.now() < 0.2 + STATUS_EVERY * PERIOD + 0.2 + CYCLE
    assert rig.force(0.199) == pytest.approx(-STIFFNESS * 0.01)
    assert rig.devices[0].written[-1][1] == 0.0
    assert max(steps(rig)) <= SLEW * PERIOD * (1 + 1e-9)
    assert rig.devices[0].closed


def test_a_chain_that_does_not_let_go_is_cut():
    class Stubborn(SpringChain):
        def disarm(self):
            pass

    rig = Rig([Traced()], chain=Stubborn)
    rig.run((0.05, rig.arm()), (0.2, rig.stop))
    assert rig.clock.now() == pytest.approx(0.4, abs=3 * CYCLE)
    assert rig.devices[0].written[-1][1] == 0.0
    assert rig.devices[0].written[-2][1] == pytest.approx(-STIFFNESS * 0.01)


def test_disarming_wins_over_arming_and_orders_are_not_lost_when_they_are_overwritten():
    rig = Rig([Traced(), Traced()])

    def both():
        rig.tell(arm=0)
        rig.tell(disarm=0)
        rig.tell(arm=1)
        rig.tell()

    rig.run((0.05, both), (0.2, rig.stop))
    assert rig.force(0.19, 0) == 0.0
    assert rig.force(0.19, 1) == pytest.approx(-STIFFNESS * 0.01)


def test_late_cycles_are_counted_and_never_caught_up():
    rig = Rig([Traced()], late=lambda k: {100: 0.0035, 200: 0.0004, 300: 0.001}.get(k, 0.0))
    rig.run((0.05, rig.arm()), (0.5, rig.stop))
    times = [t for t, _ in rig.devices[0].written[1:-1]]
    gaps = [b - a for a, b in pairwise(times)]
    # a late wake brings the next cycle nearer by less than a period; nothing else is ever shorter than one
    assert sum(gap < PERIOD - 1e-9 for gap in gaps) == 2
    assert min(gaps) > 0.4 * PERIOD
    assert max(gaps) == pytest.approx(0.0045)
    off_grid = [t for t in times if abs(t / PERIOD - round(t / PERIOD)) > 1e-6]
    assert len(off_grid) == 2
    assert rig.servo.late == 4  # three by 3.5 ms, one by exactly a period, none by 0.4 ms


@pytest.mark.parametrize("how", ["raise", "nan", "huge", "trap"])
def test_a_broken_chain_is_cut_and_replaced_when_it_is_armed(how):
    rig = Rig([Traced()], chain=type("Broken", (Breaking,), {"how": how}))
    seen = []
    look = (0.24, lambda: seen.append(rig.status.read().hands[0]))
    rig.run((0.05, rig.arm()), look, (0.3, rig.arm()), (0.45, rig.stop))
    assert rig.force(0.199) == pytest.approx(-STIFFNESS * 0.01)
    assert {f for t, f in rig.devices[0].written if 0.2 < t < 0.3} == {0.0}
    assert rig.state(0.24).state == "fault"
    assert seen[0].present
    assert "chain at fault, arm again" in seen[0].message
    assert rig.force(0.44) == pytest.approx(-STIFFNESS * 0.01)


def test_a_force_above_the_limit_of_the_device_is_held_to_it():
    weak = DeviceInfo(name="weak", kind="virtual", force=0.25)
    rig = Rig([Traced(info=weak), Traced(info=DeviceInfo(name="none", kind="mouse"))])
    rig.run((0.05, rig.arm(0)), (0.06, rig.arm(1)), (0.2, rig.stop))
    assert max(abs(f) for _, f in rig.devices[0].written) == pytest.approx(0.25)
    assert rig.state(0.19).force == pytest.approx((-0.25, 0.0, 0.0))
    assert "held to the limit" in rig.status.read().hands[0].message
    assert rig.force(0.19, 1) == pytest.approx(-STIFFNESS * 0.01)  # one without motors has no limit to hold


def test_a_device_that_is_not_there_at_the_start_releases_the_other():
    rig = Rig([Traced(), Traced()])
    rig.devices[1].away = DeviceLost
    with pytest.raises(InputError, match="not there"):
        rig.servo.run()
    assert rig.devices[0].closed
    assert {f for _, f in rig.devices[0].written} == {0.0}
    status = rig.status.read()
    assert (status.state, status.grants) == ("failed", "virtual: not there")


def test_what_is_lost_while_it_is_released_keeps_no_other_hand():
    rig = Rig([Traced(), Traced()])
    close = rig.devices[0].close

    def fail():
        close()
        raise OSError("gone")

    rig.devices[0].close = fail
    rig.run((0.05, rig.arm(1)), (0.2, rig.stop))
    assert rig.devices[1].closed
    assert rig.devices[1].written[-1][1] == 0.0
    assert rig.status.read().hands[0].message == "virtual: gone"


def test_reports_and_orders_pass_their_mailboxes():
    hands = (HandStatus(True, 3, "é" * 200), HandStatus(False, 0, "two\nlines"))
    with Mailbox.create(StatusLayout(2)) as box:
        for state in RUNS:
            box.write(ServoStatus(7, 0.5, state, 2, 1e-4, 1, 0, hands, "SCHED_FIFO: priority 80"))
            got = box.read()
            assert (got.tick, got.state, got.late, got.grants) == (7, state, 2, "SCHED_FIFO: priority 80")
            assert got.hands == (HandStatus(True, 3, "é" * 80), HandStatus(False, 0, "two lines"))
    with Mailbox.create(OrdersLayout(2)) as box:
        orders = Orders(0, (0, 0), (0, 0)).next(arm=1).next(disarm=0).next(stop=True).next()
        box.write(orders)
        assert box.read() == orders == Orders(4, (0, 1), (1, 0), True)


@pytest.mark.parametrize(("now", "deadline", "missed"), [(0.5, 1.0, 0), (1.0, 2.0, 1), (1.5, 2.0, 1), (5.25, 6.0, 5)])
def test_deadlines_that_passed_are_dropped(now, deadline, missed):
    assert next_deadline(0.0, 1.0, now) == (deadline, missed)


@pytest.mark.parametrize("spin", [0.0, 1e-3])
def test_the_real_clock_never_wakes_early(spin):
    clock = RealClock(spin)
    deadline = clock.now() + 0.005
    clock.sleep_until(deadline)
    assert clock.now() >= deadline
    clock.sleep_until(deadline)  # already passed
