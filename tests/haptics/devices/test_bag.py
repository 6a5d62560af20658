"""Hands from ROS bags, written here by `rosbags`."""

from __future__ import annotations

from pathlib import Path

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core import DeviceLost
from otwarp.haptics.devices import create_device, parse_devices

rosbags = pytest.importorskip("rosbags")

RATE = 100.0


def write_bag(path: Path, topics: dict[str, float], count: int = 50) -> Path:
    """Poses that go by 1 along x per message, times the topic's factor."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    t = store.types
    with Writer(path) as bag:
        for topic, factor in topics.items():
            connection = bag.add_connection(topic, "geometry_msgs/msg/PoseStamped", typestore=store)
            for n in range(count):
                stamp = 5_000_000_000 + round(n / RATE * 1e9)
                header = t["std_msgs/msg/Header"](n, t["builtin_interfaces/msg/Time"](0, 0), "world")
                place = t["geometry_msgs/msg/Point"](factor * n, 0.0, -factor * n)
                pose = t["geometry_msgs/msg/Pose"](place, t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))
                message = t["geometry_msgs/msg/PoseStamped"](header, pose)
                data = store.serialize_ros1(message, "geometry_msgs/msg/PoseStamped")
                bag.write(connection, stamp, data)
    return path


def opened(text: str):
    (spec,) = parse_devices([text])
    device = create_device(spec)
    device.open()
    return device


def test_a_touch_s_bag_is_played_in_its_time_and_unit(tmp_path):
    file = write_bag(tmp_path / "touch.bag", {"/GeomagicLeft/pose": 1.0, "/GeomagicRight/pose": 2.0})
    device = opened(f"replay:{file},topic=/GeomagicRight/pose,unit=mm")
    first, middle = device.read(100.0), device.read(100.0 + 20.5 / RATE)
    assert first.position == (0.0, 0.0, 0.0) and middle.position == pytest.approx((0.04, 0.0, -0.04))
    assert middle.fresh and not device.read(100.0 + 60.0 / RATE).fresh
    device.close()
    with pytest.raises(DeviceLost):
        device.read(102.0)


def test_the_only_topic_needs_no_name(tmp_path):
    file = write_bag(tmp_path / "one.bag", {"/hand/left/pose": 0.001})
    assert opened(f"replay:{file}").read(0.0).position == (0.0, 0.0, 0.0)


def test_what_is_no_bag_is_one_line(tmp_path):
    two = write_bag(tmp_path / "two.bag", {"/a/pose": 1e-3, "/b/pose": 1e-3})
    cut = tmp_path / "cut.bag"
    cut.write_bytes(two.read_bytes()[:200])
    (tmp_path / "text.bag").write_text("no bag")
    far = write_bag(tmp_path / "far.bag", {"/a/pose": 1.0})
    for text, line in (
        (f"replay:{two}", "has no poses of a topic that was named; allowed: topic=/a/pose, topic=/b/pose"),
        (f"replay:{two},topic=/c", "has no poses of /c; allowed: topic=/a/pose"),
        (f"replay:{cut}", "cannot be read as a bag"),
        (f"replay:{tmp_path / 'text.bag'}", "cannot be read as a bag"),
        (f"replay:{tmp_path / 'absent.bag'}", "cannot be read"),
        (f"replay:{far}", "pose 12: position = "),
        (f"replay:{two},unit=inch", "unit = 'inch' must be m or mm"),
    ):
        with pytest.raises(InputError) as refused:
            opened(text)
        assert line in str(refused.value) and "\n" not in str(refused.value)
