"""A node by Debian's rospy, run by the system's Python as `rospy_peer.py MODE`; knows nothing of otwarp's client.

`facts` prints md5 sums and bytes of messages as JSON. `echo` sends back each message of the contract's types. `force`
behaves as the release's force node, with otwarp's `PaperForce` as its arithmetic.
"""

from __future__ import annotations

import io
import json
import sys

import genpy.dynamic
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from sensor_msgs.msg import JointState, Joy
from tf2_msgs.msg import TFMessage

FEEDBACK = """geometry_msgs/Vector3 force
geometry_msgs/Vector3 position
bool[] lock
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
BUTTONS = "int32 grey_button\nint32 white_button\n"


def dynamic(name, text):
    return genpy.dynamic.generate_dynamic(name, text)[name]


DeviceFeedback = dynamic("geomagic_control/DeviceFeedback", FEEDBACK)
DeviceButtonEvent = dynamic("geomagic_control/DeviceButtonEvent", BUTTONS)
CLASSES = (TFMessage, Twist, PoseStamped, JointState, Joy, DeviceFeedback, DeviceButtonEvent)


def facts(bodies):
    """md5 of each class, and its bytes after rospy has read and written the golden ones."""
    found = {}
    for kind in CLASSES:
        again = io.BytesIO()
        kind().deserialize(bytes.fromhex(bodies[kind._type])).serialize(again)
        found[kind._type] = [kind._md5sum, again.getvalue().hex()]
    print(json.dumps(found))


def echo():
    for n, kind in enumerate(CLASSES):
        back = rospy.Publisher(f"/from/t{n}", kind, queue_size=100)
        rospy.Subscriber(f"/to/t{n}", kind, back.publish)


def force(namespace, trap_topic, robot_topic):
    from otwarp.haptics.chain.paper_mode import PaperForce

    chain, heard = PaperForce(), set()
    out = rospy.Publisher(namespace + "/force_feedback", DeviceFeedback, queue_size=1000)

    def came(message, which):
        (transform,) = message.transforms
        t = transform.transform.translation
        felt = (chain.trap_message if which == "trap" else chain.robot_message)((t.x, t.y, t.z), 0.0)
        heard.add(which)
        if len(heard) == 2:
            feedback = DeviceFeedback()
            feedback.force.x, feedback.force.y, feedback.force.z = felt
            out.publish(feedback)

    while not out.get_num_connections():  # lest the first force gets lost
        rospy.sleep(0.01)
    rospy.Subscriber(trap_topic, TFMessage, came, callback_args="trap")
    rospy.Subscriber(robot_topic, TFMessage, came, callback_args="robot")


if __name__ == "__main__":
    mode, arguments = sys.argv[1], sys.argv[2:]
    if mode == "facts":
        facts(json.loads(sys.stdin.read()))
    else:
        rospy.init_node("peer_" + mode)
        print("ready", flush=True)
        {"echo": echo, "force": force}[mode](*arguments)
        rospy.spin()
