"""Publishers that misbehave cost their connection and are tried again; callbacks that raise are noted."""

from __future__ import annotations

import struct
import threading

import pytest

from otwarp.ros.ros1 import subscriber
from otwarp.ros.ros1.rpc import call
from otwarp.ros.ros1.wire import encode_header, packed

from .golden import bytes_of
from .setups import PATIENCE, TWIST, BadPublisher, MasterDouble, expect_soon, good_header, twist


def heard_from(node, master: MasterDouble, bad: BadPublisher):
    """A subscription that knows this publisher only."""
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
        expect_soon(lambda: heard.received >= 1)
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
    expect_soon(lambda: out.connections == 1)
    for _ in range(2):
        out.publish(twist(1.0))
    assert seen.acquire(timeout=PATIENCE) and seen.acquire(timeout=PATIENCE)
    expect_soon(lambda: b.log.counts["callback"] == 2)
    assert "RuntimeError: oh no" in b.log.lines[0]
