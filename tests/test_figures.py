"""The pictures of docs/architecture.md show the code as it is."""

from __future__ import annotations

from importlib import import_module

import pytest

from docs.figures import flow, rooms, style

ANEW = "out of date: run `make figures`"


@pytest.mark.parametrize("picture", [rooms, flow], ids=lambda p: p.NAME)
def test_a_picture_shows_what_there_is(picture):
    assert style.saved_data(picture.NAME) == picture.data(), ANEW


def rows(table: str) -> dict[str, str]:
    """Room → whom it may import; what a room says of itself may be reworded without drawing anew."""
    cells = [line.split(" | ") for line in table.splitlines()[2:]]
    assert all(len(row) == 3 and row[1] for row in cells)
    return {row[0]: row[2] for row in cells}


def test_the_table_of_rooms_lists_what_there_is():
    text = rooms.PAGE.read_text()
    assert rows(text.split(rooms.BEGIN)[1].split(rooms.END)[0].strip()) == rows(rooms.table()), ANEW


@pytest.mark.parametrize("node", [node for node in flow.NODES.values() if node.code], ids=lambda n: n.title)
def test_a_box_names_code(node):
    module, _, name = node.code.partition(":")
    found = import_module(module)
    assert not name or hasattr(found, name)


def test_arrows_join_boxes():
    assert {name for edge in flow.EDGES for name in edge} == set(flow.NODES)
