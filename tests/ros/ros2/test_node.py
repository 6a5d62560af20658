"""Nodes on a real (loopback) network: within a process and between two."""

from __future__ import annotations

import random
import signal

import pytest

from otwarp.errors import InputError
from otwarp.ros.ros2 import RELIABLE, SENSOR_DATA, Publisher, QoS, Ros2Node, load_messages
from otwarp.ros.ros2 import node as node_module
from tests.ros.ros2.setups import child, expect_soon

pytest.importorskip("cyclonedds")
m = load_messages()

FUZZED = 300
"""Malformed payloads; each is refused, counted, or read as some message, and none may do harm."""


@pytest.fixture
def nodes(domain):
    with Ros2Node("left", domain) as left, Ros2Node("right", domain) as right:
        yield left, right


def twist(x: float):
    return m.Twist(m.Vector3(x, 0.0, 0.0), m.Vector3(0.0, 0.0, -x))


def arrive(subscription, count: int) -> list:
    """Messages as they come, until there are so many."""
    messages: list = []
    expect_soon(
        lambda: messages.extend(subscription.take()) or len(messages) >= count, f"{count} on {subscription.topic}"
    )
    return messages


def test_messages_come_in_order_and_only_once(nodes):
    left, right = nodes
    out = left.publisher("/rl_vel", "geometry_msgs/msg/Twist")
    heard = right.subscribe("rl_vel", m.Twist)
    expect_soon(lambda: out.matched == heard.matched == 1, "a match")
    assert heard.take() == [] and heard.latest() is None
    for n in range(5):
        out.publish(twist(n))
    assert [message.linear.x for message in arrive(heard, 5)] == [0, 1, 2, 3, 4]
    assert heard.take() == []
    assert (out.topic, heard.topic, out.sent, heard.received, heard.malformed) == ("/rl_vel", "/rl_vel", 5, 5, 0)


def test_who_does_not_take_keeps_the_last_ten(nodes):
    left, right = nodes
    out, heard = left.publisher("/a", m.Twist), right.subscribe("/a", m.Twist)
    expect_soon(lambda: out.matched, "a match")
    for n in range(25):
        out.publish(twist(n))
    # delivery within a process is synchronous
    assert [message.linear.x for message in heard.take()] == list(range(15, 25))
    out.publish(twist(7))
    out.publish(twist(8))
    assert heard.latest().linear.x == 8
    assert heard.latest() is None


@pytest.mark.parametrize(
    ("requested", "offered"),
    [
        (SENSOR_DATA, SENSOR_DATA),
        (SENSOR_DATA, RELIABLE),
        (RELIABLE, RELIABLE),
        (RELIABLE, SENSOR_DATA),
        (QoS(reliability="reliable", durability="transient_local"), RELIABLE),
        (QoS(reliability="reliable", depth=3), QoS(reliability="reliable", durability="transient_local")),
    ],
)
def test_cyclone_matches_what_the_profiles_say(nodes, requested, offered):
    left, right = nodes
    marks = left.publisher("/mark", m.String), right.subscribe("/mark", m.String)
    out, heard = left.publisher("/a", m.Twist, offered), right.subscribe("/a", m.Twist, requested)
    marker = right.subscribe("/a", m.Twist, SENSOR_DATA)
    expect_soon(lambda: marker.matched and marks[0].matched, "the endpoints to be known")
    assert bool(heard.matched) == requested.accepts(offered) == bool(out.matched - 1)


def test_late_comers_get_what_is_latched(nodes):
    left, right = nodes
    latched = QoS(reliability="reliable", durability="transient_local", depth=3)
    out = left.publisher("/a", m.String, latched)
    for word in ("one", "two", "three", "four"):
        out.publish(m.String(word))
    assert [message.data for message in arrive(right.subscribe("/a", m.String, latched), 3)] == ["two", "three", "four"]


