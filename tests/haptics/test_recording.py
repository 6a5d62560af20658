"""Our bytes against those of rosbags, and bytes that are none."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from otwarp.errors import InputError
from otwarp.haptics.core import CYCLE, SceneFrame, SphereFrame, TrapFrame
from otwarp.haptics.recording import (
    CYCLES_TYPE,
    DEFINITIONS,
    MAGIC,
    SCENE_TYPE,
    McapFile,
    beat_of,
    pack_cycles,
    pack_scene,
    pack_text,
    unpack_cycles,
    unpack_scene,
    unpack_text,
)
from tests.haptics.core.test_ring import record

number = st.floats(allow_nan=False, width=64)
vector = st.tuples(number, number, number)
index = st.integers(-(2**63), 2**63 - 1)
scenes = st.builds(
    SceneFrame,
    beat=st.integers(0, 2**64 - 1),
    time=number,
    spheres=st.lists(st.builds(SphereFrame, vector, index), max_size=3).map(tuple),
    traps=st.lists(st.builds(TrapFrame, index, vector, number), max_size=3).map(tuple),
    contact_force=number,
)


@pytest.fixture(scope="module")
def store():
    found = get_typestore(Stores.ROS2_JAZZY)
    for name, text in DEFINITIONS.items():
        found.register(get_types_from_msg(text, name))
    return found


@given(scene=scenes)
@settings(max_examples=100, deadline=None)
def test_states_are_what_rosbags_writes_and_come_back_bit_for_bit(store, scene):
    data = pack_scene(scene)
    message = store.types[SCENE_TYPE](
        beat=scene.beat,
        time=scene.time,
        contact_force=scene.contact_force,
        trap_index=np.array([t.index for t in scene.traps], dtype=np.int64),
        trap_position=np.array([t.position for t in scene.traps], dtype=np.float64).ravel(),
        trap_power=np.array([t.power for t in scene.traps], dtype=np.float64),
        sphere_body=np.array([s.body for s in scene.spheres], dtype=np.int64),
        sphere_position=np.array([s.position for s in scene.spheres], dtype=np.float64).ravel(),
    )
    assert data == bytes(store.serialize_cdr(message, SCENE_TYPE))
    assert repr(unpack_scene(data)) == repr(scene)
    assert beat_of(data) == scene.beat


@given(hand=st.sampled_from(["left", "right", "é", ""]), count=st.integers(0, 4), lost=st.integers(0, 2**64 - 1))
@settings(max_examples=60, deadline=None)
def test_cycles_are_what_rosbags_reads(store, hand, count, lost):
    records = b"".join(CYCLE.pack(*record(n)) for n in range(count))
    data = pack_cycles(hand, lost, records)
    message = store.deserialize_cdr(data, CYCLES_TYPE)
    assert (message.hand, message.lost) == (hand, lost)
    assert [cycle.tick for cycle in message.cycles] == list(range(count))
    assert [cycle.moved.z for cycle in message.cycles] == [100.0 * n + 24 for n in range(count)]
    assert bytes(store.serialize_cdr(message, CYCLES_TYPE)) == data
    assert unpack_cycles(data) == (hand, lost, records)
    assert unpack_cycles(data + b"\0\0") == (hand, lost, records)


@given(text=st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])))
def test_texts_are_what_rosbags_reads(store, text):
    assert store.deserialize_cdr(pack_text(text), "std_msgs/msg/String").data == text == unpack_text(pack_text(text))


@given(data=st.binary(max_size=120), cut=st.integers(0, 400), head=st.booleans())
@settings(max_examples=200, deadline=None)
def test_no_bytes_do_more_than_raise_one_line(data, cut, head):
    whole = pack_cycles("left", 1, CYCLE.pack(*record(1)))
    state = pack_scene(SceneFrame(1, math.nan, (SphereFrame((0.0, 1.0, 2.0), 0),), (), math.inf))
    for junk in (whole[:cut], state[:cut], whole[:24] + data, state[:28] + data, (b"\0\1\0\0" if head else b"") + data):
        for read in (unpack_cycles, unpack_scene, unpack_text, beat_of):
            try:
                read(junk)
            except InputError as error:
                assert "\n" not in str(error)


@given(data=st.binary(max_size=300))
@settings(max_examples=200, deadline=None)
def test_no_file_does_more_than_end_or_raise_one_line(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("junk") / "junk.mcap"
    path.write_bytes(MAGIC + data)
    with McapFile(path) as file:
        try:
            assert list(file.messages()) == []
        except InputError as error:
            assert "\n" not in str(error)


def packed(operation: int, content: bytes) -> bytes:
    return struct.pack("<BQ", operation, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def test_chunks_are_read_in_place_and_checked(tmp_path):
    schema = packed(3, struct.pack("<H", 1) + text("a/msg/B") + text("ros2msg") + text(""))
    channel = packed(4, struct.pack("<2H", 7, 1) + text("/b") + text("cdr") + struct.pack("<I", 0))
    message = packed(5, struct.pack("<HIQQ", 7, 0, 42, 42) + b"hello")
    inner, path = schema + channel + message, tmp_path / "a.mcap"

    def chunk(checksum: int, compression: str = "", body: bytes = inner) -> bytes:
        head = struct.pack("<QQQI", 0, 1, len(inner), checksum)
        return packed(6, head + text(compression) + struct.pack("<Q", len(body)) + body)

    from zlib import crc32

    for checksum in (0, crc32(inner)):
        path.write_bytes(MAGIC + packed(1, text("ros2") + text("x")) + chunk(checksum) + packed(2, bytes(20)) + MAGIC)
        with McapFile(path) as file:
            found = [(m.topic, m.kind, m.time, bytes(m.data)) for m in file.messages()]
            assert found == [("/b", "a/msg/B", 42, b"hello")]
            assert file.complete
            assert list(file.messages(["/c"])) == []
    for bad, says in ((chunk(1), "checksum"), (chunk(0, "lz4"), "'lz4'"), (chunk(0, body=inner[:-1]), "checksum")):
        path.write_bytes(MAGIC + bad)
        with McapFile(path) as file, pytest.raises(InputError, match=says):
            list(file.messages())
