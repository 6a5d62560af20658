"""`CycleReader`: what the parent of a servo fetches of a recording: cycles, and the states that they were given."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from otwarp.haptics.core import CYCLE, SceneFrame
from otwarp.haptics.core.shared_memory import Mailbox, Ring
from otwarp.haptics.servo.link import Cycles, Start

KEPT = 16384
"""States that wait for `drain` while a recording runs: more than a ring's 8 s of them."""


class CycleReader:
    """The parent's ends of the rings of all sides, and the states that it published meanwhile.

    Args:
        rings: Of the cycles of each side.
        starts: Of what its chain remembered when a recording began.

    Attributes:
        recording: Number of the recording that runs, for the servo's orders; 0 for none.
    """

    def __init__(self, rings: Sequence[Ring], starts: Sequence[Mailbox[Start]]):
        self._rings, self._boxes = tuple(rings), tuple(starts)
        self._starts: list[Start | None] = [None] * len(self._rings)
        self._lost = [0] * len(self._rings)
        self._published: deque[SceneFrame] = deque(maxlen=KEPT)
        self._keeping = False
        self._count = self.recording = 0

    def published(self, scene: SceneFrame) -> None:
        """A state that the servo was told."""
        if not self._keeping:
            self._published.clear()
        self._published.append(scene)

    def record(self, on: bool) -> int:
        """Begin a recording of all sides, or end it; `recording` from now on."""
        if on:
            for i, ring in enumerate(self._rings):
                ring.drain()
                self._starts[i], self._lost[i] = None, ring.lost
            while len(self._published) > 1:  # the servo may not have read the last one yet
                self._published.popleft()
            self._keeping = True
        self._count += on
        self.recording = self._count if on else 0
        return self.recording

    def drain(self, hand: int) -> Cycles:
        """The cycles of one side since the last call, while a recording runs and after it; never blocks.

        To be called at least every `shared_memory.SECONDS`.
        """
        new = self._boxes[hand].read()
        if new is not None and new.recording == self._count:
            self._starts[hand] = new
        start, ring = self._starts[hand], self._rings[hand]
        if start is None:
            return Cycles()  # the records wait for it
        scenes: tuple[SceneFrame, ...] = ()
        if self._keeping:
            scenes = tuple(self._published)
            self._published.clear()
            self._keeping = self.recording > 0
        records, skip = ring.drain(), 0
        # what an earlier recording left comes first
        while skip < len(records) and int.from_bytes(records[skip : skip + 8], "little") < start.tick:
            skip += CYCLE.size
        return Cycles(records[skip:], ring.lost - self._lost[hand], start, scenes)
