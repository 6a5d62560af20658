"""The live loop with hands, pages and recordings."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from otwarp import teleop as c
from otwarp.errors import InputError, SimulationError
from otwarp.haptics.core.config import FACING_USER, HandConfig, HapticsConfig
from otwarp.teleop.session.live import LiveLoop
from tests.teleop.scenes import PLACES, three_beads
from tests.teleop.session.stage import RATE, Stage, place

SLEW = 1000.0
"""The Touch preset's [N/s]."""
TAKING_HOLD = 0.0081
"""Micrometres: a hand that is under way takes hold one or two servo periods late, 0.004 µm each."""


@pytest.fixture
def stage(request):
    made = []

    def make(*args, **options) -> Stage:
        made.append(Stage(*args, **options))
        return made[-1]

    yield make
    for one in made:
        one.loop.close()


def test_a_hand_carries_its_bead_and_feels_the_drag(stage):
    s = stage(right="virtual:line,from=0/0/0,to=0.05/0/0,duration=2,mass=0")
    s.loop.start(arm=True)
    live = s.run(1.0)
    # 0.025 m of hand in a second at 100 µm/m, to the right; what the bead lags is γv/k
    drag = 6.0 * math.pi * 0.00089 * 1.0 * 2.5
    assert place(live, 1)[0] - PLACES["right"][0] == pytest.approx(2.5 - drag / 10.0, abs=0.03)
    assert np.allclose(place(live, 0), PLACES["left"]) and np.allclose(place(live, 2), PLACES["none"])
    # Heun's steps of 1 ms with a relaxation time of 1.7 ms: 1.13 of the drag
    assert live.hand_force[1, 0] == pytest.approx(drag, rel=0.2)
    hand = live.hands[0]
    assert hand.now is not None and hand.now.state == "armed"
    # the hand is pulled back by what it would be pulled with if the sphere were seen at once
    assert hand.force[0] == pytest.approx(-0.02 * drag, rel=0.2)
    assert abs(hand.force[1]) < 1e-6 and not live.warnings


def test_each_hand_moves_its_own_traps_by_its_own_axes(stage):
    turned = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))  # scene x is the device's y, scene y its −x
    hands = (HandConfig(name="left", axis_map=turned), HandConfig(name="right", axis_map=FACING_USER))
    along_x = "virtual:line,from=0/0/0,to=0.02/0/0,duration=0.5,mass=0"
    s = stage(config=HapticsConfig(hands=hands), left=along_x, right=along_x)
    s.loop.start()
    moved = s.run(1.0).frame.trap_position[0] - np.array(list(PLACES.values()))
    # 0.02 m along the device's x at 100 µm/m: the right hand's x, the left hand's −y, and no other trap
    assert moved == pytest.approx(np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), abs=TAKING_HOLD)


def test_the_speed_follows_what_steers_it(stage):
    asked = []

    def steer(now, pace):
        asked.append((now, pace.speed))
        return 0.5 if len(asked) == 10 else None

    s = stage(options={"steer": steer})
    s.loop.start()
    live = s.run(20.0 / RATE)
    assert live.pace.speed == 0.5
    assert [speed for _, speed in asked] == [1.0] * 10 + [0.5] * 10
    assert [now for now, _ in asked] == sorted(now for now, _ in asked)


def test_gizmos_move_what_no_hand_holds(stage):
    s = stage(left="virtual:hold,at=0/0/0")
    s.loop.start()
    s.run(0.1)
    moved = {0: (0.0, 0.0, 0.0), 2: (1.0, 8.0, 5.5)}
    s.watcher.asked = [c.MoveTraps(moved), c.ShiftTraps((1,), (0.0, -0.5, 0.0)), c.SetPower(10.0, (2,))]
    live = s.run(2.0)
    assert live.frame.trap_position[0] == pytest.approx(
        np.array([PLACES["left"], (8.0, -0.5, 5.0), moved[2]]), abs=1e-5
    )
    assert place(live, 2) == pytest.approx(moved[2], abs=0.01)
    assert live.frame.trap_power[0].tolist() == [20.0, 20.0, 10.0]
    assert not s.watcher.lines


