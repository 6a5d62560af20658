"""The log of what went wrong."""

from __future__ import annotations

from collections import Counter

from otwarp.ros.ros1.log import MOST_LINES, EventLog


def test_the_log_is_bounded_and_printable():
    log = EventLog()
    for n in range(3 * MOST_LINES):
        log.note("rpc", f"{n}\n\x1b[31m" + "x" * 1000)
    assert len(log.lines) == MOST_LINES
    assert log.counts == Counter(rpc=3 * MOST_LINES)
    assert all(line.isprintable() and len(line) < 300 for line in log.lines)
