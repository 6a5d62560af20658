"""A user's loop as one graph: commands, steps and readout, launched again and again without Python between them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import warp as wp

from otwarp.errors import InputError
from otwarp.simulation.compilation import load_kernels

if TYPE_CHECKING:
    from otwarp.simulation.episodes import Episodes
    from otwarp.simulation.simulation import Simulation


class CapturedLoop:
    """What `Simulation.capture` makes: called, it replays its graph.

    Attributes:
        steps: Time steps of one turn.
        graph: The graph, for whoever launches it on a stream of his own (`wp.capture_launch(loop.graph, stream)`).
    """

    def __init__(
        self,
        sim: Simulation,
        episodes: Episodes,
        steps: int,
        before: Callable[[], Any] | None,
        after: Callable[[], Any] | None,
        *,
        readout: bool,
    ):
        self.sim, self.episodes, self.steps, self._layout = sim, episodes, steps, sim.control.layout
        self._readout = readout
        episodes.load()
        load_kernels(sim._step.kernels, sim.model.device)
        with wp.ScopedCapture(device=sim.model.device) as capture:
            if before is not None:
                before()
            sim._segment(episodes, steps)
            if readout:
                sim.measure()
            if after is not None:
                after()
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
        self.sim._count(turns * self.steps, measured=self._readout)
        self.episodes.at_most = self.sim.model.worlds
