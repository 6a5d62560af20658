"""The simulator's bridge, without a network: what it publishes, and how the hands' twists move traps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.haptics.core.config import IDENTITY
from otwarp.ros.contract import SIMULATOR_TOPICS, ContractConfig
from otwarp.ros.ros1.bridge import Ros1Bridge

from .setups import LocalNode, twist

EXACT = 1e-12
PLAIN = ContractConfig(axis_map=IDENTITY, scene_unit=20.0, motion_gain=0.01)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
TURNED = (0.0, 0.0, 0.6, 0.8)
TRAPS = ((20.0, 0.0, 0.0), np.array([0.0, 40.0, 0.0]))
ROBOTS = (((10.0, 0.0, 2.0), TURNED), (np.array([30.0, 20.0, 4.0]), np.array(UPRIGHT)))
OBSTACLES = [(60.0, 0.0, 0.0), ((0.0, 60.0, 0.0), TURNED)]


class Clock:
    """A time that a test sets."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def bridge_on(node: LocalNode, config: ContractConfig = PLAIN, clock: Clock | None = None) -> Ros1Bridge:
    return Ros1Bridge(node, config, clock=clock or Clock(), stamp=lambda: 12.25)


def test_each_topic_has_exactly_one_transform_in_scene_units():
    node = LocalNode()
    assert bridge_on(node).publish(0.0, TRAPS, ROBOTS, OBSTACLES)
    assert set(node.sent) == set(SIMULATOR_TOPICS) - {"/DynaOb03", "/DynaOb04"}
    expected = {
        "/firstOTposition": ((1.0, 0.0, 0.0), UPRIGHT),
        "/secondOTposition": ((0.0, 2.0, 0.0), UPRIGHT),
        "/robot01": ((0.5, 0.0, 0.1), TURNED),
        "/robot02": ((1.5, 1.0, 0.2), UPRIGHT),
        "/xform": ((1.0, 0.5, 0.15), UPRIGHT),
        "/DynaOb01": ((3.0, 0.0, 0.0), UPRIGHT),
        "/DynaOb02": ((0.0, 3.0, 0.0), TURNED),
    }
    for topic, (position, orientation) in expected.items():
        (message,) = node.sent[topic]
        (transform,) = message.transforms
        t, r = transform.transform.translation, transform.transform.rotation
        assert (t.x, t.y, t.z) == pytest.approx(position, abs=EXACT)
        assert (r.x, r.y, r.z, r.w) == pytest.approx(orientation, abs=EXACT)
        assert (transform.header.frame_id, transform.child_frame_id) == ("world", topic[1:])
        assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (12, 250_000_000)


def test_the_rate_holds_and_lost_periods_are_not_caught_up():
    node = LocalNode()
    bridge = bridge_on(node)
    sent = [bridge.publish(n / 600.0, TRAPS, ROBOTS) for n in range(601)]
    assert sum(sent) == 61
    assert [n for n, s in enumerate(sent) if s][:3] == [0, 10, 20]
    assert bridge.publish(5.0, TRAPS, ROBOTS)
    assert not bridge.publish(5.001, TRAPS, ROBOTS)
    assert [m.transforms[0].header.seq for m in node.sent["/robot01"]] == list(range(62))


def test_what_is_absent_stays_silent():
    node = LocalNode()
    bridge = bridge_on(node)
    assert bridge.publish(0.0, (None, TRAPS[1]), (ROBOTS[0], None))
    assert set(node.sent) == {"/secondOTposition", "/robot01"}


def test_more_than_four_obstacles_are_left_out():
    node = LocalNode()
    bridge_on(node).publish(0.0, (), (), [(float(n), 0.0, 0.0) for n in range(9)])
    assert set(node.sent) == {f"/DynaOb0{n}" for n in (1, 2, 3, 4)}


def test_numbers_that_are_not_finite_are_not_published():
    node = LocalNode()
    bridge = bridge_on(node)
    bridge.publish(0.0, ((math.nan, 0.0, 0.0), TRAPS[1]), (ROBOTS[0], ((0.0, math.inf, 0.0), UPRIGHT)))
    assert set(node.sent) == {"/secondOTposition", "/robot01"}
    assert bridge.skipped == 3  # the trap, the robot, and the midpoint


@pytest.mark.parametrize(
    ("config", "topics"),
    [
        (PLAIN, ("/GeomagicLeft/smoothed_twist", "/GeomagicRight/smoothed_twist")),
        (
            ContractConfig(axis_map=IDENTITY, scene_unit=20.0, motion_gain=0.01, pairing="older"),
            ("/Geomagic2/smoothedTwist", "/Geomagic/smoothedTwist"),
        ),
    ],
)
def test_each_group_follows_its_hand(config, topics):
    """mm/s times time times 0.01 scene units per mm times 20 µm per scene unit."""
    node, clock = LocalNode(), Clock()
    bridge = bridge_on(node, config, clock)
    bridge.commands(0.0)
    node.say(topics[0], twist(100.0))
    node.say(topics[1], twist(0.0, -50.0))
    clock.now = 0.05
    first, second = bridge.commands(clock.now)
    assert first == pytest.approx((100.0 * 0.05 * 0.01 * 20.0, 0.0, 0.0), abs=EXACT)
    assert second == pytest.approx((0.0, -50.0 * 0.05 * 0.01 * 20.0, 0.0), abs=EXACT)


def test_a_hand_that_falls_silent_stops_its_traps():
    node, clock = LocalNode(), Clock()
    bridge = bridge_on(node, PLAIN, clock)
    bridge.commands(0.0)
    node.say("/GeomagicLeft/smoothed_twist", twist(100.0))
    clock.now = 2.0
    first, second = bridge.commands(2.0)
    assert first[0] == pytest.approx(100.0 * PLAIN.twist_timeout * 0.2)
    assert second == (0.0, 0.0, 0.0)
    assert bridge.commands(3.0)[0] == (0.0, 0.0, 0.0)


def test_the_default_map_turns_the_hands_up_into_the_scenes_up():
    node, clock = LocalNode(), Clock()
    bridge = bridge_on(node, ContractConfig(), clock)
    bridge.commands(0.0)
    node.say("/GeomagicLeft/smoothed_twist", twist(0.0, 1000.0, 0.0))
    clock.now = 0.1
    assert bridge.commands(0.1)[0] == pytest.approx((0.0, 0.0, 10.0), abs=1e-9)


def test_twists_that_no_hand_makes_are_refused():
    node, clock = LocalNode(), Clock()
    bridge = bridge_on(node, PLAIN, clock)
    bridge.commands(0.0)
    for x in (math.nan, math.inf, 1e5):
        node.say("/GeomagicLeft/smoothed_twist", twist(x))
    clock.now = 0.1
    assert bridge.commands(0.1)[0] == (0.0, 0.0, 0.0)
    assert bridge.refused == 3


def test_closing_takes_all_topics_back():
    node = LocalNode()
    bridge_on(node).close()
    assert set(node.closed) == {*SIMULATOR_TOPICS, "/GeomagicLeft/smoothed_twist", "/GeomagicRight/smoothed_twist"}


def test_a_namespace_that_is_no_name_is_refused(master):
    from otwarp.ros.ros1.node import Ros1Node

    with Ros1Node("a", master.uri) as node, pytest.raises(InputError, match="topic is '/a b/smoothed_twist'"):
        Ros1Bridge(node, ContractConfig(namespaces=("a b", "c")))
