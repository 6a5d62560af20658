"""The middleware contract: topics, types and rates of the paper's release, beside what our bridges offer."""

from __future__ import annotations

from otwarp.errors import InputError
from otwarp.reproduce.item import Comparison, Request, Result, Table, Value
from otwarp.ros.contract import (
    CELL_TOPIC,
    HAND_TYPES,
    HIT_TOPICS,
    RATE,
    RESET_TOPIC,
    SIMULATOR_TOPICS,
    TRANSFORM,
    VELOCITY_TOPIC,
    ContractConfig,
)

TOPICS = ("/firstOTposition", "/secondOTposition", "/robot01", "/robot02", "/xform", "/DynaOb01", "/DynaOb02",
          "/DynaOb03", "/DynaOb04")  # fmt: skip
"""What the release's simulator publishes."""

HANDS = {"/GeomagicLeft": 0, "/GeomagicRight": 1}
"""Namespace of a device → which trap and robot it has."""

DEVICE = {"twist": "geometry_msgs/Twist", "smoothed_twist": "geometry_msgs/Twist", "pose": "geometry_msgs/PoseStamped",
          "joint_states": "sensor_msgs/JointState", "joy": "sensor_msgs/Joy",
          "force_feedback": "geomagic_control/DeviceFeedback"}  # fmt: skip
"""Topics below a namespace whose types are known."""

FEEDBACK_MD5 = "94755b031db27fe99c2c235c0da9b072"
COMPANION = ("/object", "/DynaOb01Collide", "/rl_vel", "/resetSignal")
COMPANION_RATE = 60.0

DEFINITION = """The release's ROS 1 graph: a simulator that publishes one transform on each of its topics, and for
each hand a namespace with the device's motion and the force that it is to render. Ours are read from the code of the
bridges, which `otwarp ros1` and `otwarp ros2` run without a ROS installation; md5 sums are computed from our message
definitions."""

DIFFERENCE = """None is meant. What differs is what stands between: forces are clamped, ramped and watched here. Bytes
of the messages, the force node against the release's own arithmetic (99 messages at 0.05), and exchanges with rospy
and Fast DDS peers are tested in `tests/ros`."""

INCOMPARABLE = (
    "The scene unit of published positions and G_control are not published; both are options with stated defaults, "
    "25 µm "
    "and 0.004 scene units of trap per mm of hand.",
    "The pairing of hands differs between two releases; both are presets.",
)


def run(request: Request) -> Result:
    """Set the contract's two sides beside each other."""
    left, right = ContractConfig().hands()
    ours = {left.namespace: left.group, right.namespace: right.group}
    companion = {CELL_TOPIC, HIT_TOPICS[0], VELOCITY_TOPIC, RESET_TOPIC}
    rows = (
        _same("topics of the simulator", tuple(SIMULATOR_TOPICS), TOPICS, f"{len(TOPICS)} topics"),
        _same("their type", TRANSFORM, "tf2_msgs/TFMessage", "tf2_msgs/TFMessage"),
        _same("hands → trap and robot", ours, HANDS, "left: first, right: second"),
        _same(
            "topics of a hand", {k: v for k, v in HAND_TYPES.items() if k in DEVICE}, DEVICE, f"{len(DEVICE)} topics"
        ),
        _same("md5 of geomagic_control/DeviceFeedback", _md5(), FEEDBACK_MD5, FEEDBACK_MD5[:12] + "…"),
        _same("rate of communication [Hz]", RATE, COMPANION_RATE, "60"),
        _same("topics of the RL companion (ROS 2)", companion, set(COMPANION), ", ".join(COMPANION)),
    )
    return Result(
        comparisons=rows,
        definition=DEFINITION,
        difference=DIFFERENCE,
        incomparable=INCOMPARABLE,
        computed={"how": "read from the code and compared"},
        tables=(Table(title="Topics of a hand", head=("topic", "type"), rows=tuple(HAND_TYPES.items()),
                      note="Below its namespace; `force_feedback` is consumed by the device, the others are "
                           "published."),),
        numbers={"md5": _md5() or "not computed", "topics": list(SIMULATOR_TOPICS)},
    )  # fmt: skip


def _same(what: str, ours: object, theirs: object, text: str) -> Comparison:
    said = "the same" if ours == theirs else "not checked: rosbags is missing" if ours is None else f"differs: {ours}"
    return Comparison(what=what, paper=Value(text=text), grade="S", ours=Value(text=said), key="md5" in what)


def _md5() -> str | None:
    """Of the message that a device is sent; None without the package that computes it."""
    from otwarp.ros.ros1.messages import message_type

    try:
        return message_type("geomagic_control/DeviceFeedback").md5
    except InputError:
        return None