@pytest.mark.parametrize(
    ("command", "line"),
    [
        (c.MoveTraps({3: (0.0, 0.0, 0.0)}), "trap is 3; allowed: 0 to 2"),
        (c.MoveTraps({0: (math.nan, 0.0, 0.0)}), "trap position is (nan, 0.0, 0.0); allowed: finite"),
        (c.ShiftTraps((0,), (math.inf, 0.0, 0.0)), "trap position is (inf, 0.0, 5.0)"),
        (c.SetPower(-1.0), "trap_power"),
        (c.SetSpeed(0.0), "speed is 0.0; allowed: 0.01 to 10"),
        (c.SetGains("left", 10.0), "hand is 'left'; allowed: right"),
        (c.SetGains("right", -1.0), "motion_gain"),
        (c.Arm("middle"), "hand is 'middle'; allowed: right"),
        (c.Record(True), "record: this session cannot"),
    ],
    ids=lambda v: type(v).__name__ if not isinstance(v, str) else "",
)
def test_a_bad_command_is_told_and_changes_nothing(stage, command, line):
    s = stage(right="virtual:hold,at=0/0/0")
    s.loop.start()
    before = s.run(0.1)
    s.watcher.asked = [command]
    after = s.run(0.1)
    assert len(s.watcher.lines) == 1 and line in s.watcher.lines[0] and "\n" not in s.watcher.lines[0]
    assert np.array_equal(before.frame.trap_position, after.frame.trap_position)
    assert np.array_equal(before.frame.trap_power, after.frame.trap_power) and after.pace.speed == 1.0


def test_a_loop_that_stalls_lets_the_force_fall(stage):
    s = stage(right="virtual:sine,amplitude=0.01,frequency=2,mass=0")
    s.loop.start(arm=True)
    s.run(1.2)
    assert s.servo is not None
    sent = s.servo.forces[0]
    stalled = s.clock.now()
    s.clock.sleep_until(stalled + 0.3)
    states = [now for now in sent if now.time >= stalled - 1e-9]
    assert max(math.hypot(*now.force) for now in sent) > 0.003
    falling = [math.hypot(*now.force) for now in states if now.time > stalled + 0.022]
    assert all(a >= b - 1e-12 for a, b in itertools.pairwise(falling))
    late = [now for now in states if now.time >= stalled + 0.101]
    assert late and all(now.force == (0.0, 0.0, 0.0) and now.state == "disarmed" for now in late)
    steps = [math.dist(a.force, b.force) for a, b in itertools.pairwise(sent)]
    assert max(steps) <= SLEW * 1e-3 * (1.0 + 1e-9)
    # it comes back disarmed, with the traps where they are
    live = s.run(0.2)
    assert live.hands[0].now is not None and live.hands[0].now.state == "disarmed"
    told = (
        "right hand: virtual:sine,amplitude=0.01,frequency=2,mass=0: disarmed: "
        "nothing new from the simulation for 0.1 s; arm it again"
    )
    assert told in live.warnings
    assert [line for line in live.warnings if line != told] == [
        "simulated time runs at 0.74 of real time, 1 was asked for; 0.3 s given up"
    ]
    s.watcher.asked = [c.Arm()]
    assert s.run(0.7).hands[0].message == "" and not s.watcher.lines


def test_a_pause_disarms_and_reset_begins_anew(stage):
    s = stage(right="virtual:circle,radius=0.01,mass=0")
    s.loop.start(arm=True)
    s.run(1.0)
    s.watcher.asked = [c.Pause(True)]
    first, last = s.run(0.02), s.run(0.3)
    assert first.frame.time == last.frame.time and last.pace.paused
    assert last.hands[0].force == (0.0, 0.0, 0.0) and last.hands[0].now.state == "disarmed"
    s.watcher.asked = [c.Arm()]
    s.run(0.02)
    assert s.watcher.lines == ["arm: the simulation stands still; allowed: while it runs"]
    s.watcher.asked = [c.Pause(False), c.Arm()]
    assert s.run(0.7).hands[0].now.state == "armed"
    s.watcher.asked = [c.Pause(False), c.Reset()]
    s.run(0.02)
    s.watcher.asked = [c.Arm()]
    live = s.run(0.7)
    assert live.frame.time == pytest.approx(0.72, abs=0.02)
    assert live.hands[0].now.state == "armed"
    # it took hold of its trap where the scene has it: from there to 0.01 m · 100 µm/m away at most
    assert np.linalg.norm(live.frame.trap_position[0, 1] - PLACES["right"]) <= 2.0