def test_what_discovery_tells_ros2(nodes):
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant, BuiltinTopicDcpsPublication
    from cyclonedds.qos import Policy

    left, right = nodes
    left.publisher("/object", m.TFMessage)
    reader = BuiltinDataReader(right._participant, BuiltinTopicDcpsPublication)
    found = {}
    expect_soon(
        lambda: found.update({e.topic_name: e for e in reader.take(20)}) or "rt/object" in found, "the publication"
    )
    end = found["rt/object"]
    assert end.type_name == "tf2_msgs::msg::dds_::TFMessage_"
    hashed = f"typehash=RIHS01_{m.TYPE_HASHES['tf2_msgs/msg/TFMessage']};"
    assert end.qos[Policy.Userdata].data == hashed.encode()
    assert end.qos[Policy.DataRepresentation] == Policy.DataRepresentation(True, False)
    people = {e.qos[Policy.EntityName].name: e for e in BuiltinDataReader(
        right._participant, BuiltinTopicDcpsParticipant
    ).take(20)}  # fmt: skip
    assert people["left"].qos[Policy.Userdata].data == b"enclave=/;"


def test_malformed_payloads_are_counted_and_harm_nothing(nodes):
    from cyclonedds._clayer import ddspy_write

    left, right = nodes
    out, heard = left.publisher("/bad", m.TFMessage), right.subscribe("/bad", m.TFMessage)
    expect_soon(lambda: heard.matched, "a match")
    good = m.TFMessage([m.TransformStamped(child_frame_id="robot01")])
    payload = good.serialize(use_version_2=False)
    chance = random.Random(5)
    passed = 0
    for n in range(FUZZED):
        # every other one is a text that is no UTF-8, which Cyclone itself does not look at
        broken = payload.replace(b"robot01", b"rob\xff\xfe01") if n % 2 else bytearray(payload)
        for _ in range(n % 2 == 0 and 1 + n % 5):
            broken[chance.randrange(4, len(payload))] = chance.randrange(256)
        # Cyclone refuses to send what its own check of the layout finds
        passed += ddspy_write(out._writer._ref, bytes(broken)) == 0
        if n % 7 == 0:
            out.publish(good)
            passed += 1
            assert heard.take()[-1] == good
    heard.take()
    assert heard.malformed >= FUZZED // 2
    assert heard.received + heard.malformed == passed


class Failing:
    """A writer that Cyclone lets fail."""

    def __init__(self, code: int):
        self.code = code

    def write(self, message) -> None:
        from cyclonedds.core import DDSException

        raise DDSException(self.code, "double")


def test_a_writer_without_room_drops_and_one_that_fails_says_so():
    from cyclonedds.core import DDSException

    full = Publisher(Failing(DDSException.DDS_RETCODE_TIMEOUT), "/a", m.Twist)
    full.publish(twist(1))
    assert (full.sent, full.dropped) == (0, 1)
    broken = Publisher(Failing(DDSException.DDS_RETCODE_ERROR), "/a", m.Twist)
    with pytest.raises(InputError, match="message for /a was refused by Cyclone DDS"):
        broken.publish(twist(1))


def test_bad_messages_are_refused_before_they_leave(nodes):
    out = nodes[0].publisher("/a", m.Twist)
    header = nodes[0].publisher("/b", m.PoseStamped)
    for call, message in [
        (out.publish, m.String("x")),
        (out.publish, None),
        (out.publish, m.Twist("fast", m.Vector3())),
        (out.publish, m.Twist(m.Vector3("x"), m.Vector3())),
        (header.publish, m.PoseStamped(m.Header(m.Time(2**31, 0)))),
        (header.publish, m.PoseStamped(m.Header(m.Time(0, -1)))),
        (header.publish, m.PoseStamped(m.Header(frame_id=3))),
    ]:
        with pytest.raises(InputError, match=r"message for /[ab]") as caught:
            call(message)
        assert "\n" not in str(caught.value)
    assert out.sent == header.sent == 0


def test_bad_topics_types_and_policies_are_refused(nodes):
    left, _ = nodes
    for call in (left.publisher, left.subscribe):
        with pytest.raises(InputError, match="topic name is '/1'"):
            call("/1", m.Twist)
        for kind in ("geometry_msgs/Twist", m.Vector3, int, None):
            with pytest.raises(InputError, match="allowed: std_msgs/msg/String, geometry_msgs/msg/Twist"):
                call("/a", kind)
        with pytest.raises(InputError, match="allowed: a QoS"):
            call("/a", m.Twist, 10)


