"""Nodes of our client on a master that only registers: messages, restarts, and peers that misbehave."""

from __future__ import annotations

import socket
import struct
import threading
import xmlrpc.client

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.ros.ros1 import subscriber
from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.messages import message_type, types
from otwarp.ros.ros1.node import Ros1Node, check_master
from otwarp.ros.ros1.publisher import receive_header
from otwarp.ros.ros1.rpc import NoAnswer, Refused, call
from otwarp.ros.ros1.slave import answer
from otwarp.ros.ros1.wire import decode_header, encode_header, packed

from .golden import bytes_of, message_of
from .setups import PATIENCE, BadPublisher, MasterDouble, good_header, wait_for

TWIST = "geometry_msgs/Twist"
POLL = 0.05
"""Seconds between looks at the master: often, so that the tests need not wait."""


def twist(x: float):
    t = types()
    return t.Twist(t.Vector3(x, 0.0, 0.0), t.Vector3(0.0, 0.0, 0.0))


@pytest.fixture
def node(master):
    """Makes nodes on the double, closed at the end."""
    made = []

    def make(name: str) -> Ros1Node:
        made.append(Ros1Node(name, master.uri, poll=POLL))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_messages_arrive_in_order_and_whole(node):
    got = []
    out = node("a").publisher("/t", TWIST, queue=100)
    heard = node("b").subscribe("/t", TWIST, got.append)
    wait_for(lambda: out.connections == 1 and heard.connections == 1)
    for n in range(50):
        out.publish(twist(float(n)))
    wait_for(lambda: len(got) == 50)
    assert [m.linear.x for m in got] == [float(n) for n in range(50)]
    assert heard.latest()[0] == 50


@pytest.mark.parametrize("late", [False, True])
def test_who_comes_first_does_not_matter(node, late):
    a, b = node("a"), node("b")
    if late:
        heard, out = b.subscribe("t", TWIST), a.publisher("t", TWIST, latch=True)
    else:
        out, heard = a.publisher("t", TWIST, latch=True), b.subscribe("t", TWIST)
    out.publish(twist(3.0))
    wait_for(lambda: heard.received == 1)
    assert heard.take().linear.x == 3.0
    assert heard.take() is None


def test_latching_gives_a_late_subscriber_the_last_message(node):
    a, b = node("a"), node("b")
    latched, plain = a.publisher("/latched", TWIST, latch=True), a.publisher("/plain", TWIST)
    for x in (1.0, 2.0):
        latched.publish(twist(x))
        plain.publish(twist(x))
    first, second = b.subscribe("/latched", TWIST), b.subscribe("/plain", TWIST)
    wait_for(lambda: first.received == 1 and plain.connections == 1)
    assert first.latest()[1].linear.x == 2.0
    assert second.latest() is None


def test_closing_takes_every_registration_back(node, master):
    a = node("a")
    a.publisher("/p", TWIST)
    a.subscribe("/s", TWIST)
    a.close()
    a.close()
    assert {c for c in master.calls if c[0].startswith("unregister")} == {
        ("unregisterPublisher", "/a", "/p"),
        ("unregisterSubscriber", "/a", "/s"),
    }
    assert not master.publishers["/p"] and not master.subscribers["/s"]
    assert not a.alive
    with pytest.raises(InputError, match="node /a is closed"):
        a.publisher("/q", TWIST)
    with pytest.raises(NoAnswer):
        call(a.uri, "getPid", "/x")


def test_what_was_published_just_before_closing_arrives(node):
    a, b = node("a"), node("b")
    out, heard = a.publisher("/t", TWIST), b.subscribe("/t", TWIST)
    wait_for(lambda: out.connections == 1)
    out.publish(twist(9.0))
    a.close()
    wait_for(lambda: heard.received == 1)
    assert heard.latest()[1].linear.x == 9.0


