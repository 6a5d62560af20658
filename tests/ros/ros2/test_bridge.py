"""The bridge on a virtual clock against a double of the node, and once over DDS against a companion's side."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core.config import IDENTITY
from otwarp.ros.contract import TopicState
from otwarp.ros.ros2 import (
    RELIABLE,
    SENSOR_DATA,
    Ros2Bridge,
    Ros2Commands,
    Ros2Config,
    Ros2Node,
    load_messages,
)
from tests.ros.ros2.setups import expect_soon, loopback

pytest.importorskip("cyclonedds")
m = load_messages()

EXACT = 1e-12
"""A few roundings of numbers near 1."""

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
TICK = 0.001
"""Period of the loop that publishes [s]: a time on its grid is up to one late."""

TRAPS = (((1.0, 2.0, 3.0), (3.0, 2.0, 5.0)), ((9.0, 0.0, 1.0),))
MICROMETRES = Ros2Config(scene_unit=1.0)
ROBOTS = (((2.0, 4.0, 6.0), (0.0, 0.0, 0.6, 0.8)), ((-2.0, 0.0, 0.0), UPRIGHT))
STATE = TopicState(traps=TRAPS, robots=ROBOTS)


class Line:
    """A topic of the double: what was sent on it, or what waits to be taken."""

    def __init__(self, kind, qos):
        self.kind, self.qos, self.messages, self.malformed = kind, qos, [], 0

    def publish(self, message) -> None:
        assert isinstance(message, self.kind)
        self.messages.append(message)

    def take(self) -> list:
        messages, self.messages = self.messages, []
        return messages


class Desk:
    """Double of a node: both ends in the hands of the test."""

    def __init__(self):
        self.out, self.into = {}, {}

    def publisher(self, topic, kind, qos):
        return self.out.setdefault(topic, Line(kind, qos))

    def subscribe(self, topic, kind, qos):
        return self.into.setdefault(topic, Line(kind, qos))


@pytest.fixture
def desk():
    return Desk()


def twist(x=0.0, y=0.0, z=0.0, turn=0.0, reset=0.0):
    return m.Twist(m.Vector3(x, y, z), m.Vector3(reset, 0.0, turn))


def sent(desk, topic):
    """Translation, rotation of the only transform of the last message."""
    (stamped,) = desk.out[topic].messages[-1].transforms
    t, r = stamped.transform.translation, stamped.transform.rotation
    return (t.x, t.y, t.z), (r.x, r.y, r.z, r.w)


def test_the_topics_are_those_of_the_contract(desk):
    Ros2Bridge(desk, MICROMETRES)
    obstacles = [f"/DynaOb0{n}{end}" for n in (1, 2, 3, 4) for end in ("", "Collide")]
    ours = ["/firstOTposition", "/secondOTposition", "/robot01", "/robot02", "/xform", "/object", *obstacles]
    assert sorted(desk.out) == sorted(ours)
    hands = ["/GeomagicLeft/smoothed_twist", "/GeomagicRight/smoothed_twist"]
    assert sorted(desk.into) == sorted(["/rl_vel", "/resetSignal", *hands])
    assert {line.qos for line in desk.out.values()} == {RELIABLE}
    assert {line.qos for line in desk.into.values()} == {SENSOR_DATA}


def test_pairing_and_namespace_are_configuration():
    desk = Desk()
    bridge = Ros2Bridge(desk, Ros2Config(pairing="older", namespace="/lab/twin", axis_map=IDENTITY))
    assert "/lab/twin/xform" in desk.out and "/lab/twin/rl_vel" in desk.into
    bridge.commands(0.0)
    # of the older release, the first hand's namespace moves the second group
    desk.into["/lab/twin/Geomagic/smoothedTwist"].publish(twist(x=10.0))
    bridge.commands(0.0)
    first, second = bridge.commands(0.1).hands
    assert first == (0.0, 0.0, 0.0)
    assert second == pytest.approx((0.1, 0.0, 0.0), abs=EXACT)


def test_what_is_published(desk):
    bridge = Ros2Bridge(desk, Ros2Config(scene_unit=2.0, force_unit=10.0))
    state = replace(
        STATE,
        cell=(2.0, 4.0, 8.0),
        obstacles=[((10.0, 20.0, 30.0), UPRIGHT), ((0.0, 0.0, 2.0), (1.0, 0.0, 0.0, 0.0))],
        contact_force=25.0,
        collision=True,
        collision_force=5.0,
        hits=[(False, 0.0), (True, 40.0)],
        time=12.25,
    )
    assert bridge.publish(5.0, state)
    assert sent(desk, "/firstOTposition") == ((1.0, 1.0, 2.0), UPRIGHT)
    assert sent(desk, "/secondOTposition") == ((4.5, 0.0, 0.5), UPRIGHT)
    assert sent(desk, "/robot01") == ((1.0, 2.0, 3.0), (0.0, 0.0, 0.6, 0.8))
    assert sent(desk, "/object") == ((1.0, 2.0, 4.0), (2.5, 1.0, 1.0, 0.5))
    assert sent(desk, "/DynaOb01") == ((5.0, 10.0, 15.0), UPRIGHT)
    assert sent(desk, "/DynaOb02") == ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    assert sent(desk, "/DynaOb01Collide")[0] == (0.0, 0.0, 0.0)
    assert sent(desk, "/DynaOb02Collide")[0] == (1.0, 4.0, 0.0)
    assert desk.out["/DynaOb03"].messages == [] == desk.out["/DynaOb03Collide"].messages
    (stamped,) = desk.out["/object"].messages[0].transforms
    assert (stamped.header.stamp.sec, stamped.header.stamp.nanosec) == (12, 250_000_000)
    assert (stamped.header.frame_id, stamped.child_frame_id) == ("world", "object")


def test_a_lost_cell_and_no_cell(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    bridge.publish(0.0, STATE)
    assert desk.out["/object"].messages == []
    bridge.publish(1.0, replace(STATE, cell=(0.0, 0.0, 0.0), cell_lost=True))
    assert sent(desk, "/object")[1] == (0.0, 0.0, 0.0, 0.0)


def test_the_pair_is_halfway_and_turned_along_it(desk):
    Ros2Bridge(desk, MICROMETRES).publish(0.0, STATE)
    (x, y, z), (qx, qy, qz, qw) = sent(desk, "/xform")
    assert (x, y, z) == (0.0, 2.0, 3.0)
    # the companion's own way from quaternion to heading: from the second robot (−2, 0) to the first (2, 4)
    heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    assert heading == pytest.approx(math.pi / 4.0, abs=EXACT)


def test_publication_keeps_to_its_rate(desk):
    bridge = Ros2Bridge(desk, replace(MICROMETRES, communication_rate=60.0))
    # a loop at 1 kHz for two seconds: the grid of 60 Hz holds though a millisecond does not divide it
    times = [n / 1000.0 for n in range(2000) if bridge.publish(n / 1000.0, STATE)]
    assert len(times) == 120
    assert all(abs(time - n / 60.0) <= TICK + EXACT for n, time in enumerate(times))
    # after a pause one message, not the missed ones
    after = [bridge.publish(10.0 + n / 1000.0, STATE) for n in range(16)]
    assert after == [True] + [False] * 15
    # a clock that starts again does not silence it
    again = [bridge.publish(n / 1000.0, STATE) for n in range(16)]
    assert again == [True] + [False] * 15


NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    "change",
    [
        {"traps": (((NAN, 0.0, 0.0),), ((0.0, 0.0, 0.0),))},
        {"traps": ((), ((0.0, 0.0, 0.0),))},
        {"robots": (((0.0, 0.0, 0.0), UPRIGHT), ((INF, 0.0, 0.0), UPRIGHT))},
        {"robots": (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, NAN)), ((0.0, 0.0, 0.0), UPRIGHT))},
        {"cell": (0.0, 1e13, 0.0)},
        {"contact_force": NAN},
        {"collision_force": INF},
        {"hits": [(True, NAN)]},
        {"obstacles": [((0.0, 0.0, 0.0), UPRIGHT)] * 5},
        {"time": -1.0},
        {"time": NAN},
        {"time": 2.0**31},
    ],
)
def test_a_state_that_is_no_state_is_not_sent(desk, change):
    bridge = Ros2Bridge(desk, MICROMETRES)
    state = replace(STATE, cell=(0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="allowed") as caught:
        bridge.publish(0.0, replace(state, **change))
    assert "\n" not in str(caught.value)
    assert all(line.messages == [] for line in desk.out.values())
    # and the next good one goes at once
    assert bridge.publish(0.0, state)


def test_a_now_that_is_no_time_is_refused(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    for call in (bridge.commands, lambda now: bridge.publish(now, STATE)):
        with pytest.raises(InputError, match="now is nan"):
            call(NAN)


def test_a_velocity_moves_the_pair_until_it_is_too_old(desk):
    bridge = Ros2Bridge(desk, Ros2Config(scene_unit=20.0, timeout=0.5))
    assert bridge.commands(0.0) == Ros2Commands()
    desk.into["/rl_vel"].publish(twist(x=2.0, y=-1.0, turn=90.0))
    found = bridge.commands(1.0)
    assert found.velocity == (40.0, -20.0) and found.turn == pytest.approx(math.pi / 2.0, abs=EXACT)
    # nothing moves for the time before it came
    assert found.shift == (0.0, 0.0) and found.angle == 0.0
    found = bridge.commands(1.1)
    assert found.shift == pytest.approx((4.0, -2.0), abs=EXACT)
    assert found.angle == pytest.approx(math.radians(9.0), abs=EXACT)
    # the rest of the half second, though the loop looked away for a minute
    found = bridge.commands(61.1)
    assert found.shift == pytest.approx((16.0, -8.0), abs=EXACT)
    assert found.velocity == (0.0, 0.0) and found.turn == 0.0
    assert bridge.commands(62.0).shift == (0.0, 0.0)


def test_the_newest_velocity_counts(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    for x in (1.0, 2.0, 3.0):
        desk.into["/rl_vel"].publish(twist(x=x))
    assert bridge.commands(0.0).velocity == (3.0, 0.0)
    desk.into["/rl_vel"].publish(twist(x=0.0))
    found = bridge.commands(0.1)
    assert found.velocity == (0.0, 0.0) and found.shift == pytest.approx((0.3, 0.0), abs=EXACT)


def test_the_way_does_not_depend_on_how_often_one_looks(desk):
    ways = []
    for steps in (1, 7, 100):
        bridge = Ros2Bridge(desk, MICROMETRES)
        bridge.commands(0.0)
        desk.into["/rl_vel"].publish(twist(x=5.0, y=1.0, turn=10.0))
        bridge.commands(0.0)
        found = [bridge.commands(0.8 * n / steps) for n in range(1, steps + 1)]
        ways.append((sum(f.shift[0] for f in found), sum(f.shift[1] for f in found), sum(f.angle for f in found)))
    assert ways[0] == pytest.approx((2.5, 0.5, math.radians(5.0)), abs=EXACT)
    assert all(way == pytest.approx(ways[0], abs=EXACT) for way in ways)


@pytest.mark.parametrize(
    "bad",
    [{"x": NAN}, {"y": INF}, {"turn": -INF}, {"x": 30.1}, {"y": -1e300}, {"turn": 501.0}, {"turn": NAN}],
)
def test_velocities_beyond_belief_are_refused_and_counted(desk, bad):
    bridge = Ros2Bridge(desk, MICROMETRES)
    desk.into["/rl_vel"].publish(twist(x=1.0))
    desk.into["/rl_vel"].publish(twist(**bad))
    assert bridge.commands(0.0).velocity == (1.0, 0.0)
    assert bridge.refused == 1
    # and a bad one does not keep an old one alive
    for n in range(1, 10):
        desk.into["/rl_vel"].publish(twist(**bad))
        found = bridge.commands(n / 10.0)
    assert found.velocity == (0.0, 0.0) and bridge.refused == 10


def test_the_companions_own_limits_are_believed(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    desk.into["/rl_vel"].publish(twist(x=30.0, y=-30.0, turn=500.0))
    assert bridge.commands(0.0).velocity == (30.0, -30.0) and bridge.refused == 0


any_float = st.floats(width=64)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(any_float, any_float, any_float, any_float), max_size=6), st.floats(0.0, 1e6))
def test_whatever_comes_what_goes_on_is_bounded(values, pause):
    desk = Desk()
    bridge = Ros2Bridge(desk, MICROMETRES)
    bridge.commands(0.0)
    for x, y, turn, reset in values:
        desk.into["/rl_vel"].publish(twist(x=x, y=y, turn=turn))
        desk.into["/resetSignal"].publish(twist(reset=reset))
        for hand in ("Left", "Right"):
            desk.into[f"/Geomagic{hand}/smoothed_twist"].publish(twist(x=x, y=y, z=turn))
    bridge.commands(0.0)
    found = bridge.commands(pause)
    # half a second of 30 units/s and 500 deg/s, a tenth of 2000 mm/s times 0.1 µm/mm
    assert all(abs(x) <= 15.0 + EXACT for x in found.shift) and abs(found.angle) <= math.radians(250.0) + EXACT
    assert all(abs(x) <= 20.0 + EXACT for hand in found.hands for x in hand)


def test_reset_is_the_step_and_not_the_level(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    line = desk.into["/resetSignal"]
    asked = []
    for level in (0.0, 1.0, 1.0, None, 0.0, 1.0, NAN, 1.0):
        if level is not None:
            line.publish(twist(reset=level))
        asked.append(bridge.commands(float(len(asked))).reset)
    assert asked == [False, True, False, False, False, True, False, False]
    assert bridge.refused == 1
    # both ends of a pulse between two looks
    line.publish(twist(reset=0.0))
    line.publish(twist(reset=1.0))
    line.publish(twist(reset=0.0))
    assert bridge.commands(20.0).reset


def test_a_reset_drops_the_velocities(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    desk.into["/rl_vel"].publish(twist(x=3.0))
    desk.into["/GeomagicLeft/smoothed_twist"].publish(twist(x=100.0))
    bridge.commands(0.0)
    desk.into["/rl_vel"].publish(twist(x=5.0))
    desk.into["/resetSignal"].publish(twist(reset=1.0))
    assert bridge.commands(0.1).velocity == (0.0, 0.0)
    found = bridge.commands(0.2)
    assert found.shift == (0.0, 0.0) and found.hands[0] == (0.0, 0.0, 0.0)


def test_hands_move_their_groups(desk):
    bridge = Ros2Bridge(desk, replace(MICROMETRES, motion_gain=200.0, hand_timeout=0.5))
    desk.into["/GeomagicLeft/smoothed_twist"].publish(twist(x=10.0, y=20.0, z=30.0))
    desk.into["/GeomagicRight/smoothed_twist"].publish(twist(y=NAN))
    bridge.commands(0.0)
    first, second = bridge.commands(0.25).hands
    # mm/s · 0.2 µm/mm · 0.25 s; the hand's up is the scene's z, its towards-the-user the scene's −y
    assert first == pytest.approx((0.5, -1.5, 1.0), abs=EXACT)
    assert second == (0.0, 0.0, 0.0) and bridge.refused == 1


def test_a_clock_that_goes_back_drops_what_was_asked(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    desk.into["/rl_vel"].publish(twist(x=1.0))
    bridge.commands(100.0)
    found = bridge.commands(0.0)
    assert found.shift == (0.0, 0.0) and found.velocity == (0.0, 0.0)
    desk.into["/rl_vel"].publish(twist(x=2.0))
    bridge.commands(0.1)
    assert bridge.commands(0.2).shift == pytest.approx((0.2, 0.0), abs=EXACT)


def test_arrays_are_taken_as_they_are(desk):
    bridge = Ros2Bridge(desk, MICROMETRES)
    traps = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 5.0]])
    pose = (np.array([1.0, 2.0, 3.0]), np.array(UPRIGHT))
    state = TopicState(traps=(traps, traps[:1]), robots=(pose, pose), cell=np.float32([1.0, 2.0, 4.0]))
    bridge.publish(0.0, state)
    assert sent(desk, "/firstOTposition") == ((2.0, 2.0, 4.0), UPRIGHT)
    assert sent(desk, "/object")[0] == (1.0, 2.0, 4.0)
    with pytest.raises(InputError, match="empty group"):
        bridge.publish(1.0, replace(state, traps=(traps[:0], traps)))


@pytest.mark.parametrize(
    "values",
    [
        {"pairing": "newest"},
        {"namespace": "/1"},
        {"scene_unit": 0.0},
        {"scene_unit": NAN},
        {"communication_rate": 0.0},
        {"control_rate": INF},
        {"timeout": 0.1},
        {"speed_limit": -1.0},
        {"axis_map": ((2.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))},
    ],
)
def test_bad_configurations_are_refused(values):
    with pytest.raises(InputError, match="allowed") as caught:
        Ros2Config(**values)
    assert "\n" not in str(caught.value)


def test_a_controller_over_dds(monkeypatch):
    """The companion's side: best-effort subscriptions, default publishers, a turn of its control loop."""
    domain = loopback(monkeypatch)
    with Ros2Node("twin", domain) as twin, Ros2Node("dqn_deployment", domain) as companion:
        bridge = Ros2Bridge(twin, MICROMETRES)
        states = {t: companion.subscribe(t, m.TFMessage, SENSOR_DATA) for t in ("/object", "/xform", "/robot01")}
        velocity, reset = companion.publisher("/rl_vel", m.Twist), companion.publisher("/resetSignal", m.Twist)
        expect_soon(
            lambda: all(s.matched for s in states.values()) and velocity.matched and reset.matched, "the topics"
        )
        bridge.commands(0.0)
        bridge.publish(0.0, replace(STATE, cell=(1.0, 2.0, 3.0), contact_force=4.0))
        heard = {topic: line.latest().transforms[0] for topic, line in states.items()}
        assert heard["/object"].transform.translation == m.Vector3(1.0, 2.0, 3.0)
        assert heard["/object"].transform.rotation == m.Quaternion(4.0, 1.0, 0.0, 0.0)
        velocity.publish(twist(x=1.4, y=-0.7, turn=45.0))
        reset.publish(twist(reset=1.0))
        reset.publish(twist(reset=0.0))
        assert bridge.commands(0.1).reset
        velocity.publish(twist(x=1.4, y=-0.7, turn=45.0))
        bridge.commands(0.2)
        assert bridge.commands(0.4).shift == pytest.approx((0.28, -0.14), abs=EXACT)
        assert (bridge.refused, bridge.malformed) == (0, 0)