def test_a_closed_node_says_so_and_leaves_the_domain(domain):
    node = Ros2Node("twin", domain)
    out, heard = node.publisher("/a", m.Twist), node.subscribe("/a", m.Twist)
    assert domain in node_module._domains
    node.close()
    node.close()
    assert domain not in node_module._domains
    for call in (lambda: out.publish(twist(0)), heard.take, lambda: node.publisher("/b", m.Twist)):
        with pytest.raises(InputError, match="closed"):
            call()
    assert out.matched == heard.matched == 0
    with Ros2Node("twin", domain) as again:
        assert again.domain == domain


def test_the_domain_comes_from_the_environment(domain, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    with Ros2Node("twin") as node:
        assert node.domain == domain
    monkeypatch.setenv("ROS_DOMAIN_ID", "300")
    with pytest.raises(InputError, match="ROS_DOMAIN_ID is '300'"):
        Ros2Node("twin")


def test_a_network_that_is_not_there_is_one_line(domain, monkeypatch):
    monkeypatch.setenv(
        "CYCLONEDDS_URI",
        "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='none0'/></Interfaces></General>"
        "<Tracing><Category>none</Category></Tracing></Domain></CycloneDDS>",
    )
    with pytest.raises(InputError, match=f"domain is {domain}") as caught:
        Ros2Node("twin", domain)
    assert "\n" not in str(caught.value) and domain not in node_module._domains


ECHO = """
import sys
from otwarp.ros.ros2 import RELIABLE, Ros2Node, load_messages
m = load_messages()
with Ros2Node("echo", int(sys.argv[1])) as node:
    heard = node.subscribe("/ask", m.TFMessage, RELIABLE)
    out = node.publisher("/answer", m.TFMessage)
    print("ready", flush=True)
    for line in sys.stdin:
        for message in heard.take():
            message.transforms[0].transform.translation.x += 1.0
            out.publish(message)
    print(heard.received, heard.malformed)
"""


def test_two_processes(domain):
    from cyclonedds._clayer import ddspy_write

    peer = child(ECHO, domain)
    with peer, Ros2Node("asks", domain) as node:
        out, heard = node.publisher("/ask", m.TFMessage), node.subscribe("/answer", m.TFMessage)
        assert peer.stdout is not None and peer.stdin is not None
        assert peer.stdout.readline() == "ready\n"
        expect_soon(lambda: out.matched and heard.matched, "the other process")
        message = m.TFMessage([m.TransformStamped(child_frame_id="robot01")])
        ddspy_write(out._writer._ref, message.serialize(use_version_2=False).replace(b"robot01", b"rob\xff\xfe01"))
        out.publish(message)
        answers: list = []

        def _asked() -> bool:
            peer.stdin.write("\n")
            peer.stdin.flush()
            answers.extend(heard.take())
            return bool(answers)

        expect_soon(_asked, "an answer")
        assert [t.child_frame_id for t in answers[0].transforms] == ["robot01"]
        assert answers[0].transforms[0].transform.translation.x == 1.0
        assert peer.communicate()[0].split() == ["1", "1"]


SLEEPER = """
import sys
from otwarp.ros.ros2 import RELIABLE, Ros2Node, load_messages
m = load_messages()
with Ros2Node("sleeper", int(sys.argv[1])) as node:
    heard = node.subscribe("/long", m.String, RELIABLE)
    print("ready", flush=True)
    texts = []
    for line in sys.stdin:
        texts += [message.data for message in heard.take()]
        print("last" if texts and texts[-1][:3] == "199" else "", flush=True)
"""


def test_a_reader_that_stands_still_holds_nobody_up(domain):
    peer = child(SLEEPER, domain)
    with peer, Ros2Node("talks", domain) as node:
        out = node.publisher("/long", m.String)
        assert peer.stdout is not None and peer.stdout.readline() == "ready\n"
        expect_soon(lambda: out.matched, "the other process")
        peer.send_signal(signal.SIGSTOP)
        try:
            for n in range(200):
                out.publish(m.String(f"{n:03}" * 30_000))
            assert (out.sent, out.dropped) == (200, 0)
        finally:
            peer.send_signal(signal.SIGCONT)
        assert peer.stdin is not None

        def _last_came() -> bool:
            peer.stdin.write("\n")
            peer.stdin.flush()
            return peer.stdout.readline() == "last\n"

        # what is still kept is sent again, the newest included
        expect_soon(_last_came, "the newest message")
        peer.communicate()
