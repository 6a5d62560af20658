"""ROS as a sink of a live session: a real loop and real bridges, a node that keeps what it is given."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.haptics.core.clock import VirtualClock
from otwarp.ros.contract import ContractConfig
from otwarp.ros.roles import Roles
from otwarp.ros.ros2.bridge import Ros2Commands
from otwarp.ros.sinks import LINES, Ros1Sink, Ros2Sink
from otwarp.ros.touching import gap
from otwarp.scene.description import Obstacle, Scene
from otwarp.scene.track import Track
from otwarp.teleop.core.commands import Pause, Stop
from otwarp.teleop.session.live import LiveLoop
from tests.ros.ros1.setups import LocalNode
from tests.teleop.scenes import PLACES, three_beads

SCENES = Path(__file__).resolve().parents[2] / "scenes"
RATE = 60.0
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def twin_of(loop: LiveLoop, pairing: str = "release") -> Roles:
    model = loop.sim.model
    return Roles.of(model.scene, model.held, pairing)


def run(loop: LiveLoop, clock: VirtualClock, seconds: float):
    live = None
    for _ in range(round(seconds * RATE)):
        live = loop.tick()
        clock.advance(1.0 / RATE)
    assert live is not None
    return live


def test_a_hand_by_topic_moves_its_traps_and_the_topics_say_so():
    pytest.importorskip("rosbags")
    from otwarp.ros.ros1.bridge import Ros1Bridge
    from otwarp.ros.ros1.messages import types

    clock, node, lines = VirtualClock(), LocalNode(), []
    loop = LiveLoop(three_beads(), clock=clock, rate=RATE, device="cpu")
    config = ContractConfig(scene_unit=2.0, motion_gain=0.05)
    bridge = Ros1Bridge(node, config, clock=clock.now, stamp=clock.now)
    roles = twin_of(loop)
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
        self.said: list[dict[str, Any]] = []
        self.asked = Ros2Commands()
        self.fails: InputError | None = None

    def publish(self, now: float, **state: Any) -> bool:
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
    sink = Ros2Sink(node, bridge, twin_of(loop), say=lines.append, clock=clock.now)
    loop.add(sink)
    loop.start()
    run(loop, clock, 0.1)
    bridge.asked = Ros2Commands(shift=(1.0, -2.0), angle=math.pi / 2.0, hands=((0.0, 0.0, 0.5), (0.0, 0.0, 0.0)))
    live = run(loop, clock, 0.1)
    # (∓8, 0) turned by a quarter about their midpoint, then shifted; the first group also rises
    want = [(1.0, -10.0, 5.5), (1.0, 6.0, 5.0), PLACES["none"]]
    assert live.frame.trap_position[0] == pytest.approx(np.array(want), abs=1e-4)
    assert bridge.said[-1]["traps"][0][0] == pytest.approx(want[0], abs=1e-4)
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


def test_the_twin_of_the_cell_delivery():
    scene = Scene.load(SCENES / "cell_delivery.usda")
    clock, node, bridge = VirtualClock(), LocalNode(), Bridge2()
    loop = LiveLoop(scene, clock=clock, rate=RATE, device="cpu")
    twin = twin_of(loop)
    names = [scene.bodies[b].name for b in twin.robots]
    assert [name.rsplit("/", 1)[-1] for name in names] == ["left", "right"]
    assert twin.cell is not None and scene.bodies[twin.cell].kind == "cell"
    assert twin_of(loop, "older").groups == twin.groups[::-1]
    assert all(o.position.animated for o in twin.obstacles) and 1 <= len(twin.obstacles) <= 4
    loop.add(Ros2Sink(node, bridge, twin, clock=clock.now))
    loop.start()
    live = run(loop, clock, 0.2)
    said = bridge.said[-1]
    assert said["cell"] == pytest.approx(tuple(live.frame.position[0, twin.cell]))
    assert said["contact_force"] == pytest.approx(float(live.frame.contact_load[0, twin.cell]))
    assert said["cell_lost"] is False and said["collision"] is False and len(said["hits"]) == len(twin.obstacles)
    # put the first obstacle where the cell is: it is hit, by as much as presses on the cell or a robot
    there = Track.constant(said["cell"])
    at_cell = replace(twin, obstacles=(replace(twin.obstacles[0], position=there), *twin.obstacles[1:]))
    now = at_cell.now(live)
    assert now.hits[0][0] and now.hits[0][1] == pytest.approx(live.frame.contact_load[0].max(), rel=1e-6)
    far = replace(live, frame=replace(live.frame, position=live.frame.position + 0.0))
    far.frame.position[0, twin.cell] += 500.0
    assert twin.now(far).cell_lost
    loop.close()


def test_a_scene_without_two_hands_is_refused():
    scene = three_beads()
    one = replace(scene, traps=scene.traps[1:])
    with pytest.raises(InputError, match="no trap of the left hand has ot:trap:hand = 'left'; allowed: two hands"):
        Roles.of(one, [(0, 0), (1, 0)])
    with pytest.raises(InputError, match="no trap of the left hand holds a sphere"):
        Roles.of(scene, [(-1, -1), (0, 0), (1, 0)])


@pytest.mark.parametrize(
    ("shape", "size", "points", "gaps"),
    [
        ("sphere", (2.0, 0.0, 0.0), [(3.0, 0.0, 0.0), (0.0, 0.0, 0.0)], [1.0, -2.0]),
        ("box", (1.0, 2.0, 3.0), [(4.0, 6.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 5.0)], [5.0, -0.5, 2.0]),
        ("cylinder", (1.0, 2.0, 0.0), [(4.0, 0.0, 6.0), (0.0, 0.0, 1.5), (0.0, 3.0, 0.0)], [5.0, -0.5, 2.0]),
        ("capsule", (1.0, 2.0, 0.0), [(0.0, 0.0, 5.0), (0.0, 3.0, 1.0), (0.0, 0.0, 0.0)], [2.0, 2.0, -1.0]),
        ("plane", (0.0, 0.0, 0.0), [(9.0, 9.0, 2.0), (0.0, 0.0, -1.0)], [2.0, -1.0]),
    ],
)
def test_gaps_from_shapes(shape, size, points, gaps):
    obstacle = Obstacle(
        prim="/o", shape=shape, size=size, position=Track.constant((0.0,) * 3), orientation=Track.constant(UPRIGHT)
    )
    assert gap(obstacle, ((0.0, 0.0, 0.0), UPRIGHT), np.array(points)) == pytest.approx(gaps)
    # a quarter turn about x: the shape's z is the world's −y
    quarter = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    moved = [(x + 1.0, 2.0 - z, 3.0 + y) for x, y, z in points]
    assert gap(obstacle, ((1.0, 2.0, 3.0), quarter), np.array(moved)) == pytest.approx(gaps)
