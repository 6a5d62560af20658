"""A Touch behind its driver: readings on a virtual clock, and one round over the wire with a driver double."""

from __future__ import annotations

import itertools
import math
import socket
from functools import partial

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.haptics.core import Device, DeviceLost
from otwarp.haptics.devices import create_device, parse_devices
from otwarp.haptics.devices.ros1 import SILENCE, Ros1Device, find_devices
from otwarp.haptics.servo.link import HandSetup
from otwarp.haptics.servo.process import ServoProcess
from otwarp.ros.ros1.messages import types
from otwarp.ros.ros1.node import Ros1Node
from tests.haptics.setups import chain_for, hand_config, scene_at

from .setups import LocalNode, expect_soon

NS = "/GeomagicLeft"
PERIOD = 1e-3
FELT = 1e-3
"""N; passivity control leaves a hand at rest twice that if poses come 100 ms late, as they do on a busy machine."""


def pose(x: float, y: float, z: float):
    t = types()
    return t.PoseStamped(t.Header(0, t.Time(0, 0), "world"), t.Pose(t.Point(x, y, z), t.Quaternion(0.0, 0.0, 0.0, 1.0)))


def joy(*buttons: int):
    t = types()
    return t.Joy(t.Header(0, t.Time(0, 0), ""), np.zeros(6, np.float32), np.array(buttons, np.int32))


class Speaking(LocalNode):
    """A node on which the driver speaks as soon as it is subscribed to."""

    def subscribe(self, topic, type_name, callback=None):
        heard = super().subscribe(topic, type_name, callback)
        if topic.endswith("/pose"):
            self.say(topic, pose(10.0, -20.0, 30.0))
        return heard


@pytest.fixture
def opened():
    node = Speaking()
    device = Ros1Device(NS, connect=lambda name: node)
    device.open()
    return device, node


def test_millimetres_become_metres(opened):
    device, _ = opened
    sample = device.read(0.0)
    assert sample.position == pytest.approx((0.010, -0.020, 0.030), abs=1e-15)
    assert sample.fresh and sample.buttons == 0
    assert not device.read(PERIOD).fresh
    assert isinstance(device, Device) and device.info.kind == "ros1"


def test_buttons_of_both_topics(opened):
    device, node = opened
    for buttons, bits in (((1, 0), 1), ((0, 1), 2), ((1, 1), 3), ((0, 0), 0), ((), 0), ((0, 0, 1), 0)):
        node.say(f"{NS}/joy", joy(*buttons))
        assert device.read(0.0).buttons == bits
    node.say(f"{NS}/button", types().DeviceButtonEvent(1, 1))
    assert device.read(0.0).buttons == 3
    node.say(f"{NS}/button", types().DeviceButtonEvent(0, 1))
    assert device.read(0.0).buttons == 2


def test_silence_is_loss(opened):
    device, node = opened
    device.read(0.0)
    assert not device.read(SILENCE).fresh
    node.say(f"{NS}/pose", pose(1.0, 2.0, 3.0))
    assert device.read(SILENCE + PERIOD).fresh
    device.read(2.0 * SILENCE)
    with pytest.raises(DeviceLost, match=r"no pose for 0\.5 s"):
        device.read(2.0 * SILENCE + 2 * PERIOD)


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e5])
def test_poses_that_are_none_are_no_word(opened, bad):
    device, node = opened
    device.read(0.0)
    node.say(f"{NS}/pose", pose(0.0, bad, 0.0))
    sample = device.read(0.4)
    assert sample.position == pytest.approx((0.010, -0.020, 0.030)) and not sample.fresh
    with pytest.raises(DeviceLost):
        device.read(SILENCE + PERIOD)


def test_force_goes_out_with_three_open_locks(opened):
    device, node = opened
    device.write((0.1, -0.2, 0.3))
    (message,) = node.sent[f"{NS}/force_feedback"]
    assert (message.force.x, message.force.y, message.force.z) == (0.1, -0.2, 0.3)
    assert (message.position.x, message.position.y, message.position.z) == (0.0, 0.0, 0.0)
    assert list(message.lock) == [False, False, False]


def test_closing_ends_with_zero_force(opened):
    device, node = opened
    device.write((1.0, 0.0, 0.0))
    device.close()
    device.close()
    assert [m.force.x for m in node.sent[f"{NS}/force_feedback"]] == [1.0, 0.0]
    assert not node.alive
    for call in (lambda: device.read(0.0), lambda: device.write((0.0, 0.0, 0.0))):
        with pytest.raises(DeviceLost, match="not open"):
            call()


