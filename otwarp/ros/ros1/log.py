"""What went wrong on the wire: one line each, the newest hundred, and a count of every kind."""

from __future__ import annotations

import threading
from collections import Counter, deque

MOST_LINES = 100
LONGEST_LINE = 240


class EventLog:
    """Bounded record of events; safe from any thread.

    Attributes:
        counts: How often each kind of event came: `connection`, `malformed`, `md5`, `dropped`, `callback`, `master`,
            `rpc`, `refused`.
        lines: The newest events, one line each.
        noted: How many lines there were.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.lines: deque[str] = deque(maxlen=MOST_LINES)
        self.noted = 0
        self._lock = threading.Lock()

    def count(self, kind: str, times: int = 1) -> None:
        """Count an event that is not worth a line."""
        with self._lock:
            self.counts[kind] += times

    def note(self, kind: str, text: str) -> None:
        """Count an event and keep its line; what a peer put into it is shortened and printable."""
        line = "".join(c if c.isprintable() else " " for c in text)[:LONGEST_LINE]
        with self._lock:
            self.counts[kind] += 1
            self.noted += 1
            self.lines.append(f"{kind}: {line}")

    def since(self, noted: int) -> tuple[int, list[str]]:
        """`noted` now, and the lines that came since it had this value, those that are still kept."""
        with self._lock:
            new = min(self.noted - noted, len(self.lines))
            return self.noted, list(self.lines)[-new:] if new > 0 else []
