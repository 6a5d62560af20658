"""`otwarp ros1` and `otwarp ros2` as a user starts them: heard, moved and ended from outside.

ROS 1 goes through Debian's master: without it these tests skip, with OTWARP_REQUIRE_ROS1=1 they fail.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import otwarp as ot
from otwarp.ros.ros1.messages import types
from otwarp.ros.ros1.node import Ros1Node
from otwarp.ros.ros1.rpc import call
from tests.ros.ros1 import conftest as debian
from tests.ros.ros1.conftest import RealMaster
from tests.ros.ros2.setups import loopback

ROOT = Path(__file__).resolve().parents[2]
SCENE = "scenes/teleop_small.usda"
UNIT = 25.0
"""Default of --scene-unit [µm]."""
GAIN = 0.004
"""Default of --control-gain [scene units per mm]."""

PATIENCE = 240.0
"""Seconds after which what must happen is called missing: kernels may have to be compiled first; the command itself
would end later."""
LONGEST = 4 * PATIENCE
"""--duration of a session [s]: beyond all that a test waits for, so that it is SIGINT that ends it."""

HAND = 30.0
"""Speed of the hand [mm/s]: 3 µm/s of trap, which its robot follows with a small part of the trap's reach between."""
PAIR = 0.1
"""Speed of the pair [scene units/s]: 2.5 µm/s, so that even the half second it holds without news is no leap."""
WAY = 0.08
"""What the traps must have moved [scene units]: 2 µm, ninety times the robot's thermal motion in them."""
NEAR = 0.012
"""Distance in the plane at which a robot is with its traps [scene units]: 0.3 µm, some 13 σ of three traps of
2.8 pN/µm, and a seventh of `WAY`."""
EXACT = 1e-5
"""Places of traps [scene units]: traps are kept in single precision, some 1e-7 of 40 µm."""
FREE = 0.1
"""How far the free cell may be from where it was authored when it is first heard [scene units]: 2.5 µm, while it
diffuses by less than 0.5 µm in a second."""

debian_master = debian.real_master
"""The fixture, for this module: rosmaster, or the reason why there is none."""

Vector = np.ndarray
"""(3,)"""


class Command:
    """A running `otwarp`.

    Args:
        process: With its output in a pipe.
    """

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Wait for something that the command must bring about."""
        end = time.monotonic() + PATIENCE
        while not condition():
            if self._process.poll() is not None:
                raise AssertionError(f"the command ended before {what}: {self._process.communicate()[0]}")
            assert time.monotonic() < end, f"waited {PATIENCE:g} s for {what}"
            time.sleep(0.005)

    def interrupt(self) -> str:
        """Ctrl-C; returns what it said in its life.

        Raises:
            AssertionError: It had ended before, or ends with another exit code than 0.
        """
        assert self._process.poll() is None, self._process.communicate()[0]
        self._process.send_signal(signal.SIGINT)
        said, _ = self._process.communicate(timeout=PATIENCE)
        assert self._process.returncode == 0, said
        return said


@contextmanager
def otwarp(*arguments: str, environment: Mapping[str, str] | None = None) -> Iterator[Command]:
    """A live session of the scene, killed at the end if it still runs."""
    command = [sys.executable, "-m", "otwarp", arguments[0], SCENE, "--budget", "off", "--device", "cpu"]
    command += ["--duration", f"{LONGEST:g}", *arguments[1:]]
    # a runner in the background ignores SIGINT, and so would its children
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
    finally:
        signal.signal(signal.SIGINT, before)
    with process:
        try:
            yield Command(process)
        finally:
            process.kill()


def authored(hand: str) -> Vector:
    """Where a hand's upright traps hold in the file, on average (3,) [scene units, axes of the scene]."""
    traps = [trap for trap in ot.Scene.load(ROOT / SCENE).traps if trap.hand == hand]
    heights = [np.array((0.0, 0.0, trap.equilibrium)) for trap in traps]
    return (np.mean([trap.position.at(0.0) for trap in traps], axis=0) + np.mean(heights, axis=0)) / UNIT