def test_a_node_that_was_shut_down_is_a_lost_device(opened):
    device, node = opened
    node.close()
    with pytest.raises(DeviceLost, match="shut down"):
        device.read(0.0)


def test_no_pose_is_one_line():
    node = LocalNode()
    with pytest.raises(InputError, match=r"device 'ros1:/a': no geometry_msgs/PoseStamped on /a/pose within 0 s"):
        Ros1Device("a", connect=lambda name: node, wait=0.0).open()
    assert not node.alive


@pytest.mark.parametrize("text", ["ros1:", "ros1:/", "ros1:a b", "ros1:/1a", "ros1:a//b", "ros1:é"])
def test_bad_namespaces(text):
    with pytest.raises(InputError, match="namespace"):
        create_device(parse_devices([text])[0])


def test_two_hands_need_two_namespaces():
    assert len(parse_devices(["ros1:/GeomagicLeft", "ros1:/GeomagicRight"])) == 2
    with pytest.raises(InputError, match="both hands name it"):
        parse_devices(["ros1:/GeomagicLeft", "ros1:/GeomagicLeft"])
    with pytest.raises(InputError, match="both hands name it"):
        parse_devices(["ros1:/GeomagicLeft", "ros1:GeomagicLeft"])


def test_no_master_is_one_line(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
    with pytest.raises(InputError, match=f"ROS_MASTER_URI is 'http://127.0.0.1:{port}': no ROS master"):
        create_device(parse_devices([f"ros1:{NS}"])[0]).open()
    assert find_devices() == ()


def test_over_the_wire_with_a_driver_double(master, monkeypatch):
    """A node publishes as the driver does and takes the forces: lost when it goes, found again when it is back."""
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    device = create_device(parse_devices([f"ros1:{NS}"])[0])
    for turn in (1.0, 2.0):
        forces = []
        with Ros1Node("driver", poll=0.05) as driver:
            out = driver.publisher(f"{NS}/pose", "geometry_msgs/PoseStamped", latch=True)
            driver.publisher(f"{NS}/elsewhere", "geometry_msgs/PoseStamped")
            buttons = driver.publisher(f"{NS}/button", "geomagic_control/DeviceButtonEvent", latch=True)
            driver.subscribe(f"{NS}/force_feedback", "geomagic_control/DeviceFeedback", forces.append)
            out.publish(pose(100.0 * turn, 0.0, 0.0))
            buttons.publish(types().DeviceButtonEvent(1, 0))
            assert find_devices() == (f"ros1:{NS}  (publishes geometry_msgs/PoseStamped)",)
            device.open()
            expect_soon(lambda: device.read(0.0).buttons == 1)
            assert device.read(0.0).position[0] == pytest.approx(0.1 * turn)

            def felt(force: float, forces=forces) -> bool:
                device.write((0.0, force, 0.0))
                return bool(forces) and forces[-1].force.y == force

            expect_soon(lambda turn=turn, felt=felt: felt(0.25 * turn), "the force")
            if turn == 2.0:
                device.close()
                expect_soon(lambda forces=forces: forces[-1].force.y == 0.0, "zero force at the end")
        if turn == 1.0:
            with pytest.raises(DeviceLost):
                device.read(10.0)


def test_a_servo_renders_to_a_ros_device_and_ends_with_zero_force(master, monkeypatch):
    """The servo's own process holds the device: the driver hears the force of a spring, then zero."""
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    forces = []
    hand = hand_config(motion_gain=100.0, force_gain=0.05)
    with Ros1Node("driver") as driver:
        out = driver.publisher(f"{NS}/pose", "geometry_msgs/PoseStamped", latch=True)
        driver.subscribe(f"{NS}/force_feedback", "geomagic_control/DeviceFeedback", forces.append)
        out.publish(pose(0.0, 0.0, 0.0))
        beats = itertools.count(1)
        with ServoProcess([HandSetup(f"ros1:{NS}", partial(chain_for, hand))], spheres=1, traps=1) as servo:

            def pulls() -> bool:
                """A hand at rest, its trap 0.3 µm beside the sphere; armed again if a busy machine let it disarm."""
                beat = next(beats)
                servo.publish(scene_at(beat, beat * PERIOD, sphere=(0.3, 0.0, 0.0)))
                out.publish(pose(0.0, 0.0, 1e-6 * beat))
                now = servo.hand(0)
                if now is not None and now.state == "disarmed":
                    servo.arm()
                return any(abs(message.force.x) > FELT for message in forces)  # it may have fallen again by now

            expect_soon(pulls, "a force")
        expect_soon(lambda: forces[-1].force.x == 0.0, "zero force at the end")
