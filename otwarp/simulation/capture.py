"""A user's loop as one graph: commands, steps and readout, launched again and again without Python between them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp

from otwarp.errors import InputError
from otwarp.simulation.episodes import Episodes
from otwarp.simulation.packing.arguments import whole
from otwarp.simulation.state import Control

MOST_STEPS = 100_000
"""Time steps of one turn that are never too many: as many as a period of an environment may have."""

MOST_LAUNCHES = 10_000
"""Launches of one turn where each takes many steps: on a CPU they take some seconds to record and 0.2 GB."""


def steps_of_turn(steps: Any, captured_steps: int) -> int:
    """Time steps of one turn, no more than a graph should hold, as each launch is recorded by itself.

    Args:
        steps: As the user gave them.
        captured_steps: Steps that one launch in the graph takes.

    Raises:
        InputError: No whole number, below 1, or too many.
    """
    steps = whole("steps", steps, 1)
    most = max(MOST_STEPS, MOST_LAUNCHES * captured_steps)
    if steps > most:
        raise InputError(f"steps is {steps}; allowed: 1 to {most} a turn, which is then repeated: loop(turns)")
    return steps


class CapturedLoop:
    """What `Simulation.capture` makes: called, it replays its graph.

    Attributes:
        steps: Time steps of one turn.
        measured: Whether the readout is of the end of a turn: not where worlds are started anew behind it.
        graph: The graph, for whoever launches it on a stream of his own (`wp.capture_launch(loop.graph, stream)`); of
            all worlds, `episodes.list_all()` comes first where other steps have been taken since the capture.

    Args:
        control, episodes: Of what steps, whose kernels are loaded.
        steps: As above.
        turn: Launches one turn.
        count: Counts `n` steps as taken, `measured` or not.
        every_world: Whether the graph steps all worlds, and makes no list of its own.
    """

    def __init__(
        self,
        control: Control,
        episodes: Episodes,
        steps: int,
        turn: Callable[[], None],
        count: Callable[..., None],
        *,
        every_world: bool = False,
    ):
        self.steps, self.measured = steps, False
        self._every_world = every_world
        self._control, self._episodes = control, episodes
        self._count, self._layout = count, control.layout
        if every_world:
            episodes.list_all()
        with wp.ScopedCapture(device=control.model.device) as capture:
            turn()
        assert capture.graph is not None
        self.graph = capture.graph

    def __call__(self, turns: int = 1) -> None:
        """Replay the graph `turns` times; on a GPU without waiting for it.

        Raises:
            InputError: `turns` is negative, or no whole number; an array of the control has grown since, so that the
                graph writes to the old one.
        """
        turns = whole("turns", turns, 0)
        if self._control.layout != self._layout:
            raise InputError("an array of the control has grown since the capture; allowed: control.widen(…) before it")
        if self._every_world:
            self._episodes.list_all()
        for _ in range(turns):
            wp.capture_launch(self.graph)
        if not self._every_world:
            self._episodes.complete = False
        self._count(turns * self.steps, measured=self.measured and turns > 0)
        self._episodes.at_most = self._control.model.worlds
