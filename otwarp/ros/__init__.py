"""Bridges to ROS 1 and ROS 2: a live session as the simulator of the paper's topics, without a ROS installation.

A live loop's frame comes in, topics go out; twists and velocities come in by topic, commands to the loop go out.
Open `sinks` first: one class per ROS, between the loop and a bridge.

- `sinks`: a live session's frames to a bridge, and what it heard to commands.
- `roles`: which traps and bodies of a scene the topics mean; a frame as a `TopicState`.
- `contract`: names, types and units of the topics; `TopicState`; the way between scene and published axes.
- `motion`: how velocities by topic move traps.
- `ros1`: its bridge, and a node of ROS 1 (XML-RPC and TCPROS).
- `ros2`: its bridge, and a node of ROS 2 (Cyclone DDS).
"""
