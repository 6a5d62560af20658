"""Subscribers that misbehave cost their connection and delay nobody."""

from __future__ import annotations

import socket

import pytest

from otwarp.ros.ros1.messages import message_type, types
from otwarp.ros.ros1.node import Ros1Node
from otwarp.ros.ros1.rpc import call
from otwarp.ros.ros1.wire import decode_header, encode_header, packed, receive_header

from .golden import message_of
from .setups import PATIENCE, TWIST, expect_soon, twist


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
def test_a_subscriber_gets_the_type(node, changed):
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
def test_a_subscriber_that_does_not_fit_gets_the_reason(node, sent, kind, says):
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
    expect_soon(lambda: a.log.counts["malformed"] == 1)
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
        expect_soon(lambda: out.connections == 2)

        def one_more() -> bool:
            out.publish(big)
            return a.log.counts["dropped"] > 5 and heard.received > 5

        expect_soon(one_more, "dropped messages")
    expect_soon(lambda: (out.publish(big), out.connections == 1)[1], "the deaf one's end")