def as_published(place: Vector) -> Vector:
    """Axes of the scene (x right, y away, z up) to those of the devices (x right, y up, z towards the user)."""
    x, y, z = place
    return np.array([x, z, -y])


class Places:
    """What was heard on a topic, in order.

    Attributes:
        messages: All.
    """

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self.messages: list[Any] = []

    def __call__(self, message: Any) -> None:
        """Keep a message."""
        self.messages.append(message)

    def all(self) -> np.ndarray:
        """Where it was, (n, 3) [scene units]; each message has exactly one transform, named as its topic."""
        messages = list(self.messages)
        assert all(len(message.transforms) == 1 for message in messages)
        assert {message.transforms[0].child_frame_id for message in messages} <= {self._topic.strip("/")}
        places = (message.transforms[0].transform.translation for message in messages)
        return np.array([(place.x, place.y, place.z) for place in places]).reshape(-1, 3)

    def times(self) -> np.ndarray:
        """Stamps (n,) [s]; of ROS 2."""
        stamps = (message.transforms[0].header.stamp for message in self.messages)
        return np.array([stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps])

    def now(self) -> Vector:
        """Where it is (3,) [scene units]."""
        place = self.messages[-1].transforms[0].transform.translation
        return np.array([place.x, place.y, place.z])


def together(robot: Places, trap: Places, plane: tuple[int, int]) -> bool:
    """Whether a robot is with its traps; along the beam they are weak."""
    return bool(np.linalg.norm((robot.now() - trap.now())[list(plane)]) < NEAR)


def registered(master: RealMaster, node: str) -> set[str]:
    """Topics that a node publishes or subscribes to, of the master's books."""
    publishers, subscribers, _ = call(master.uri, "getSystemState", "/test")
    return {topic for topic, nodes in (*publishers, *subscribers) if node in nodes}


def check_a_hand_moves_the_first_group(
    master: RealMaster, options: tuple[str, ...], twist: str, hands: tuple[str, str]
) -> None:
    """The session as a device node and a listener on the same master see it.

    Args:
        master: Debian's.
        options: Of the command.
        twist: Topic of the hand of the first group.
        hands: Of the scene's traps: those of the first and of the second group.
    """
    names = ("/firstOTposition", "/secondOTposition", "/robot01", "/robot02", "/xform")
    heard = {name: Places(name) for name in names}
    first, second, robot, other, middle = heard.values()
    start, stays = (as_published(authored(name)) for name in hands)
    t = types()
    motion = t.Twist(t.Vector3(HAND, 0.0, 0.0), t.Vector3(0.0, 0.0, 0.0))
    session = otwarp("ros1", *options, environment=master.environment)
    with session as command, Ros1Node("peer", master.uri, "127.0.0.1") as node:
        for name, places in heard.items():
            node.subscribe(name, "tf2_msgs/TFMessage", places)
        hand = node.publisher(twist, "geometry_msgs/Twist")
        command.until(lambda: all(p.messages for p in heard.values()) and hand.connections, "topics and the hand")
        assert first.now() == pytest.approx(start, abs=EXACT)
        assert together(robot, first, (0, 2)) and together(other, second, (0, 2))
        began = time.monotonic()
        command.until(lambda: hand.publish(motion) or first.now()[0] - start[0] > WAY, "a moved trap")
        # no farther than the velocity takes it in the time since the first twist, however slow this machine is
        assert first.now()[0] - start[0] <= GAIN * HAND * (time.monotonic() - began)
        # nobody publishes a twist now, so all come to rest
        command.until(lambda: together(robot, first, (0, 2)) and robot.now()[0] - start[0] > WAY - NEAR, "the robot")
        command.until(lambda: np.allclose(middle.now(), (robot.now() + other.now()) / 2, 0.0, NEAR), "the midpoint")
        assert np.ptp(first.all()[:, 1:], axis=0) == pytest.approx(0.0, abs=EXACT)
        assert np.abs(second.all() - stays).max() < EXACT
        assert together(other, second, (0, 2))
        assert all(len(places.all()) for places in heard.values())
        assert not node.log.counts
        assert {*names, twist} <= registered(master, "/otwarp")
        assert "session" in command.interrupt()
        assert registered(master, "/otwarp") == set()


