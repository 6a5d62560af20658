"""XML-RPC: what a node answers, what strangers send to it, and what a master may answer."""

from __future__ import annotations

import socket
import threading
import xmlrpc.client
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.ros.ros1.log import EventLog
from otwarp.ros.ros1.rpc import MOST_BODY, MOST_CALLERS, NoAnswer, Refused, SlaveServer, answer, call, parse
from otwarp.ros.ros1.wire import Malformed

from .setups import PATIENCE, TWIST, expect_soon

BOMB = b"""<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>
<methodCall><methodName>getPid</methodName><params><param><value><string>&b;</string></value></param></params>
</methodCall>"""

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**31), 2**31 - 1)
    | st.floats(allow_nan=False)
    | st.text("ab<&", max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("ab", max_size=2), inner, max_size=2),
    max_leaves=6,
)


def methods(seen: list[Any]) -> dict[str, Any]:
    def one(caller: str, number: int = 0) -> list[Any]:
        if not isinstance(caller, str):
            raise TypeError("caller")
        seen.append((caller, number))
        return [1, "", number if isinstance(number, int) else 0]

    return {"one": one}


@given(st.lists(VALUES, max_size=4), st.sampled_from(["one", "other", ""]))
@settings(max_examples=150, deadline=None)
def test_calls_with_any_arguments_are_answered(arguments, name):
    body = xmlrpc.client.dumps(tuple(arguments), name, allow_none=True).encode()
    log, seen = EventLog(), []
    reply = answer(methods(seen), body, log)
    try:
        (value, _) = xmlrpc.client.loads(reply)
    except xmlrpc.client.Fault:
        assert not seen and log.counts["rpc"] == 1
    else:
        assert value[0][0] == (1 if seen else -1)


@given(st.data())
@settings(max_examples=300, deadline=None)
def test_no_bytes_break_the_slave(data):
    """Any bytes, and a good call with some of its bytes changed."""
    good = xmlrpc.client.dumps(("/me", 3), "one").encode()
    body = bytearray(data.draw(st.one_of(st.just(good), st.binary(max_size=100))))
    for at in data.draw(st.lists(st.integers(0, max(len(body) - 1, 0)), max_size=4)):
        if body:
            body[at] = data.draw(st.integers(0, 255))
    reply = answer(methods([]), bytes(body), EventLog())
    parser, answered = xmlrpc.client.getparser()
    parser.feed(reply)
    parser.close()  # well-formed XML
    assert answered.getmethodname() is None, "an answer, and no call"


def test_entities_are_refused():
    with pytest.raises(Malformed, match="document type"):
        parse(BOMB)
    with pytest.raises(Malformed, match="document type"):
        parse(BOMB.decode().encode("utf-16"))


def test_deep_nesting_ends_in_an_answer():
    deep = b"<array><data><value>" * 20_000 + b"1" + b"</value></data></array>" * 20_000
    body = (
        b"<methodCall><methodName>one</methodName><params><param><value>"
        + deep
        + b"</value></param></params></methodCall>"
    )
    assert b"wrong arguments" in answer(methods([]), body, EventLog())


@pytest.fixture
def slave():
    log = EventLog()
    server = SlaveServer("127.0.0.1", methods([]), log)
    yield server
    server.close()


def talk(port: int, request: bytes) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as sock:
        sock.sendall(request)
        sock.shutdown(socket.SHUT_WR)
        answered = b""
        while chunk := sock.recv(4096):
            answered += chunk
        return answered


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"POST / HTTP/1.0\r\n\r\n", b"411"),
        (b"POST / HTTP/1.0\r\nContent-Length: -1\r\n\r\n", b"411"),
        (b"POST / HTTP/1.0\r\nContent-Length: 99999999999\r\n\r\n", b"413"),
        (b"GET / HTTP/1.0\r\n\r\n", b"501"),
        (b"nonsense\r\n\r\n", b"400"),
        (b"POST / HTTP/1.0\r\nContent-Length: 3\r\n\r\nabc", b"200"),
    ],
)
def test_bad_http_gets_a_status(slave, request_, status):
    assert status in talk(slave.server_address[1], request_).split(b"\r\n")[0]
    assert call(f"http://127.0.0.1:{slave.server_address[1]}/", "one", "/me", 5) == 5


def test_a_call_that_ends_early_is_noted(slave):
    assert talk(slave.server_address[1], b"POST / HTTP/1.0\r\nContent-Length: 30\r\n\r\nabc") == b""
    expect_soon(lambda: slave.log.counts["rpc"] == 1)


def test_silent_callers_do_not_pile_up(slave):
    port = slave.server_address[1]
    silent = [socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) for _ in range(MOST_CALLERS + 3)]
    try:
        expect_soon(lambda: slave.log.counts["refused"] == 3)
    finally:
        for sock in silent:
            sock.close()
    uri = f"http://127.0.0.1:{port}/"

    def answers() -> bool:
        try:
            return call(uri, "one", "/me", 1) == 1
        except NoAnswer:
            return False

    expect_soon(answers, "a free place")


def serve_once(reply: bytes) -> str:
    """URI of a server that sends these bytes to its first caller and hangs up."""
    listening = socket.create_server(("127.0.0.1", 0))

    def run() -> None:
        with listening, listening.accept()[0] as sock:
            sock.settimeout(PATIENCE)
            while b"</methodCall>" not in sock.recv(65536):
                pass
            sock.sendall(reply)

    threading.Thread(target=run, daemon=True).start()
    return f"http://127.0.0.1:{listening.getsockname()[1]}/"


def http_reply(body: bytes, status: str = "200 OK") -> bytes:
    return f"HTTP/1.0 {status}\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body


@pytest.mark.parametrize(
    ("reply", "says"),
    [
        (b"", "closed connection"),
        (b"garbage\r\n\r\n", "garbage"),
        (http_reply(b"", "404 Not Found"), "HTTP status 404"),
        (http_reply(b"<x/>"), "no XML-RPC"),
        (http_reply(BOMB), "document type"),
        (http_reply(xmlrpc.client.dumps((3,), methodresponse=True).encode()), r"no \[code, text, value\]"),
        (http_reply(xmlrpc.client.dumps((["a", "b", 3],), methodresponse=True).encode()), r"no \[code, text, value\]"),
        (http_reply(xmlrpc.client.dumps(xmlrpc.client.Fault(1, "no"), methodresponse=True).encode()), "fault no"),
        (b"HTTP/1.0 200 OK\r\n\r\n" + b"x" * (MOST_BODY + 1), "answer above"),
    ],
)
def test_a_bad_answer_is_one_line(reply, says):
    with pytest.raises(NoAnswer, match=says) as error:
        call(serve_once(reply), "getPid", "/me", timeout=PATIENCE)
    assert "\n" not in str(error.value)


def test_a_refusal_is_not_silence():
    body = xmlrpc.client.dumps(([-1, "unknown node", 0],), methodresponse=True).encode()
    with pytest.raises(Refused, match="unknown node"):
        call(serve_once(http_reply(body)), "lookupNode", "/me", "/you", timeout=PATIENCE)
    with pytest.raises(NoAnswer, match="no http://host:port"):
        call("file:///etc/passwd", "getPid", "/me")


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
    expect_soon(lambda: not master.publishers["/t"])
    assert not a.alive
    assert any("same name" in line for line in a.log.lines)
