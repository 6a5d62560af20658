"""The JSON of the Haply Inverse Service: what the documents show, and whatever else may come."""

from __future__ import annotations

import copy
import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.haptics.devices.inverse3_messages import (
    ABSENT,
    BadMessage,
    CursorState,
    force_command,
    greeting,
    read_inventory,
    read_state,
)
from tests.haptics.haply_service import HaplyService


@given(x=st.floats(-5.0, 5.0), y=st.floats(-5.0, 5.0), z=st.floats(-5.0, 5.0))
def test_a_force_and_a_position_turn_the_same_way(x, y, z):
    """The work of a force is the same in both frames."""
    words = json.loads(force_command("A", (x, y, z), "vector"))
    theirs = words["inverse3"][0]["commands"]["set_cursor_force"]["vector"]
    frame = {"inverse3": [{"device_id": "A", "state": {"cursor_position": theirs}}]}
    assert read_state(json.dumps(frame), "A", None) == CursorState(True, (x, y, z), 0)


JUNK = [
    b"",
    b"\x00\xff\xfe",
    b"{",
    b"[]",
    b"null",
    b"1e999",
    b'"inverse3"',
    b"[" * 100_000,
    b'{"inverse3": 3}',
    b'{"inverse3": [3]}',
    b'{"inverse3": [{}]}',
    b'{"inverse3": [{"device_id": 7}]}',
    b'{"inverse3": [{"device_id": "049D"}]}',
    b'{"inverse3": [{"device_id": "049D", "state": []}]}',
    b'{"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": 1, "y": 2}}}]}',
    b'{"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": NaN, "y": 0, "z": 0}}}]}',
    b'{"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": true, "y": 0, "z": 0}}}]}',
    b'{"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": 1' + b"0" * 400 + b', "y": 0, "z": 0}}}]}',
    b'{"inverse3": [{"device_id": "049D", "state": {"cursor_position": {"x": "0", "y": 0, "z": 0}}}]}',
]


@pytest.mark.parametrize("junk", JUNK, ids=range(len(JUNK)))
def test_junk_is_refused(junk):
    with pytest.raises(BadMessage):
        read_state(junk, "049D", "61548")


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["inverse3", "device_id", "state", "cursor_position", "x", "y", "z", "status", "ready"])
            | st.text(max_size=4),
            inner,
            max_size=4,
        )
    ),
    max_leaves=20,
)


@given(st.binary(max_size=64) | json_values.map(lambda value: json.dumps(value).encode()))
@settings(max_examples=300, deadline=None)
def test_any_message_is_read_or_refused(message):
    for read in (read_inventory, lambda text: read_state(text, "049D", "61548")):
        try:
            found = read(message)
        except BadMessage:
            continue
        if isinstance(found, CursorState) and found.position is not None:
            assert all(abs(x) <= 10.0 for x in found.position)


@given(st.data())
@settings(max_examples=300, deadline=None)
def test_a_state_with_one_thing_wrong_is_read_or_refused(data):
    frame = json.loads(HaplyService(grips=("61548",))._frame(full=True))
    inner = frame
    while isinstance(inner, dict | list) and inner:
        keys = list(inner) if isinstance(inner, dict) else range(len(inner))
        key = data.draw(st.sampled_from(list(keys)))
        if data.draw(st.booleans()) or not isinstance(inner[key], dict | list) or not inner[key]:
            inner[key] = data.draw(json_values)
            break
        inner = inner[key]
    try:
        state = read_state(json.dumps(frame), "049D", "61548")
    except BadMessage:
        return
    assert state.buttons in range(8) and (state.position is None or all(map(math.isfinite, state.position)))


def test_messages_read_as_the_documents_show_them():
    """The inventory in the pages of 3.4, cut to what matters: type names and numbers are theirs."""
    inventory = {
        "inverse3": [
            {
                "device_id": "04BA",
                "config": {"type": "inverse3", "handedness": "right", "torque_scaling": {"enabled": True}},
                "state": {
                    "angular_position": {"a0": -69.31704, "a1": 137.62952, "a2": 19.832787},
                    "cursor_position": {"x": 0.07842738, "y": -0.14836666, "z": 0.14297646},
                    "mode": "idle",
                },
                "status": {"calibrated": False, "in_use": False, "power_supply": True, "ready": True, "started": True},
            }
        ],
        "verse_grip": [{"device_id": "61548", "state": {"button": True, "hall": 0}}],
    }
    text = json.dumps(inventory)
    found = read_inventory(text)
    assert (found.devices, found.grips, found.key, found.unready) == (("04BA",), ("61548",), "values", frozenset())
    assert read_state(text, "04BA", "61548") == CursorState(True, (0.07842738, 0.14297646, 0.14836666), 1)
    assert read_state(text, "04BA", None).buttons == 0
    assert read_state(text, "04BA", "absent").buttons == 0
    assert read_state(text, "049D", None) is ABSENT
    newer = copy.deepcopy(inventory) | {"session_id": 7}
    assert read_inventory(json.dumps(newer)).key == "vector"
    assert "session" not in json.loads(greeting("04BA", "values"))
