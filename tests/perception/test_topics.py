"""Image topics of ROS 1 and ROS 2 as cameras: published by this package's own nodes, no driver of a camera."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.perception.kinds import make_camera
from tests.ros.ros1.setups import MasterDouble
from tests.ros.ros2.setups import loopback

LEVELS = np.arange(48, dtype=np.uint8).reshape(6, 8)
PATIENCE = 20.0


def image_message(types, stamp: float):
    """A `sensor_msgs/Image` of the levels, with a byte of padding behind each row."""
    padded = np.zeros((6, 9), dtype=np.uint8)
    padded[:, :8] = LEVELS[::-1]
    head = types.Header(
        stamp=types.Time(sec=int(stamp), nanosec=round(1e9 * (stamp % 1.0))), frame_id="", **types.extra
    )
    return types.Image(
        header=head, height=6, width=8, encoding="mono8", is_bigendian=0, step=9, data=types.bytes(padded)
    )  # fmt: skip


def types_of_ros2() -> SimpleNamespace:
    """What `image_message` makes messages of, in ROS 2."""
    from otwarp.ros.ros2 import load_messages

    m = load_messages()
    return SimpleNamespace(Header=m.Header, Time=m.Time, Image=m.Image, extra={}, bytes=lambda a: a.ravel().tolist())


def check_arrived(camera, publish) -> None:
    """Publish until the camera has it, and look at what it made of the stamp of 0.2 s ago."""
    end = time.perf_counter() + PATIENCE
    while True:
        told = time.time() - 0.2
        publish(told)
        time.sleep(0.02)
        now = time.perf_counter()
        frame = camera.read(now)
        if frame is not None:
            break
        assert now < end
    assert np.array_equal(frame.pieces[0].levels, LEVELS)
    assert 0.2 <= now - frame.time < 0.2 + PATIENCE


def test_a_topic_of_ros1():
    pytest.importorskip("rosbags")
    from otwarp.ros.ros1.messages import typestore
    from otwarp.ros.ros1.node import Ros1Node

    master = MasterDouble()
    try:
        known = typestore().types
        types = SimpleNamespace(
            Header=known["std_msgs/msg/Header"], Time=known["builtin_interfaces/msg/Time"],
            Image=known["sensor_msgs/msg/Image"], extra={"seq": 0}, bytes=lambda a: a.ravel(),
        )  # fmt: skip
        with Ros1Node("driver", master.uri) as driver:
            out = driver.publisher("/camera/image_raw", "sensor_msgs/Image")
            camera = make_camera(f"ros1:/camera/image_raw,master={master.uri},wait=0")
            camera.open()
            try:
                check_arrived(camera, lambda told: out.publish(image_message(types, told)))
            finally:
                camera.close()
    finally:
        master.stop()


def test_a_topic_of_ros2(monkeypatch):
    pytest.importorskip("cyclonedds")
    from otwarp.ros.ros2 import Ros2Node

    domain, types = loopback(monkeypatch), types_of_ros2()
    with Ros2Node("driver", domain) as driver:
        out = driver.publisher("/camera/image_raw", "sensor_msgs/msg/Image")
        camera = make_camera(f"ros2:/camera/image_raw,domain={domain},wait=0")
        camera.open()
        try:
            check_arrived(camera, lambda told: out.publish(image_message(types, told)))
        finally:
            camera.close()


def test_a_topic_waits_for_its_first_image(monkeypatch):
    """Published once somebody listens; without one there is no camera."""
    pytest.importorskip("cyclonedds")
    from otwarp.ros.ros2 import Ros2Node

    domain, types = loopback(monkeypatch), types_of_ros2()
    name = f"ros2:/camera/image_raw,domain={domain}"
    with pytest.raises(InputError, match=r"no image came within 0\.05 s; allowed: a topic on which"):
        make_camera(f"{name},wait=0.05").open()
    with pytest.raises(InputError, match="wait is -1; allowed: 0 to 3600 s"):
        make_camera(f"{name},wait=-1")
    with Ros2Node("driver", domain) as driver:
        out = driver.publisher("/camera/image_raw", "sensor_msgs/msg/Image")
        opened = threading.Event()

        def publish():
            """Images, until one has come."""
            while not opened.wait(0.01):
                out.publish(image_message(types, time.time() - 0.2))

        threading.Thread(target=publish, daemon=True).start()
        camera = make_camera(f"{name},wait={PATIENCE}")
        try:
            camera.open()
            opened.set()
            check_arrived(camera, lambda told: out.publish(image_message(types, told)))
        finally:
            opened.set()
            camera.close()
