"""A user's loop as one graph: commands, steps and readout, launched again and again without Python between them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import warp as wp

from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.simulation.simulation import Simulation


class CapturedLoop:
    """What `Simulation.capture` makes: called, it replays its graph.

    Attributes:
        steps: Time steps of one turn.
        graph: The graph, for whoever launches it on a stream of his own (`wp.capture_launch(loop.graph, stream)`).

    Args:
        sim: What steps, with episodes; its kernels are loaded.
        steps: As above.
        turn: Launches one turn.
        count: Counts `n` turns as steps taken.
    """

    def __init__(self, sim: Simulation, steps: int, turn: Callable[[], None], count: Callable[[int], None]):
        self.sim, self.steps = sim, steps
        self._count, self._layout = count, sim.control.layout
        with wp.ScopedCapture(device=sim.model.device) as capture:
            turn()
        assert capture.graph is not None
        self.graph = capture.graph

    def __call__(self, turns: int = 1) -> None:
        """Replay the graph; on a GPU without waiting for it.

        Raises:
            InputError: An array of the control has grown since, so that the graph writes to the old one.
        """
        if self.sim.control.layout != self._layout:
            raise InputError("an array of the control has grown since the capture; allowed: control.widen(…) before it")
        for _ in range(turns):
            wp.capture_launch(self.graph)
        self._count(turns)
        self.sim.episodes.at_most = self.sim.model.worlds
