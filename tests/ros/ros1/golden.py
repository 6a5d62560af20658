"""Messages of the contract, their md5 sums, and their bytes written out by hand from the definitions."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from otwarp.ros.ros1.messages import types

MD5 = {
    "tf2_msgs/TFMessage": "94810edda583a504dfda3829e70d7eec",
    "geometry_msgs/Twist": "9f195f881246fdfa2798d1d3eebca84a",
    "geometry_msgs/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
    "sensor_msgs/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
    "sensor_msgs/Joy": "5a9ea5f83505693b71e785041e67a8bb",
    "geomagic_control/DeviceFeedback": "94755b031db27fe99c2c235c0da9b072",
    "geomagic_control/DeviceButtonEvent": "fb77877e6b639935c3360838062f05f0",
}
"""Those of geomagic_control as its generated Lisp code states them; test_debian.py asks Debian's packages for the
others."""

HEADER = struct.pack("<III", 7, 12, 34) + struct.pack("<I", 5) + b"world"


def bytes_of(name: str) -> bytes:
    """Golden bytes."""
    match name:
        case "tf2_msgs/TFMessage":
            child = struct.pack("<I", 7) + b"robot01"
            return struct.pack("<I", 1) + HEADER + child + struct.pack("<7d", 1, -2, 3, 0, 0, 0.6, 0.8)
        case "geometry_msgs/Twist":
            return struct.pack("<6d", 1, 2, 3, 4, 5, 6)
        case "geometry_msgs/PoseStamped":
            return HEADER + struct.pack("<7d", 10, 20, 30, 0, 0, 0.6, 0.8)
        case "sensor_msgs/JointState":
            names = struct.pack("<I", 2) + struct.pack("<I", 5) + b"waist" + struct.pack("<I", 3) + b"yaw"
            numbers = struct.pack("<I2d", 2, 0.5, 1.5) + struct.pack("<I", 0) + struct.pack("<I1d", 1, 9)
            return HEADER + names + numbers
        case "sensor_msgs/Joy":
            return HEADER + struct.pack("<I3f", 3, 0.5, 1, 2) + struct.pack("<I2i", 2, 1, 0)
        case "geomagic_control/DeviceFeedback":
            return struct.pack("<6d", 0.1, 0.2, -0.3, 0, 0, 0) + struct.pack("<I", 3) + b"\x00\x01\x00"
        case "geomagic_control/DeviceButtonEvent":
            return struct.pack("<2i", 1, -1)
    raise KeyError(name)


def message_of(name: str) -> Any:
    """The message that they are."""
    t = types()
    header = t.Header(7, t.Time(12, 34), "world")
    turned = t.Quaternion(0.0, 0.0, 0.6, 0.8)
    match name:
        case "tf2_msgs/TFMessage":
            return t.TFMessage([t.TransformStamped(header, "robot01", t.Transform(t.Vector3(1.0, -2.0, 3.0), turned))])
        case "geometry_msgs/Twist":
            return t.Twist(t.Vector3(1.0, 2.0, 3.0), t.Vector3(4.0, 5.0, 6.0))
        case "geometry_msgs/PoseStamped":
            return t.PoseStamped(header, t.Pose(t.Point(10.0, 20.0, 30.0), turned))
        case "sensor_msgs/JointState":
            return t.JointState(header, ["waist", "yaw"], np.array([0.5, 1.5]), np.zeros(0), np.array([9.0]))
        case "sensor_msgs/Joy":
            return t.Joy(header, np.array([0.5, 1, 2], np.float32), np.array([1, 0], np.int32))
        case "geomagic_control/DeviceFeedback":
            return t.DeviceFeedback(t.Vector3(0.1, 0.2, -0.3), t.Vector3(0.0, 0.0, 0.0), np.array([False, True, False]))
        case "geomagic_control/DeviceButtonEvent":
            return t.DeviceButtonEvent(1, -1)
    raise KeyError(name)
