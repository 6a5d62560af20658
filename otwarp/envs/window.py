"""The page of live sessions as the window of an environment: drawn after every step, in a browser."""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from otwarp.envs.batch import Batch


class Window:
    """Shows a world of a batch on a page, which a process of its own serves, until `close`.

    The address is written to stderr. The page shows frames in pace with the clock as far as it can and leaves out
    others; whoever asks on it for something is told that actions move the traps.

    Args:
        batch: The worlds.
        port: None for 8080 or the next free one, 0 for any free one.
        say: Gets the line with the address.

    Attributes:
        url: What to open in a browser.

    Raises:
        InputError: viser is not installed, or no port is free.
    """

    def __init__(self, batch: Batch, *, port: int | None = None, say: Callable[[str], None] | None = None):
        from otwarp.teleop.page import PageProcess

        self.batch, self._beat, self._next = batch, 0, 0.0
        self.page = PageProcess(batch.scene, port=port)
        self.url = self.page.start()
        (say or (lambda line: print(line, file=sys.stderr)))(f"page {self.url}")

    def draw(self, world: int = 0) -> None:
        """Show a world as it is, no sooner than a period of control after the last one; nothing of it changes."""
        now = time.monotonic()
        if now < self._next:
            time.sleep(self._next - now)
        self._next = time.monotonic() + 1.0 / self.batch.task.rate
        for _ in self.page.commands():
            self.page.complain("actions of the environment move its traps; allowed: looking")
        self._beat += 1
        self.page.publish(self._frame(world))

    def close(self) -> None:
        """End the page; may be called more than once."""
        self.page.close()

    def _frame(self, world: int) -> Any:
        """`LiveFrame` of a world, with forces of traps that are measured for it alone."""
        from otwarp.simulation.frame import SHAPES, capture_frame
        from otwarp.teleop import LiveFrame

        batch, sim = self.batch, self.batch.sim
        # terms of the next period read what the last step measured, not this
        kept = {name: (array, wp.clone(array)) for name, array in sim.arrays().items() if name.startswith("readout.")}
        sim.measure()
        frame = capture_frame(sim).copy()
        force = sim.last_readout.hand_force.numpy()[world].astype(float)
        for array, before in kept.values():
            wp.copy(array, before)
        period = int(batch.episode.period.numpy()[world])
        places = {name: getattr(frame, name)[world : world + 1] for name in SHAPES}
        places["trap_position"] = batch.episode.focus.numpy()[world : world + 1]
        frame = dataclasses.replace(frame, time=period / batch.task.rate, **places)
        task = f"{batch.task.name}: period {period}"
        return LiveFrame(beat=self._beat, wall=time.monotonic(), frame=frame, hand_force=np.array(force), task=task)
