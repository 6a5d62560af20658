"""What a node answers to the calls of a master and of other nodes."""

from __future__ import annotations

import xmlrpc.client

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.rpc import Refused, call
from otwarp.ros.ros1.slave import answer

from .setups import TWIST, wait_for


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
