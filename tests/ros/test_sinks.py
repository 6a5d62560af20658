"""ROS as a sink of a live session: a real loop and real bridges, a node that keeps what it is given."""

from __future__ import annotations

import math

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.haptics.core.realtime import VirtualClock
from otwarp.ros.contract import ContractConfig, TopicState
from otwarp.ros.ros2.bridge import Ros2Commands
from otwarp.ros.sinks import LINES, Ros1Sink, Ros2Sink
from otwarp.teleop import Pause, Stop
from otwarp.teleop.session.live import LiveLoop
from tests.ros.ros1.setups import LocalNode
from tests.ros.setups import RATE, roles_of, run
from tests.teleop.scenes import PLACES, three_beads


def test_a_hand_by_topic_moves_its_traps_and_the_topics_say_so():
    pytest.importorskip("rosbags")
    from otwarp.ros.ros1.bridge import Ros1Bridge
    from otwarp.ros.ros1.messages import types

    clock, node, lines = VirtualClock(), LocalNode(), []
    loop = LiveLoop(three_beads(), clock=clock, rate=RATE, device="cpu")
    config = ContractConfig(scene_unit=2.0, motion_gain=0.05)
    bridge = Ros1Bridge(node, config, clock=clock.now, stamp=clock.now)
    roles = roles_of(loop)
    loop.add(Ros1Sink(node, bridge, roles, say=lines.append, clock=clock.now))
    loop.start()
    run(loop, clock, 0.1)
    t = types()
    twist = t.Twist(t.Vector3(40.0, 0.0, 0.0), t.Vector3(0.0, 0.0, 0.0))
    for _ in range(60):
        node.say("/GeomagicRight/smoothed_twist", twist)
        run(loop, clock, 1.0 / RATE)
    live = run(loop, clock, 0.3)
    # 40 mm/s · 0.05 · 2 µm for a second, and 0.1 s more until the twist counts as old
    moved = live.frame.trap_position[0] - np.array(list(PLACES.values()))
    assert moved[1] == pytest.approx((4.0 * 1.1, 0.0, 0.0), abs=4.0 * 1.5 / RATE)
    assert np.allclose(moved[[0, 2]], 0.0, atol=1e-5)
    second = node.sent["/secondOTposition"][-1].transforms[0].transform.translation
    robot = node.sent["/robot02"][-1].transforms[0].transform.translation
    # published in the device's axes (x right, y up, z towards the user), in units of 2 µm
    x, y, z = live.frame.trap_position[0, 1] / 2.0
    assert (second.x, second.y, second.z) == pytest.approx((x, z, -y), abs=1e-6)
    assert robot.x == pytest.approx(second.x, abs=0.01)
    assert len(node.sent["/firstOTposition"]) == pytest.approx(1.4 * 60, abs=3)
    assert "/DynaOb01" not in node.sent and not lines
    loop.do(Pause(True))
    run(loop, clock, 2.0 / RATE)
    node.say("/GeomagicRight/smoothed_twist", twist)
    run(loop, clock, 0.3)
    loop.do(Pause(False))
    still = run(loop, clock, 0.1)
    assert np.array_equal(still.frame.trap_position, live.frame.trap_position)  # what came in the pause moved nothing
    node.log.note("md5", "md5sum of /robot01 is 1, subscriber has 2")
    node.log.count("dropped")
    run(loop, clock, 0.1)
    assert lines == ["ros1: md5: md5sum of /robot01 is 1, subscriber has 2"]
    for _ in range(LINES + 5):
        node.log.note("refused", "a peer that comes again and again")
    node.log.note("master", "gone; topics that are connected go on without it (refused)")
    run(loop, clock, 0.1)
    node.log.note("master", "back; registered anew, topics published: 9, subscribed: 2")
    run(loop, clock, 0.1)
    assert len(lines) == LINES + 2 and lines[-2].startswith("ros1: master: gone; topics")
    assert lines[-1] == "ros1: master: back; registered anew, topics published: 9, subscribed: 2"
    lines.clear()
    node.close()
    run(loop, clock, 0.1)
    assert lines == ["ros1: the node was shut down through ROS; the session goes on without it"]
    loop.close()
    alone = Ros1Sink(node, bridge, roles, say=lines.append, clock=clock.now, alone=True)
    assert alone.commands() == [Stop()]


class Bridge2:
    """A ROS 2 bridge that is asked what the test says."""

    def __init__(self) -> None:
        self.said: list[TopicState] = []
        self.asked = Ros2Commands()
        self.fails: InputError | None = None

    def publish(self, now: float, state: TopicState) -> bool:
        if self.fails is not None:
            raise self.fails
        self.said.append(state)
        return True

    def commands(self, now: float) -> Ros2Commands:
        asked, self.asked = self.asked, Ros2Commands()
        return asked


def test_a_controller_moves_turns_and_resets_the_pair():
    clock, node, bridge = VirtualClock(), LocalNode(), Bridge2()
    loop = LiveLoop(three_beads(), clock=clock, rate=RATE, device="cpu")
    lines: list[str] = []
    sink = Ros2Sink(node, bridge, roles_of(loop), say=lines.append, clock=clock.now)
    loop.add(sink)
    loop.start()
    run(loop, clock, 0.1)
    bridge.asked = Ros2Commands(shift=(1.0, -2.0), angle=math.pi / 2.0, hands=((0.0, 0.0, 0.5), (0.0, 0.0, 0.0)))
    live = run(loop, clock, 0.1)
    # (∓8, 0) turned by a quarter about their midpoint, then shifted; the first group also rises
    want = [(1.0, -10.0, 5.5), (1.0, 6.0, 5.0), PLACES["none"]]
    assert live.frame.trap_position[0] == pytest.approx(np.array(want), abs=1e-4)
    assert bridge.said[-1].traps[0][0] == pytest.approx(want[0], abs=1e-4)
    bridge.asked = Ros2Commands(shift=(9.0, 9.0), reset=True)
    live = run(loop, clock, 0.1)
    assert live.frame.time < 0.12 and live.frame.trap_position[0, 0] == pytest.approx(PLACES["left"])
    loop.do(Pause(True))
    run(loop, clock, 2.0 / RATE)
    bridge.asked = Ros2Commands(shift=(9.0, 9.0), hands=((9.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    run(loop, clock, 0.1)
    loop.do(Pause(False))
    live = run(loop, clock, 0.1)
    assert live.frame.trap_position[0, 0] == pytest.approx(PLACES["left"])  # what came in the pause moved nothing
    bridge.fails = InputError("robot01 is (nan, 0.0, 0.0); allowed: finite")
    run(loop, clock, 1.0 / RATE)
    bridge.fails = None
    run(loop, clock, 0.1)
    assert lines.pop() == "ros2: robot01 is (nan, 0.0, 0.0); allowed: finite" and not lines
    for _ in range(LINES + 5):
        sink.complain("no")
    assert len(lines) == LINES - 1 and lines[-1] == "no (no more of these are shown)"
    loop.close()