def test_both_ends_of_a_topic_in_one_node(node):
    a = node("a")
    out = a.publisher("/t", TWIST)
    first, second = a.subscribe("/t", TWIST), a.subscribe("/t", TWIST)
    wait_for(lambda: first.connections == second.connections == out.connections == 1)
    out.publish(twist(1.0))
    wait_for(lambda: first.received == 1 and second.received == 1)
    first.close()
    assert first.connections == 0
    out.publish(twist(2.0))
    wait_for(lambda: second.received == 2)
    assert first.received == 1
    with pytest.raises(InputError, match="type of /t is 'sensor_msgs/Joy'; allowed: geometry_msgs/Twist"):
        a.subscribe("/t", "sensor_msgs/Joy")
    second.close()
    wait_for(lambda: out.connections == 0)
    out.publish(twist(3.0))
    third = a.subscribe("/t", TWIST)
    wait_for(lambda: out.connections == third.connections == 1)
    assert third.received == 0


def test_a_second_listener_gets_what_was_latched(node):
    """There is one connection, on which the publisher sends it once."""
    a, b = node("a"), node("b")
    out = a.publisher("/t", TWIST, latch=True)
    out.publish(twist(1.0))
    first = b.subscribe("/t", TWIST)
    wait_for(lambda: first.received == 1)
    got = []
    second = b.subscribe("/t", TWIST, got.append)
    assert [m.linear.x for m in got] == [1.0] and second.received == 1
    out.publish(twist(2.0))
    wait_for(lambda: first.received == 2 and second.received == 2)
    assert out.connections == 1


def test_a_restarted_publisher_is_heard_again(node, master):
    heard = node("b").subscribe("/t", TWIST)
    for x in (1.0, 2.0):
        with Ros1Node("a", master.uri, poll=POLL) as a:
            a.publisher("/t", TWIST, latch=True).publish(twist(x))
            wait_for(lambda x=x: heard.received == int(x))
        assert heard.latest()[1].linear.x == x


def test_a_restarted_master_hears_of_all_again(node, master):
    a, b = node("a"), node("b")
    out, heard = a.publisher("/t", TWIST), b.subscribe("/t", TWIST)
    wait_for(lambda: out.connections == 1)
    master.stop()
    wait_for(lambda: not a.master_there and not b.master_there)
    out.publish(twist(1.0))
    wait_for(lambda: heard.received == 1, "messages while the master is away")
    master.start()
    wait_for(lambda: "/a" in master.publishers.get("/t", {}) and "/b" in master.subscribers.get("/t", {}))
    later = node("c").subscribe("/t", TWIST)
    wait_for(lambda: out.connections == 2)
    out.publish(twist(2.0))
    wait_for(lambda: later.received == 1)
    wait_for(lambda: len(a.log.lines) > 1 and len(b.log.lines) > 1, "the line that it is back")
    for one, done in ((a, "topics published: 1, subscribed: 0"), (b, "topics published: 0, subscribed: 1")):
        gone, back = one.log.lines
        assert gone.startswith("master: gone; topics that are connected go on without it (lookupNode of http://")
        assert back == f"master: back; registered anew, {done}"