@pytest.mark.parametrize("command", [c.Pause(True), c.Reset(), c.Disarm()], ids=lambda v: type(v).__name__)
def test_what_disarms_before_the_hands_hold_their_traps_also_keeps_them_from_being_armed(stage, command):
    s = stage(right="virtual:sine,amplitude=0.01,frequency=2,mass=0")
    s.loop.start(arm=True)
    s.watcher.asked = [command]
    s.run(0.3)
    s.watcher.asked = [c.Pause(False)]
    assert s.run(0.3).hands[0].now.state == "disarmed"
    assert {now.state for now in s.servo.forces[0]} == {"disarmed"}
    assert {now.force for now in s.servo.forces[0]} == {(0.0, 0.0, 0.0)}


@pytest.mark.parametrize("speed", [0.1, 0.01])
def test_slow_motion_keeps_the_hands_armed(stage, speed):
    """Steps of 1 ms at a hundredth of real time come every 100 ms, which is no simulation that died."""
    s = stage(right="virtual:sine,amplitude=0.01,frequency=2,mass=0")
    s.loop.start(arm=True)
    s.run(0.7)
    s.watcher.asked = [c.SetSpeed(speed)]
    before = len(s.servo.forces[0])
    begun = s.run(1.0 / RATE).frame.time
    live = s.run(1.0)
    assert live.frame.time - begun == pytest.approx(speed, abs=2e-3)
    assert {now.state for now in s.servo.forces[0][before:]} == {"armed"}
    # a pause is still one
    s.watcher.asked = [c.Pause(True)]
    assert s.run(0.2).hands[0].now.traps == ()


def test_what_a_reset_takes_is_not_owed(stage):
    s = stage(right="virtual:hold,at=0/0/0")
    s.loop.start()
    s.run(0.5)
    make = s.loop._make_sim

    def slowly():
        s.clock.sleep_until(s.clock.now() + 2.0)
        return make()

    s.loop._make_sim = slowly
    s.watcher.asked = [c.Reset()]
    live = s.run(0.1)
    assert live.pace.slipped == 0.0 and live.frame.time == pytest.approx(0.1, abs=0.02)


@pytest.mark.thorough
def test_a_hand_that_is_ahead_of_its_traps_is_told(stage):
    """In slow motion a hand may go faster than its traps: their limit is per simulated second."""
    limited = tuple(replace(trap, speed_limit=20.0) for trap in three_beads().traps)
    s = stage(replace(three_beads(), traps=limited), right="virtual:line,from=0/0/0,to=0.15/0/0,duration=1,mass=0")
    s.loop.start()
    assert not s.run(0.2).warnings
    s.watcher.asked = [c.SetSpeed(0.25)]
    live = s.run(0.3)
    ahead = live.hands[0].now.traps[0][1][0] - live.frame.trap_position[0, 1, 0]
    assert ahead > 2.0 and any(line.startswith(f"right hand: {ahead:.2g} µm ahead") for line in live.warnings)
    s.watcher.asked = [c.SetSpeed(1.0)]
    assert not s.run(1.5).warnings


def test_the_operator_is_told_of_a_lost_sphere(stage):
    s = stage()
    s.loop.start()
    s.watcher.asked = [c.MoveTraps({0: (-3.0, 0.0, 5.0)})]
    live = s.run(0.2)
    assert len(live.warnings) == 1 and live.warnings[0].startswith("trap_left has lost its sphere: ")


class Broken:
    """A simulation whose next step fails."""

    def __init__(self, sim):
        self._sim = sim

    def __getattr__(self, name):
        return getattr(self._sim, name)

    def step(self, steps: int) -> None:
        raise SimulationError("not finite", world=0, body="/World/bead_left", step=7, time=0.007)


def test_a_simulation_that_fails_stops_the_hands_and_can_be_reset(stage):
    s = stage(right="virtual:sine,amplitude=0.01,frequency=2,mass=0")
    s.loop.start(arm=True)
    s.run(1.0)
    s.loop.sim = Broken(s.loop.sim)
    live = s.run(0.3)
    assert live.warnings[0].startswith("not finite") and "reset to go on" in s.watcher.lines[0]
    assert live.hands[0].force == (0.0, 0.0, 0.0)
    s.watcher.asked = [c.Reset()]
    live = s.run(0.2)
    assert not s.loop.failure and live.frame.time == pytest.approx(0.2, abs=0.02) and not live.warnings
    alone = stage(watch=False)
    alone.loop.start()
    alone.loop.sim = Broken(alone.loop.sim)
    with pytest.raises(SimulationError, match="bead_left"):
        alone.run(0.1)


