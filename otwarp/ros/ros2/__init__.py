"""ROS 2 through Cyclone DDS: ROS 2 names, types and QoS on the wire, no ROS 2 installation.

Importing this package needs nothing; making a `Ros2Node` needs `cyclonedds` (`pip install 'otwarp[ros2]'`). Open `node`
first.

- `bridge`: what a live loop publishes, and what a controller and two hands ask of it.
- `node`: publishers and subscriptions that never block.
- `messages`: the types, as `rosidl` would generate them.
- `cyclonedds_internals`: taking and deleting, safe against interrupts.
- `dds`: what names, environment variables and policies of ROS 2 mean to DDS.
"""

from __future__ import annotations

from otwarp.ros.ros2.bridge import Ros2Bridge, Ros2Commands, Ros2Config
from otwarp.ros.ros2.dds import RELIABLE, SENSOR_DATA, QoS
from otwarp.ros.ros2.node import Publisher, Ros2Node, Subscription, load_messages

__all__ = [
    "RELIABLE",
    "SENSOR_DATA",
    "Publisher",
    "QoS",
    "Ros2Bridge",
    "Ros2Commands",
    "Ros2Config",
    "Ros2Node",
    "Subscription",
    "load_messages",
]
