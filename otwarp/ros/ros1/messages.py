"""ROS 1 message types: their md5 sums, definitions, and bytes, by `rosbags`; with the types that the contract adds.

`geomagic_control` is the package of the Touch's driver node. Its two messages are registered here as its sources define
them; `tf2_msgs/TFMessage` is not among the types that `rosbags` brings for Noetic.

Of `rosbags` (0.11) this is the only file of the ROS bridges. It relies on what its documentation does not promise: the
attributes `fielddefs` and `types` of a type store, `max_sequence_length` set after it was made, and whatever exceptions
its generated code raises. tests/ros/ros1/test_messages.py fails where a version does otherwise.
"""

from __future__ import annotations

import re
from functools import cache
from types import SimpleNamespace
from typing import Any

from otwarp.errors import InputError
from otwarp.ros.ros1.wire import Malformed

DEFINITIONS: dict[str, str] = {
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "geomagic_control/DeviceFeedback": ("geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 position\nbool[] lock\n"),
    "geomagic_control/DeviceButtonEvent": "int32 grey_button\nint32 white_button\n",
}
"""Types that are added to those of Noetic."""

MOST_ELEMENTS = 1 << 16
"""Longest sequence in a message that is accepted."""

TYPE_NAME = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*", re.ASCII)


@cache
def typestore() -> Any:
    """The types of Noetic and those of `DEFINITIONS`.

    Raises:
        InputError: `rosbags` is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise InputError("ROS 1 needs the package rosbags: pip install 'otwarp[ros1]'") from None
    store = get_typestore(Stores.ROS1_NOETIC)
    store.max_sequence_length = MOST_ELEMENTS
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, _long(name)))
    return store


def allow_sequences(longest: int) -> None:
    """Accept sequences of so many elements in all messages of this process: an image has one for each byte."""
    store = typestore()
    store.max_sequence_length = max(store.max_sequence_length, longest)


@cache
def message_type(name: str) -> MessageType:
    """A type by its ROS 1 name, as `geometry_msgs/Twist`.

    Raises:
        InputError: No such type, or `rosbags` is not installed.
    """
    store = typestore()
    if not TYPE_NAME.fullmatch(name) or _long(name) not in store.fielddefs:
        raise InputError(f"message type is {name!r}; allowed: a type of ROS 1 Noetic, or {', '.join(DEFINITIONS)}")
    return MessageType(name)


def types() -> SimpleNamespace:
    """The classes that the contract's messages are made of, by their short names."""
    known = typestore().types
    names = (
        "builtin_interfaces/Time std_msgs/Header geometry_msgs/Vector3 geometry_msgs/Point geometry_msgs/Quaternion "
        "geometry_msgs/Pose geometry_msgs/PoseStamped geometry_msgs/Twist geometry_msgs/Transform "
        "geometry_msgs/TransformStamped tf2_msgs/TFMessage sensor_msgs/JointState sensor_msgs/Joy "
        "geomagic_control/DeviceFeedback geomagic_control/DeviceButtonEvent"
    )
    return SimpleNamespace(**{name.split("/")[1]: known[_long(name)] for name in names.split()})


class MessageType:
    """One type.

    Attributes:
        name: As `geometry_msgs/Twist`.
        md5: That both ends of a connection compare.
        definition: Text with the definitions of all types within.
    """

    __slots__ = ("_long", "_store", "definition", "md5", "name")

    def __init__(self, name: str) -> None:
        self.name, self._long = name, _long(name)
        self._store = typestore()
        self.definition, self.md5 = self._store.generate_msgdef(self._long)

    def encode(self, message: Any) -> bytes:
        """Bytes of a message.

        Raises:
            InputError: It is not of this type.
        """
        try:
            return bytes(self._store.serialize_ros1(message, self._long))
        except Exception as error:  # rosbags' generated code raises whatever the wrong field makes it raise
            raise InputError(f"message is {_brief(message)}; allowed: a {self.name} ({_brief(error)})") from None

    def decode(self, body: bytes) -> Any:
        """Message of bytes.

        Raises:
            Malformed: They are not a message of this type.
        """
        try:
            return self._store.deserialize_ros1(body, self._long)
        except Exception as error:  # bytes of a stranger: whatever they make the generated code raise
            raise Malformed(f"{len(body)} bytes are no {self.name} ({_brief(error)})") from None


def _long(name: str) -> str:
    return name.replace("/", "/msg/", 1)


def _brief(thing: object) -> str:
    return " ".join(str(thing).split())[:120]