def test_a_servo_that_dies_is_told_and_the_session_goes_on(stage):
    s = stage(left="virtual:circle,radius=0.01")
    s.loop.start()
    s.run(0.1)
    s.servo.running = False
    live = s.run(0.1)
    assert s.loop.hands.died and s.news == [live.warnings[0]]
    assert live.warnings == ("left hand: the servo has ended, nothing is felt any more; start the session anew",)
    assert live.frame.time == pytest.approx(0.2, abs=0.02)


def test_run_ends_by_order_or_by_time_and_closes_everything(stage):
    s = stage(right="virtual:hold,at=0/0/0")
    s.loop.run(0.5)
    assert s.watcher.closed and s.loop.over and not s.servo.running
    assert s.loop.wall == pytest.approx(0.5, abs=0.02) and s.loop.pace.slipped == 0.0
    other = stage()
    other.watcher.asked = [c.Stop()]
    other.loop.run()
    assert other.loop.over and len(other.watcher.frames) == 1


class Heavy:
    """A simulation that takes some seconds for each simulated one."""

    def __init__(self, sim, clock, cost: float):
        self._sim, self._clock, self._cost = sim, clock, cost

    def __getattr__(self, name):
        return getattr(self._sim, name)

    def step(self, steps: int) -> None:
        self._sim.step(steps)
        self._clock.sleep_until(self._clock.now() + self._cost * steps * self._sim.time_step)


@pytest.mark.parametrize("cost", [1.1, 2.5])
def test_a_machine_that_is_too_slow_keeps_the_hands_armed(stage, cost):
    """Simulated time slips, and is told; forces do not fall for want of states."""
    s = stage(right="virtual:sine,amplitude=0.01,frequency=2,mass=0")
    s.loop.sim = Heavy(s.loop.sim, s.clock, cost)
    before = 0

    def look(live):
        nonlocal before
        before = before or (len(s.servo.forces[0]) if live.wall > 1.0 else 0)

    s.watcher.publish = look
    s.loop.run(3.0, arm=True)
    assert {now.state for now in s.servo.forces[0][before:-200]} == {"armed"}
    assert 0.5 / cost < s.loop.pace.simulated / 3.0 < 1.0 / cost
    assert s.loop.pace.simulated + s.loop.pace.slipped == pytest.approx(3.0, abs=0.1)


def test_the_loop_refuses_a_rate_out_of_range(stage):
    with pytest.raises(InputError, match=r"rate is 50.0; allowed with hands: above 50 frames per second"):
        LiveLoop(three_beads(), stage(right="virtual:hold,at=0/0/0").plans, make_servo=id, rate=50.0, device="cpu")
    with pytest.raises(InputError, match=r"rate is 5.0; allowed: 10 to 1000 frames per second"):
        LiveLoop(three_beads(), rate=5.0, device="cpu")


class SlowRecording:
    """A recording whose disk needs a few looks to finish it, and may fail."""

    complaint = ""

    def __init__(self, looks: int = 5, fails: str = ""):
        self.file, self.begun, self.looks, self.fails, self.closed = Path("a.mcap"), True, looks, fails, False

    def frame(self, live, scene) -> None: ...

    def command(self, command, wall) -> None: ...

    def end(self) -> bool:
        self.looks -= 1
        return self.looks <= 0

    def close(self) -> None:
        self.closed = True
        if self.fails:
            raise OSError(self.fails)


def test_the_loop_does_not_wait_for_a_recording_that_is_finished(stage):
    recordings = [SlowRecording(), SlowRecording(fails="disk full"), SlowRecording(looks=10**6, fails="no disk")]
    left = list(recordings)
    s = stage()
    s.loop._make_recording = lambda file, loop: left.pop(0)
    s.loop.start()
    s.watcher.asked = [c.Record(True), c.Record(False), c.Record(True)]  # the first is not finished yet
    s.run(1.0 / RATE)
    assert not recordings[0].closed and s.loop.recording is not None
    s.run(0.1)
    assert recordings[0].closed and not s.watcher.lines
    s.watcher.asked = [c.Record(False)]
    s.run(0.1)
    assert recordings[1].closed and s.watcher.lines == ["disk full"] and s.loop.recording is None
    s.watcher.asked = [c.Record(True), c.Record(False)]
    s.run(0.1)
    assert not recordings[2].closed
    with pytest.raises(OSError, match="no disk"):
        s.loop.close()
    assert recordings[2].closed
