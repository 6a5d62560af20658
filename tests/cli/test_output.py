"""What commands print: numbers of things."""

from __future__ import annotations

from otwarp.cli.output import counted


def test_one_thing_is_no_plural() -> None:
    assert (counted(1, "body", "bodies"), counted(1200, "solid")) == ("1 body", "1,200 solids")
