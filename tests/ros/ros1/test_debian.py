"""Our client against Debian's ROS: its master, its message classes, and nodes by its rospy.

Skipped with a reason where the packages are absent; with OTWARP_REQUIRE_ROS1=1 that is a failure.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.haptics.devices.ros1 import find_devices
from otwarp.ros.contract import HAND_TYPES, ROBOT_TOPICS, TRAP_TOPICS, ContractConfig
from otwarp.ros.ros1.bridge import Ros1Bridge
from otwarp.ros.ros1.messages import message_type
from otwarp.ros.ros1.node import Ros1Node

from .conftest import RealMaster
from .golden import MD5, bytes_of, message_of
from .setups import PATIENCE, expect_soon

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
TWIST = "geometry_msgs/Twist"
PRINTED = 5e-4
"""Half of the last digit of 1.312 N."""


class Peer:
    """A process of `rospy_peer.py`, ready."""

    def __init__(self, python: str, master: RealMaster, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [python, str(HERE / "rospy_peer.py"), *arguments],
            env=master.environment | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        try:
            self.process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()


def test_md5_and_bytes_are_those_of_debians_classes(rospy_python, real_master):
    bodies = {name: bytes_of(name).hex() for name in MD5}
    done = subprocess.run(
        [rospy_python, str(HERE / "rospy_peer.py"), "facts"],
        input=json.dumps(bodies),
        env=real_master.environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == {name: [MD5[name], bodies[name]] for name in MD5}


def test_a_rospy_node_reads_and_writes_every_type(rospy_python, real_master):
    """Each golden message goes to a rospy node and comes back."""
    with Peer(rospy_python, real_master, "echo"), Ros1Node("ours", real_master.uri) as node:
        for n, name in enumerate(("tf2_msgs/TFMessage", TWIST, *(m for m in MD5 if m.split("/")[1][0] in "PJD"))):
            kind, heard = message_type(name), node.subscribe(f"/from/t{n}", name)
            out = node.publisher(f"/to/t{n}", name)
            expect_soon(lambda heard=heard, out=out: heard.connections == 1 and out.connections == 1, name)
            # again and again: rospy counts a subscriber a moment after it has answered it
            expect_soon(
                lambda heard=heard, out=out, name=name: (out.publish(message_of(name)), heard.received)[1], name
            )
            # rospy counts the sequence number of a leading header itself
            start = 4 if name in ("geometry_msgs/PoseStamped", "sensor_msgs/JointState", "sensor_msgs/Joy") else 0
            assert kind.encode(heard.take())[start:] == bytes_of(name)[start:]
        assert not node.log.counts


def test_the_releases_force_on_a_rospy_node(rospy_python, real_master):
    """Border → rospy node with the release's chain → device: 1.312 N after 99 messages at a twentieth."""
    config = ContractConfig(scene_unit=25.0)
    hand = config.hands()[0]
    arguments = (hand.namespace, TRAP_TOPICS[0], ROBOT_TOPICS[0])
    with Peer(rospy_python, real_master, "force", *arguments), Ros1Node("sim", real_master.uri) as sim:
        bridge, felt = Ros1Bridge(sim, config), []
        with Ros1Node("touch", real_master.uri) as touch:
            touch.subscribe(hand.topic("force_feedback"), HAND_TYPES["force_feedback"], felt.append)
            trap, robot = bridge._out[TRAP_TOPICS[0]], bridge._out[ROBOT_TOPICS[0]]
            expect_soon(lambda: trap.connections == robot.connections == 1)
            assert bridge.publish(0.0, ((0.0, 0.0, 5.0),), (None,))
            for n in range(1, 100):
                bridge.publish(n / 60.0 + 1e-6, (None,), (((0.0, 0.0, 6.25), (0.0, 0.0, 0.0, 1.0)),))
                expect_soon(lambda n=n: len(felt) == n, "a force")
            force = felt[-1].force
            assert (force.x, force.y, force.z) == pytest.approx((0.0, 1.312, 0.0), abs=PRINTED)


def test_the_master_knows_what_we_publish_until_we_close(real_master, monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", real_master.uri)
    with Ros1Node("driver") as node:
        node.publisher("/GeomagicLeft/pose", "geometry_msgs/PoseStamped")
        assert find_devices() == ("ros1:/GeomagicLeft  (publishes geometry_msgs/PoseStamped)",)
    assert find_devices() == ()


def test_the_master_shuts_down_the_older_of_two_namesakes(real_master):
    with Ros1Node("same", real_master.uri) as older, Ros1Node("same", real_master.uri) as newer:
        older.publisher("/t", TWIST)
        newer.publisher("/t", TWIST)
        expect_soon(lambda: not older.alive)
        assert newer.alive


def test_a_restarted_master_hears_of_all_again(real_master, tmp_path):
    master = RealMaster(tmp_path)
    try:
        with Ros1Node("a", master.uri, poll=0.1) as a, Ros1Node("b", master.uri, poll=0.1) as b:
            out, heard = a.publisher("/t", TWIST), b.subscribe("/t", TWIST)
            expect_soon(lambda: out.connections == 1 and heard.connections == 1)
            master.stop()
            expect_soon(lambda: not a.master_there and not b.master_there)
            with pytest.raises(InputError, match="ROS_MASTER_URI is"):
                Ros1Node("c", master.uri)
            master.start()
            expect_soon(lambda: a.master_there and b.master_there)
            with Ros1Node("c", master.uri) as c:
                late = c.subscribe("/t", TWIST)
                expect_soon(lambda: out.connections == 2)
                out.publish(message_of(TWIST))
                expect_soon(lambda: late.received == 1 and heard.received == 1)
    finally:
        master.stop()
