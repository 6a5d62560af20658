"""Nodes of our client on a master that only registers: messages, registrations, restarts."""

from __future__ import annotations

import socket

import pytest

from otwarp.errors import InputError
from otwarp.ros.ros1.node import Ros1Node, check_master
from otwarp.ros.ros1.rpc import NoAnswer, call

from .golden import message_of
from .setups import PATIENCE, POLL, TWIST, expect_soon, twist


def test_messages_arrive_in_order_and_whole(node):
    got = []
    out = node("a").publisher("/t", TWIST, queue=100)
    heard = node("b").subscribe("/t", TWIST, got.append)
    expect_soon(lambda: out.connections == 1 and heard.connections == 1)
    for n in range(50):
        out.publish(twist(float(n)))
    expect_soon(lambda: len(got) == 50)
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
    expect_soon(lambda: heard.received == 1)
    assert heard.take().linear.x == 3.0
    assert heard.take() is None


def test_latching_gives_a_late_subscriber_the_last_message(node):
    a, b = node("a"), node("b")
    latched, plain = a.publisher("/latched", TWIST, latch=True), a.publisher("/plain", TWIST)
    for x in (1.0, 2.0):
        latched.publish(twist(x))
        plain.publish(twist(x))
    first, second = b.subscribe("/latched", TWIST), b.subscribe("/plain", TWIST)
    expect_soon(lambda: first.received == 1 and plain.connections == 1)
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
    expect_soon(lambda: out.connections == 1)
    out.publish(twist(9.0))
    a.close()
    expect_soon(lambda: heard.received == 1)
    assert heard.latest()[1].linear.x == 9.0


def test_both_ends_of_a_topic_in_one_node(node):
    a = node("a")
    out = a.publisher("/t", TWIST)
    first, second = a.subscribe("/t", TWIST), a.subscribe("/t", TWIST)
    expect_soon(lambda: first.connections == second.connections == out.connections == 1)
    out.publish(twist(1.0))
    expect_soon(lambda: first.received == 1 and second.received == 1)
    first.close()
    assert first.connections == 0
    out.publish(twist(2.0))
    expect_soon(lambda: second.received == 2)
    assert first.received == 1
    with pytest.raises(InputError, match="type of /t is 'sensor_msgs/Joy'; allowed: geometry_msgs/Twist"):
        a.subscribe("/t", "sensor_msgs/Joy")
    second.close()
    expect_soon(lambda: out.connections == 0)
    out.publish(twist(3.0))
    third = a.subscribe("/t", TWIST)
    expect_soon(lambda: out.connections == third.connections == 1)
    assert third.received == 0


def test_a_second_listener_gets_what_was_latched(node):
    """There is one connection, on which the publisher sends it once."""
    a, b = node("a"), node("b")
    out = a.publisher("/t", TWIST, latch=True)
    out.publish(twist(1.0))
    first = b.subscribe("/t", TWIST)
    expect_soon(lambda: first.received == 1)
    got = []
    second = b.subscribe("/t", TWIST, got.append)
    assert [m.linear.x for m in got] == [1.0] and second.received == 1
    out.publish(twist(2.0))
    expect_soon(lambda: first.received == 2 and second.received == 2)
    assert out.connections == 1


def test_a_restarted_publisher_is_heard_again(node, master):
    heard = node("b").subscribe("/t", TWIST)
    for x in (1.0, 2.0):
        with Ros1Node("a", master.uri, poll=POLL) as a:
            a.publisher("/t", TWIST, latch=True).publish(twist(x))
            expect_soon(lambda x=x: heard.received == int(x))
        assert heard.latest()[1].linear.x == x


def test_a_restarted_master_hears_of_all_again(node, master):
    a, b = node("a"), node("b")
    out, heard = a.publisher("/t", TWIST), b.subscribe("/t", TWIST)
    expect_soon(lambda: out.connections == 1)
    master.stop()
    expect_soon(lambda: not a.master_there and not b.master_there)
    out.publish(twist(1.0))
    expect_soon(lambda: heard.received == 1, "messages while the master is away")
    master.start()
    expect_soon(lambda: "/a" in master.publishers.get("/t", {}) and "/b" in master.subscribers.get("/t", {}))
    later = node("c").subscribe("/t", TWIST)
    expect_soon(lambda: out.connections == 2)
    out.publish(twist(2.0))
    expect_soon(lambda: later.received == 1)
    expect_soon(lambda: len(a.log.lines) > 1 and len(b.log.lines) > 1, "the line that it is back")
    for one, done in ((a, "topics published: 1, subscribed: 0"), (b, "topics published: 0, subscribed: 1")):
        gone, back = one.log.lines
        assert gone.startswith("master: gone; topics that are connected go on without it (lookupNode of http://")
        assert back == f"master: back; registered anew, {done}"


def test_a_name_that_another_node_took_is_reported_once(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    other = "http://127.0.0.1:1/"
    looks = []

    def _lookup(caller: str, name: str) -> list:
        looks.append(name)
        return [1, "", other]

    master._server.register_function(_lookup, "lookupNode")
    expect_soon(lambda: len(looks) > 4)
    assert list(a.log.lines) == ["master: another node took the name /a"]


def test_a_master_that_refuses_a_registration_is_reported_once(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    tried = []

    def _refuse(*arguments: str) -> list:
        tried.append(arguments)
        return [-1, "not today", 0]

    master._server.register_function(_refuse, "registerPublisher")
    master.publishers.clear()
    expect_soon(lambda: len(tried) > 4)
    assert [line for line in a.log.lines if "not today" in line] == list(a.log.lines)
    assert len(a.log.lines) == 1 and not a.master_there
    master._server.register_function(master._registerPublisher, "registerPublisher")
    expect_soon(lambda: a.master_there)
    assert a.log.lines[-1].startswith("master: back; registered anew, topics published: 1")


def test_a_connection_outlives_its_listing(node, master):
    """A restarted master lists a publisher only when that has come back; what it does not list is not tried again."""
    a, b = node("a"), node("b")
    out, heard = a.publisher("/t", TWIST), b.subscribe("/t", TWIST)
    expect_soon(lambda: out.connections == 1 and heard.connections == 1)
    call(b.uri, "publisherUpdate", "/master", "/t", [])
    out.publish(twist(1.0))
    expect_soon(lambda: heard.received == 1)
    assert out.connections == 1
    a.close()
    expect_soon(lambda: heard.connections == 0 and not heard.topic._links)


def test_a_master_that_restarted_between_two_looks_is_noticed(node, master):
    a = node("a")
    a.publisher("/t", TWIST)
    master.publishers.clear()
    expect_soon(lambda: "/a" in master.publishers.get("/t", {}))
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
            # on 127.0.0.1 another test may listen at the same number
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection(("127.0.0.3", port), timeout=PATIENCE)


def test_check_master(master):
    assert check_master(master.uri) is None