def test_a_name_that_another_node_took_is_told_once(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    other = "http://127.0.0.1:1/"
    looks = []

    def _lookup(caller: str, name: str) -> list:
        looks.append(name)
        return [1, "", other]

    master._server.register_function(_lookup, "lookupNode")
    wait_for(lambda: len(looks) > 4)
    assert list(a.log.lines) == ["master: another node took the name /a"]


def test_a_master_that_refuses_a_registration_is_told_once(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    tried = []

    def _refuse(*arguments: str) -> list:
        tried.append(arguments)
        return [-1, "not today", 0]

    master._server.register_function(_refuse, "registerPublisher")
    master.publishers.clear()
    wait_for(lambda: len(tried) > 4)
    assert [line for line in a.log.lines if "not today" in line] == list(a.log.lines)
    assert len(a.log.lines) == 1 and not a.master_there
    master._server.register_function(master._registerPublisher, "registerPublisher")
    wait_for(lambda: a.master_there)
    assert a.log.lines[-1].startswith("master: back; registered anew, topics published: 1")


def test_a_connection_outlives_its_listing(node, master):
    """A restarted master lists a publisher only when that has come back; what it does not list is not tried again."""
    a, b = node("a"), node("b")
    out, heard = a.publisher("/t", TWIST), b.subscribe("/t", TWIST)
    wait_for(lambda: out.connections == 1 and heard.connections == 1)
    call(b.uri, "publisherUpdate", "/master", "/t", [])
    out.publish(twist(1.0))
    wait_for(lambda: heard.received == 1)
    assert out.connections == 1
    a.close()
    wait_for(lambda: heard.connections == 0 and not heard.topic._links)


def test_a_master_that_restarted_between_two_looks_is_noticed(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    master.publishers.clear()
    wait_for(lambda: "/a" in master.publishers.get("/t", {}))
    assert a.master_there


def test_no_master_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with pytest.raises(
        InputError, match=f"ROS_MASTER_URI is 'http://127.0.0.1:{port}/': no ROS master answers"
    ) as error:
        Ros1Node("a", f"http://127.0.0.1:{port}/")
    assert "\n" not in str(error.value)


def test_a_master_that_goes_before_a_topic_is_one_line(master):
    with Ros1Node("a", master.uri, poll=60.0) as a:
        master.stop()
        try:
            with pytest.raises(InputError, match="ROS_MASTER_URI is 'http"):
                a.publisher("/t", TWIST)
            with pytest.raises(InputError, match="ROS_MASTER_URI is 'http"):
                a.subscribe("/t", TWIST)
        finally:
            master.start()
        # nothing is left of them
        a.publisher("/t", TWIST)


def test_bad_input(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    with pytest.raises(InputError, match="topic is '/t'; allowed: one that this node does not publish yet"):
        a.publisher("/t", TWIST)
    with pytest.raises(InputError, match="queue of /q is 0"):
        a.publisher("/q", TWIST, queue=0)
    with pytest.raises(InputError, match="node is 'a b'"):
        Ros1Node("a b", master.uri)
    with pytest.raises(InputError, match=r"host is '192\.0\.2\.1': cannot listen there"):
        Ros1Node("c", master.uri, host="192.0.2.1")
    with pytest.raises(InputError, match="allowed: a geometry_msgs/Twist"):
        a.publisher("/r", TWIST).publish(message_of("sensor_msgs/Joy"))


def test_a_node_listens_on_its_host_only(master):
    with Ros1Node("a", master.uri, host="127.0.0.2") as a:
        a.publisher("/t", TWIST)
        where = call(a.uri, "requestTopic", "/x", "/t", [["TCPROS"]])
        assert a.uri.startswith("http://127.0.0.2:") and where[1] == "127.0.0.2"
        for port in (int(a.uri.split(":")[2].strip("/")), where[2]):
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)


# ---- the slave's calls


def test_slave_calls(node, master):
    a = node("a")
    a.publisher("/p", TWIST)
    a.subscribe("/s", TWIST)
    assert call(a.uri, "getPublications", "/x") == [["/p", TWIST]]
    assert call(a.uri, "getSubscriptions", "/x") == [["/s", TWIST]]
    assert call(a.uri, "getMasterUri", "/x") == master.uri
    assert call(a.uri, "getBusStats", "/x") == [[], [], []]
    for bad in (("requestTopic", "/x", "/none", [["TCPROS"]]), ("requestTopic", "/x", "/p", [["UDPROS"]])):
        with pytest.raises(Refused):
            call(a.uri, *bad)
    for bad in (
        ("requestTopic", "/x", "/p", 3),
        ("publisherUpdate", "/x", "/s", [1]),
        ("publisherUpdate", 3, "/s", []),
    ):
        with pytest.raises(Refused, match="wrong arguments"):
            call(a.uri, *bad)
    assert call(a.uri, "publisherUpdate", "/x", "/s", ["nonsense", "http://a:b", "ftp://x:1"]) == 0
    assert call(a.uri, "publisherUpdate", "/x", "/unheard", ["http://127.0.0.1:1/"]) == 0


ARGUMENT = st.one_of(
    st.sampled_from(["/s", "/p", "/x", "http://127.0.0.1:1/", [["TCPROS"]], ["http://127.0.0.1:1/", "x:"], []]),
    st.recursive(st.integers(0, 9) | st.booleans() | st.text("/a:", max_size=4), st.lists, max_leaves=5),
)


def test_no_arguments_break_the_slave_calls(node):
    """Every method of the slave but `shutdown`, with arguments near the right ones and far from them."""
    a = node("a")
    a.publisher("/p", TWIST)
    heard = a.subscribe("/s", TWIST)
    methods = {name: method for name, method in a._methods().items() if name != "shutdown"}

    @given(st.sampled_from(sorted(methods)), st.lists(ARGUMENT, max_size=4))
    @settings(max_examples=300, deadline=None)
    def any_call(name, arguments):
        body = xmlrpc.client.dumps(tuple(arguments), name).encode()
        ((code, text, _),), _ = xmlrpc.client.loads(answer(methods, body, EventLog()))
        assert code in (-1, 0, 1) and isinstance(text, str)

    any_call()
    call(a.uri, "publisherUpdate", "/master", "/s", [a.uri])
    assert set(heard.topic._links) == {a.uri} and a.alive


def test_the_master_may_shut_a_node_down(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    call(a.uri, "shutdown", "/master", "new node registered with same name")
    wait_for(lambda: not master.publishers["/t"])
    assert not a.alive
    assert any("same name" in line for line in a.log.lines)


# ---- subscribers that misbehave


def shake(a: Ros1Node, request: bytes) -> tuple[dict[str, str], bytes]:
    """(header, first bytes after it) of what the node's topic answers; ({}, b"") if it hangs up."""
    _, host, port = call(a.uri, "requestTopic", "/x", "/t", [["TCPROS"]])
    with socket.create_connection((host, port), timeout=PATIENCE) as sock:
        sock.sendall(request)
        if not request:
            sock.shutdown(socket.SHUT_WR)
        try:
            header, rest = receive_header(sock, PATIENCE)
        except Exception:
            return {}, b""
        fields = decode_header(header)
        if "error" not in fields and not rest:
            rest = sock.recv(4096)
        return fields, rest


def request(**changed: str) -> bytes:
    kind = message_type(TWIST)
    fields = {"callerid": "/x", "topic": "/t", "type": TWIST, "md5sum": kind.md5} | changed
    return encode_header({k: v for k, v in fields.items() if v})


@pytest.mark.parametrize("changed", [{}, {"md5sum": "*"}, {"type": "*", "md5sum": "*"}])
def test_a_subscriber_is_told_the_type(node, changed):
    a = node("a")
    a.publisher("/t", TWIST, latch=True).publish(twist(1.0))
    header, message = shake(a, request(**changed))
    kind = message_type(TWIST)
    assert (header["type"], header["md5sum"], header["latching"], header["callerid"]) == (TWIST, kind.md5, "1", "/a")
    assert header["message_definition"].startswith("geometry_msgs/Vector3")
    assert message == packed(kind.encode(twist(1.0)))


@pytest.mark.parametrize(
    ("sent", "kind", "says"),
    [
        (request(md5sum="0" * 32), "md5", "md5sum of /t is"),
        (request(type="std_msgs/String"), "refused", "type of /t is"),
        (request(md5sum=""), "refused", "lacks md5sum"),
        (request(topic="/other"), "refused", "no topic '/other'"),
        (request(topic=""), "refused", "no topic ''"),
    ],
)
def test_a_subscriber_that_does_not_fit_is_told_so(node, sent, kind, says):
    a = node("a")
    a.publisher("/t", TWIST, latch=True).publish(twist(1.0))
    header, message = shake(a, sent)
    assert says in header["error"] and not message
    assert a.log.counts == {kind: 1}
    assert says in a.log.lines[0]


@pytest.mark.parametrize("sent", [b"", b"\xff\xff\xff\xff", packed(b"\x09\x00\x00\x00a=b"), packed(packed(b"nothing"))])
def test_a_malformed_header_costs_its_connection_only(node, sent):
    a = node("a")
    a.publisher("/t", TWIST, latch=True).publish(twist(1.0))
    assert shake(a, sent) == ({}, b"")
    wait_for(lambda: a.log.counts["malformed"] == 1)
    assert shake(a, request())[1]


def test_a_subscriber_that_does_not_read_loses_the_oldest(node):
    """It never delays `publish` nor the other subscribers."""
    a, b = node("a"), node("b")
    kind = "tf2_msgs/TFMessage"
    out, heard = a.publisher("/t", kind, queue=4), b.subscribe("/t", kind)
    _, host, port = call(a.uri, "requestTopic", "/x", "/t", [["TCPROS"]])
    big = types().TFMessage(message_of(kind).transforms * 2000)
    with socket.create_connection((host, port), timeout=PATIENCE) as deaf:
        deaf.sendall(request(type=kind, md5sum=message_type(kind).md5))
        receive_header(deaf, PATIENCE)
        wait_for(lambda: out.connections == 2)

        def one_more() -> bool:
            out.publish(big)
            return a.log.counts["dropped"] > 5 and heard.received > 5

        wait_for(one_more, "dropped messages")
    wait_for(lambda: (out.publish(big), out.connections == 1)[1], "the deaf one's end")


# ---- publishers that misbehave


def heard_from(node, master: MasterDouble, bad: BadPublisher):
    """A subscription told of this publisher only."""
    b = node("b")
    heard = b.subscribe("/t", TWIST)
    call(b.uri, "publisherUpdate", "/master", "/t", [bad.uri])
    return b, heard


GOOD = packed(bytes_of(TWIST))


@pytest.mark.parametrize(
    ("answer", "kind"),
    [
        (b"\xff\xff\xff\xff", "malformed"),
        (packed(b"\x09\x00\x00\x00a=b"), "malformed"),
        (b"", "malformed"),
        (good_header(TWIST, md5sum="0" * 32), "md5"),
        (good_header(TWIST, type="std_msgs/String"), "refused"),
        (encode_header({"error": "go away"}), "refused"),
        (good_header(TWIST) + struct.pack("<I", 1 << 31), "malformed"),
        (good_header(TWIST) + packed(bytes(10)), "malformed"),
        (good_header(TWIST) + GOOD[:20], "connection"),
    ],
)
def test_a_bad_publisher_costs_its_connection_and_is_tried_again(node, master, answer, kind, monkeypatch):
    """The second time it behaves."""
    monkeypatch.setattr(subscriber, "LONGEST_PAUSE", 0.1)
    bad = BadPublisher(answer, good_header(TWIST) + GOOD)
    try:
        b, heard = heard_from(node, master, bad)
        wait_for(lambda: heard.received >= 1)
        assert b.log.counts[kind] >= 1
        assert heard.latest()[1].linear.x == 1.0
    finally:
        bad.close()


def test_a_callback_that_raises_is_noted_and_called_again(node):
    a, b = node("a"), node("b")
    out = a.publisher("/t", TWIST)
    seen = threading.Semaphore(0)

    def careless(message) -> None:
        seen.release()
        raise RuntimeError("oh\nno")

    b.subscribe("/t", TWIST, careless)
    wait_for(lambda: out.connections == 1)
    for _ in range(2):
        out.publish(twist(1.0))
    assert seen.acquire(timeout=PATIENCE) and seen.acquire(timeout=PATIENCE)
    wait_for(lambda: b.log.counts["callback"] == 2)
    assert "RuntimeError: oh no" in b.log.lines[0]


def test_check_master(master):
    assert check_master(master.uri) is None
