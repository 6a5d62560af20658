"""Headers and frames: what is written is read back, and nothing a stranger sends does worse than `Malformed`."""

from __future__ import annotations

import struct
import tracemalloc
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.ros.ros1.wire import MOST_FIELDS, Frames, Malformed, decode_header, encode_header, packed

NAMES = st.text(st.characters(exclude_characters="=", exclude_categories=("Cs",)), min_size=1, max_size=12)
VALUES = st.text(st.characters(exclude_categories=("Cs",)), max_size=40)


def test_golden_header():
    """The example of the ROS wiki's `ROS/Connection Header`, field for field."""
    fields = {"topic": "/foo", "latching": "1"}
    body = b"\x0a\x00\x00\x00topic=/foo" + b"\x0a\x00\x00\x00latching=1"
    assert encode_header(fields) == b"\x1c\x00\x00\x00" + body
    assert decode_header(body) == fields


@given(st.dictionaries(NAMES, VALUES, max_size=MOST_FIELDS))
@settings(deadline=None)
def test_headers_come_back(fields):
    (body,) = Frames().feed(encode_header(fields))
    assert decode_header(body) == fields


@given(st.binary(max_size=200))
@settings(max_examples=300, deadline=None)
def test_no_bytes_break_the_header_parser(body):
    try:
        fields = decode_header(body)
    except Malformed as error:
        assert "\n" not in str(error)
    else:
        (again,) = Frames().feed(encode_header(fields))
        assert again == body


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (b"\x01\x00", "within a field's length"),
        (b"\xff\xff\xff\xffab", "4294967295 bytes where 2 are left"),
        (b"\x03\x00\x00\x00abc", "without a name"),
        (b"\x02\x00\x00\x00=v", "without a name"),
        (b"\x03\x00\x00\x00a=\xff", "not UTF-8"),
        (packed(b"a=1") * 2, "twice"),
        (b"".join(packed(f"f{n}=".encode()) for n in range(MOST_FIELDS + 1)), "more than"),
    ],
)
def test_malformed_headers_say_why(body, says):
    with pytest.raises(Malformed, match=says):
        decode_header(body)


@given(st.lists(st.binary(max_size=30), max_size=8), st.lists(st.integers(0, 300), max_size=8))
@settings(deadline=None)
def test_frames_do_not_depend_on_how_the_stream_is_cut(bodies, cuts):
    stream = b"".join(packed(body) for body in bodies) + b"\x05\x00"
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    frames, got = Frames(64), []
    for low, high in pairwise(edges):
        got += frames.feed(stream[low:high])
    assert got == bodies
    assert frames.rest == b"\x05\x00"


@given(st.binary(max_size=300), st.integers(0, 40))
@settings(max_examples=300, deadline=None)
def test_no_stream_breaks_the_frames(stream, most):
    frames = Frames(most)
    try:
        bodies = frames.feed(stream)
    except Malformed:
        return
    assert b"".join(map(packed, bodies)) + frames.rest == stream
    assert all(len(body) <= most for body in bodies)


def test_a_claimed_length_allocates_nothing():
    frames = Frames(1 << 30)
    tracemalloc.start()
    assert frames.feed(struct.pack("<I", 1 << 30) + b"abc") == []
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1 << 16
    with pytest.raises(Malformed, match="at most 1073741824"):
        Frames(1 << 30).feed(struct.pack("<I", (1 << 30) + 1))


def test_a_header_may_bring_the_first_message_along():
    frames = Frames()
    stream = packed(b"header") + packed(b"message")
    assert frames.feed(stream, most=1) == [b"header"]
    assert frames.rest == packed(b"message")
