"""Types of the contract: md5 sums, golden bytes, and bytes that are no message."""

from __future__ import annotations

import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.ros.contract import HAND_TYPES, TRANSFORM
from otwarp.ros.ros1.messages import MOST_ELEMENTS, message_type, typestore
from otwarp.ros.ros1.wire import Malformed

from .golden import MD5, bytes_of, message_of


def test_all_types_of_the_contract_are_here():
    assert {TRANSFORM, *HAND_TYPES.values()} == set(MD5)


@pytest.mark.parametrize("name", MD5)
def test_md5_and_golden_bytes(name):
    kind = message_type(name)
    assert kind.md5 == MD5[name]
    assert kind.encode(message_of(name)) == bytes_of(name)
    assert kind.encode(kind.decode(bytes_of(name))) == bytes_of(name)


@pytest.mark.parametrize("name", MD5)
def test_a_message_cut_short_or_too_long_is_malformed(name):
    kind, body = message_type(name), bytes_of(name)
    for size in range(len(body)):
        with pytest.raises(Malformed):
            kind.decode(body[:size])
    with pytest.raises(Malformed, match="mismatch"):
        kind.decode(body + b"\0")


@given(st.sampled_from(sorted(MD5)), st.data())
@settings(max_examples=300, deadline=None)
def test_no_bytes_break_a_type(name, data):
    """Golden bytes with some of them changed, or any bytes at all."""
    golden = bytes_of(name)
    body = bytearray(data.draw(st.one_of(st.just(golden), st.binary(max_size=200))))
    for at in data.draw(st.lists(st.integers(0, max(len(body) - 1, 0)), max_size=6)):
        if body:
            body[at] = data.draw(st.integers(0, 255))
    kind = message_type(name)
    try:
        message = kind.decode(bytes(body))
    except Malformed as error:
        assert "\n" not in str(error)
    else:
        assert len(kind.encode(message)) == len(body)


def test_a_type_store_is_what_we_take_it_for():
    """Attributes of `rosbags` that its documentation does not promise."""
    store = typestore()
    assert "geometry_msgs/msg/Twist" in store.fielddefs and "geometry_msgs/msg/Nothing" not in store.fielddefs
    assert store.max_sequence_length == MOST_ELEMENTS
    definition, md5 = store.generate_msgdef("geomagic_control/msg/DeviceButtonEvent")
    assert (definition.split("\n")[0], md5) == ("int32 grey_button", MD5["geomagic_control/DeviceButtonEvent"])
    vector = store.types["geometry_msgs/msg/Vector3"](1.0, 2.0, 3.0)
    assert (vector.x, vector.y, vector.z) == (1.0, 2.0, 3.0)


def test_long_sequences_are_refused_before_they_are_made():
    count = MOST_ELEMENTS + 1
    body = bytes(48) + count.to_bytes(4, "little") + bytes(count)
    with pytest.raises(Malformed, match="sequence length"):
        message_type("geomagic_control/DeviceFeedback").decode(body)


@pytest.mark.parametrize("name", ["geometry_msgs/Nothing", "Twist", "geometry_msgs/msg/Twist", "../x", "a/b\n"])
def test_unknown_types(name):
    with pytest.raises(InputError, match="allowed: a type of ROS 1 Noetic"):
        message_type(name)


def test_a_message_of_another_type_is_refused_in_one_line():
    with pytest.raises(InputError, match="allowed: a geometry_msgs/Twist") as error:
        message_type("geometry_msgs/Twist").encode(message_of("sensor_msgs/Joy"))
    assert "\n" not in str(error.value)


def test_without_rosbags_one_line_says_what_to_install(monkeypatch):
    typestore.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    try:
        with pytest.raises(InputError, match=r"pip install 'otwarp\[ros1\]'"):
            typestore()
    finally:
        typestore.cache_clear()
