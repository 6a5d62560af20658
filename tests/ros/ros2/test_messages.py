"""Messages on the wire: bytes by hand from the rules of CDR, and against an independent codec (rosbags) both ways."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.ros.ros2 import load_messages

pytest.importorskip("cyclonedds")
typesys = pytest.importorskip("rosbags.typesys")

m = load_messages()
HUMBLE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
HEADER = b"\x00\x01\x00\x00"  # CDR, little endian


def samples() -> list[Any]:
    """One of each type that a topic may have, with odd lengths to bring alignment to light."""
    header = m.Header(m.Time(-7, 4_000_000_000), "world")
    pose = m.Pose(m.Point(1.5, -2.25, 1e300), m.Quaternion(0.5, -0.5, 0.5, -0.5))
    transform = m.Transform(m.Vector3(0.1, 0.2, 0.3), m.Quaternion(0.0, 1.0, 0.0, -0.0))
    stamped = [m.TransformStamped(header, name, transform) for name in ("a", "robot01", "xy")]
    return [
        m.String("Zürich"),
        m.Twist(m.Vector3(1.0, -2.0, 3.0), m.Vector3(-4.5, 5e-324, -0.0)),
        m.PoseStamped(header, pose),
        m.WrenchStamped(header, m.Wrench(m.Vector3(1.0, 2.0, 3.0), m.Vector3(4.0, 5.0, 6.0))),
        m.TFMessage(stamped),
        m.JointState(header, ["one", "three", ""], [1.0, 2.0], [], [3.0]),
        m.Joy(header, [0.5, -1.0, 0.25], [1, -2_000_000_000]),
    ]


def name_of(message: Any) -> str:
    """ROS 2 name of its type."""
    return next(name for name, cls in m.TOPIC_TYPES.items() if cls is type(message))


def plain(message: Any) -> Any:
    """Either codec's message as tuples and lists."""
    fields = getattr(message, "__dataclass_fields__", None)
    if fields is not None:
        return tuple(plain(getattr(message, name)) for name in fields if not name.startswith("__"))
    if isinstance(message, str | int | float):
        return message
    return message.tolist() if hasattr(message, "tolist") else [plain(item) for item in message]


def as_rosbags(message: Any, typename: str) -> Any:
    """The same message in the classes of rosbags."""
    import numpy as np

    def build(value: Any, name: str) -> Any:
        cls = HUMBLE.types[name]
        values = {}
        for field, (kind, detail) in HUMBLE.get_msgdef(name).fields:
            item = getattr(value, field)
            if kind == 2:
                values[field] = build(item, detail)
            elif kind in (3, 4) and detail[0][0] == 2:
                values[field] = [build(part, detail[0][1]) for part in item]
            elif kind in (3, 4) and detail[0][1][0] != "string":
                values[field] = np.array(item, dtype=detail[0][1][0])
            else:
                values[field] = item
        return cls(**values)

    return build(message, typename)


@pytest.mark.parametrize("message", samples(), ids=lambda message: type(message).__name__)
def test_bytes_are_those_of_rosbags_both_ways(message):
    name = name_of(message)
    ours = message.serialize(use_version_2=False)
    theirs = bytes(HUMBLE.serialize_cdr(as_rosbags(message, name), name, little_endian=True))
    assert ours == theirs[: len(ours)]
    # rosbags may pad the end to four bytes; the padding is part of no field
    assert set(theirs[len(ours) :]) <= {0} and len(theirs) - len(ours) < 4
    assert plain(HUMBLE.deserialize_cdr(ours, name)) == plain(message)
    assert plain(type(message).deserialize(theirs)) == plain(message)


@pytest.mark.parametrize("message", samples(), ids=lambda message: type(message).__name__)
def test_big_endian_peers_are_understood(message):
    name = name_of(message)
    theirs = bytes(HUMBLE.serialize_cdr(as_rosbags(message, name), name, little_endian=False))
    assert theirs[1] == 0
    assert plain(type(message).deserialize(theirs)) == plain(message)


def test_golden_bytes_by_hand():
    twist = m.Twist(m.Vector3(1.0, 2.0, 3.0), m.Vector3(4.0, 5.0, 6.0))
    assert twist.serialize(use_version_2=False) == HEADER + struct.pack("<6d", 1, 2, 3, 4, 5, 6)
    assert m.String("hi").serialize(use_version_2=False) == HEADER + struct.pack("<I3s", 3, b"hi\0")
    tf = m.TFMessage([m.TransformStamped(m.Header(m.Time(5, 7), "world"), "xform")])
    # count, stamp, length and text of "world", pad to 4, "xform", pad to 8, translation, rotation
    golden = struct.pack("<I iI I6s2x I6s2x 4x 7d", 1, 5, 7, 6, b"world\0", 6, b"xform\0", 0, 0, 0, 0, 0, 0, 1)
    assert tf.serialize(use_version_2=False) == HEADER + golden


def test_types_and_hashes_are_those_of_ros2():
    assert set(m.TOPIC_TYPES) == set(m.TYPE_HASHES)
    on_the_wire = {name: f"{name.replace('/', '.').replace('.msg.', '.msg.dds_.')}_" for name in m.TOPIC_TYPES}
    assert {name: cls.__idl_typename__ for name, cls in m.TOPIC_TYPES.items()} == on_the_wire
    for store in (typesys.Stores.ROS2_FOXY, typesys.Stores.ROS2_HUMBLE, typesys.Stores.ROS2_JAZZY):
        types = typesys.get_typestore(store)
        for name, digest in m.TYPE_HASHES.items():
            assert types.hash_rihs01(name) == f"RIHS01_{digest}"


text = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=12)
number = st.floats(allow_nan=False)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(text, max_size=4),
    st.lists(number, max_size=4),
    text,
    st.integers(-(2**31), 2**31 - 1),
    st.integers(0, 2**32 - 1),
)
def test_any_joint_state_goes_there_and_back(names, numbers, frame, sec, nanosec):
    message = m.JointState(m.Header(m.Time(sec, nanosec), frame), names, numbers, numbers[:1], [])
    theirs = HUMBLE.deserialize_cdr(message.serialize(use_version_2=False), "sensor_msgs/msg/JointState")
    assert plain(theirs) == plain(message)
    back = m.JointState.deserialize(bytes(HUMBLE.serialize_cdr(theirs, "sensor_msgs/msg/JointState")))
    assert plain(back) == plain(message)