@pytest.mark.thorough
def test_ros1_a_twist_moves_trap_and_robot(debian_master):
    twist = "/GeomagicLeft/smoothed_twist"
    check_a_hand_moves_the_first_group(debian_master, (), twist, ("left", "right"))


@pytest.mark.thorough
def test_ros1_the_older_pairing_gives_the_right_hand_the_first_group(debian_master):
    twist = "/Geomagic2/smoothedTwist"
    check_a_hand_moves_the_first_group(debian_master, ("--pairing", "older"), twist, ("right", "left"))


@pytest.mark.thorough
def test_ros2_a_controller_moves_the_pair_and_resets(monkeypatch):
    pytest.importorskip("cyclonedds")
    from otwarp.ros.ros2 import Ros2Node, load_messages

    m: Any = load_messages()
    domain = loopback(monkeypatch)
    start, beside = authored("left"), authored("right")
    (place,) = (np.array(b.position) / UNIT for b in ot.Scene.load(ROOT / SCENE).bodies if b.kind == "cell")
    names = ("/firstOTposition", "/secondOTposition", "/robot01", "/robot02", "/xform", "/object")
    heard = {name: Places(name) for name in names}
    first, second, robot, other, middle, cell = heard.values()
    west = m.Twist(m.Vector3(-PAIR, 0.0, 0.0), m.Vector3(0.0, 0.0, 0.0))
    level = m.Twist(m.Vector3(0.0, 0.0, 0.0), m.Vector3(1.0, 0.0, 0.0))
    with otwarp("ros2", "--domain", str(domain)) as command, Ros2Node("peer", domain) as node:
        sources = {name: node.subscribe(name, m.TFMessage) for name in names}
        velocity, reset = (node.publisher(name, m.Twist) for name in ("/rl_vel", "/resetSignal"))

        def _pump() -> bool:
            for name, source in sources.items():
                heard[name].messages += source.take()
            return all(places.messages for places in heard.values())

        command.until(lambda: _pump() and velocity.matched and reset.matched, "topics and the controller")
        assert first.now() == pytest.approx(start, abs=EXACT) and second.now() == pytest.approx(beside, abs=EXACT)
        assert cell.all()[0] == pytest.approx(place, abs=FREE)
        assert cell.messages[0].transforms[0].transform.rotation.y == 1.0  # not lost

        began = time.monotonic()
        command.until(
            lambda: (velocity.publish(west), _pump(), start[0] - first.now()[0] > WAY)[-1], "a moved first trap"
        )
        assert start[0] - first.now()[0] <= PAIR * (time.monotonic() - began)
        # no more commands: the pair stops, both traps as far from where they began
        command.until(
            lambda: _pump() and np.allclose(first.now() - start, second.now() - beside, 0.0, EXACT), "a moved pair"
        )
        assert first.now()[1:] == pytest.approx(start[1:], abs=EXACT)
        command.until(
            lambda: _pump() and together(robot, first, (0, 1)) and together(other, second, (0, 1)), "the robots"
        )
        command.until(
            lambda: _pump() and np.allclose(middle.now(), (robot.now() + other.now()) / 2, 0.0, NEAR), "the midpoint"
        )
        assert middle.now()[0] < (start[0] + beside[0]) / 2 - WAY + NEAR

        command.until(
            lambda: (reset.publish(level), _pump(), np.allclose(first.now(), start, 0.0, EXACT))[-1], "a reset"
        )
        command.until(lambda: _pump() and np.allclose(second.now(), beside, 0.0, EXACT), "the other trap")
        command.until(
            lambda: _pump() and together(robot, first, (0, 1)) and together(other, second, (0, 1)), "robots back"
        )
        # simulated time began anew, and once: the signal was sent again and again but rose only once
        assert np.sum(np.diff(first.times()) < 0.0) == 1
        assert all(len(places.all()) for places in heard.values())
        assert sum(source.malformed for source in sources.values()) == 0
        assert "session" in command.interrupt()
