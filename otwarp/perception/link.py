"""What the session tells the processes beside it, as latest values in shared memory: traps, and where to look."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from otwarp.haptics.core.shared_memory import Mailbox, RecordLayout
from otwarp.perception.camera import Region
from otwarp.perception.estimator import Wanted

KEPT = 64
"""Last commands that lie in the box: half a second of a loop with 120 turns, which is how long a reader may be away."""

_BODY = 11
"""Numbers of a body that is wanted: index, region (4), whether something is expected, pose (5)."""


def command_layout(traps: int) -> RecordLayout:
    """Restarts, commands so far, and the last `KEPT` of them: time, positions, powers of all traps."""
    return RecordLayout(b"command", f"2q{KEPT * (1 + 4 * traps)}d")


def wanted_layout(bodies: int) -> RecordLayout:
    """When it was said, and what is wanted of each body."""
    return RecordLayout(b"wanted", f"{1 + _BODY * bodies}d")


class CommandWriter:
    """The session's end of the box of commands.

    Args:
        traps: How many.
    """

    def __init__(self, traps: int):
        self.box = Mailbox.create(command_layout(traps))
        self._width, self._count, self._restarts = 1 + 4 * traps, 0, 0
        self._rows: deque[list[float]] = deque([[0.0] * self._width] * KEPT, maxlen=KEPT)

    def restart(self) -> None:
        """The laboratory begins anew with the next command."""
        self._restarts += 1

    def write(self, time: float, position: np.ndarray, power: np.ndarray) -> None:
        """A command: time [s], (T, 3) [µm], (T) [mW]."""
        self._count += 1
        self._rows.append([time, *position.ravel().tolist(), *power.tolist()])
        self.box.write((self._restarts, self._count, *(v for row in self._rows for v in row)))


class CommandReader:
    """The laboratory's end.

    Args:
        name: Of the box.
        traps: How many.

    Attributes:
        restarts: How often it was to begin anew.
        missed: Commands that went by unread.
    """

    def __init__(self, name: str, traps: int):
        self._box = Mailbox.attach(command_layout(traps), name)
        self._traps, self._seen = traps, 0
        self.restarts = self.missed = 0

    def read(self) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Commands since the last call, in their order."""
        told = self._box.read()
        if told is None:
            return []
        self.restarts, count = told[0], told[1]
        new = count - self._seen
        self.missed += max(0, new - KEPT)
        self._seen = count
        rows = np.array(told[2:]).reshape(KEPT, -1)[KEPT - min(new, KEPT) :]
        t = self._traps
        return [(float(row[0]), row[1 : 1 + 3 * t].reshape(t, 3), row[1 + 3 * t :]) for row in rows]

    def close(self) -> None:
        """Let go of it."""
        self._box.close()


def packed(time: float, wanted: Sequence[Wanted]) -> tuple[float, ...]:
    """For the box of what is wanted, at a time of the session's clock [s]."""
    row: list[float] = [time]
    for one in wanted:
        r, guess = one.region, one.guess
        row += [one.body, r.left, r.low, r.width, r.height, float(guess is not None)]
        row += [0.0] * 5 if guess is None else [float(v) for v in guess]
    return tuple(row)


def unpacked(row: Sequence[float]) -> tuple[float, tuple[Wanted, ...]]:
    """Back from the box."""
    found = []
    for n in range(1, len(row), _BODY):
        body, left, low, width, height, known = (int(v) for v in row[n : n + 6])
        found.append(
            Wanted(body, Region(left, low, width, height), np.array(row[n + 6 : n + _BODY]) if known else None)
        )
    return row[0], tuple(found)
